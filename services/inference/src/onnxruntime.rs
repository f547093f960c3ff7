//! ONNX Runtime's shared library, opened at run time.
//!
//! `ORT_DYLIB_PATH` names the library. It is opened once for the whole program.

use std::path::Path;
use std::sync::OnceLock;

use ort::environment::Environment;
use ort::session::Session;
use ort::value::{Outlet, TensorElementType, TensorRef, ValueType};

use crate::load::{LoadError, LoadOptions};
use crate::model::{Model, Port, RunError, Signature};
use crate::tensor::Tensor;

const NAME: &str = "ONNX Runtime";

struct OnnxRuntime {
    session: Session,
    signature: Signature,
}

fn environment() -> Result<&'static Environment, LoadError> {
    static ENVIRONMENT: OnceLock<Result<Environment, String>> = OnceLock::new();
    let opened = ENVIRONMENT.get_or_init(|| {
        let path = std::env::var_os("ORT_DYLIB_PATH")
            .ok_or("ORT_DYLIB_PATH names no library (libonnxruntime.so)")?;
        let builder = ort::init_from(&path)
            .map_err(|error| format!("{} can't be opened: {error}", path.display()))?;
        builder.build().map_err(|error| error.to_string())
    });
    opened.as_ref().map_err(|reason| LoadError::Unavailable {
        back_end: NAME,
        reason: reason.clone(),
    })
}

pub(crate) fn open(
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<Box<dyn Model>, LoadError> {
    let environment = environment()?;
    let (session, provider) =
        session(environment, bytes, options).map_err(|reason| LoadError::NotAModel {
            path: path.to_owned(),
            back_end: NAME,
            reason,
        })?;
    let ports = |outlets: &[Outlet]| outlets.iter().map(port).collect();
    let signature = Signature {
        back_end: format!("onnxruntime ({provider})"),
        inputs: ports(session.inputs()),
        outputs: ports(session.outputs()),
    };
    Ok(Box::new(OnnxRuntime { session, signature }))
}

fn session(
    environment: &Environment,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<(Session, &'static str), String> {
    let mut builder = Session::builder(environment).map_err(|e| e.to_string())?;
    if let Some(threads) = options.threads {
        builder = builder
            .with_intra_threads(threads)
            .map_err(|e| e.to_string())?;
    }
    let mut provider = "CPU";
    if options.accelerated {
        (builder, provider) = accelerated(builder)?;
    }
    let session = builder
        .commit_from_memory(bytes)
        .map_err(|e| e.to_string())?;
    Ok((session, provider))
}

/// Without `error_on_failure` a missing GPU library would silently mean the CPU.
#[cfg(feature = "jetson")]
fn accelerated(
    builder: ort::session::builder::SessionBuilder,
) -> Result<(ort::session::builder::SessionBuilder, &'static str), String> {
    let tensorrt = ort::ep::TensorRT::default().build().error_on_failure();
    match builder.with_execution_providers([tensorrt]) {
        Ok(builder) => Ok((builder, "TensorRT")),
        Err(error) => {
            let cuda = ort::ep::CUDA::default().build().error_on_failure();
            let builder = error.recover().with_execution_providers([cuda]);
            Ok((builder.map_err(|e| e.to_string())?, "CUDA"))
        }
    }
}

#[cfg(not(feature = "jetson"))]
fn accelerated(
    _: ort::session::builder::SessionBuilder,
) -> Result<(ort::session::builder::SessionBuilder, &'static str), String> {
    Err("this program is built without CUDA and TensorRT (feature `jetson`)".to_owned())
}

fn port(outlet: &Outlet) -> Port {
    let (shape, is_f32) = match outlet.dtype() {
        ValueType::Tensor { ty, shape, .. } => {
            let sizes = shape.iter().map(|d| usize::try_from(*d).ok()).collect();
            (Some(sizes), *ty == TensorElementType::Float32)
        }
        _ => (None, false),
    };
    Port {
        name: outlet.name().to_owned(),
        shape,
        is_f32,
    }
}

impl Model for OnnxRuntime {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn run(&mut self, input: &Tensor, outputs: &mut Vec<Tensor>) -> Result<(), RunError> {
        let takes = self.signature.inputs.first();
        if !takes.is_some_and(|port| port.takes(input.shape())) {
            return Err(RunError::Input {
                expected: takes.map(ToString::to_string).unwrap_or_default(),
                found: input.shape().to_vec(),
            });
        }
        let failed = |error: ort::Error| RunError::BackEnd {
            back_end: NAME.to_owned(),
            reason: error.to_string(),
        };
        let value = TensorRef::from_array_view((input.shape(), input.values())).map_err(failed)?;
        let values = self.session.run(ort::inputs![value]).map_err(failed)?;
        outputs.resize_with(self.signature.outputs.len(), Tensor::default);
        for (output, port) in outputs.iter_mut().zip(&self.signature.outputs) {
            let wrong = |found: &str| RunError::Output {
                name: port.name.clone(),
                found: found.to_owned(),
            };
            let value = values
                .get(port.name.as_str())
                .ok_or_else(|| wrong("missing"))?;
            let (shape, numbers) = value.try_extract_tensor::<f32>().map_err(failed)?;
            let sizes: Result<Vec<_>, _> = shape.iter().map(|d| usize::try_from(*d)).collect();
            let sizes = sizes.map_err(|_| wrong("of negative size"))?;
            output.reset(&sizes);
            output.values_mut().copy_from_slice(numbers);
        }
        Ok(())
    }
}
