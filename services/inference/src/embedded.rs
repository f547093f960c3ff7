//! The pure-Rust back end: rten.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use rten::{DataType, Dimension, NodeId, RunOptions, ThreadPool, ValueType};
use rten_tensor::TensorView;
use rten_tensor::prelude::*;

use crate::load::{LoadError, LoadOptions};
use crate::model::{Model, Port, RunError, Signature};
use crate::tensor::Tensor;

const NAME: &str = "embedded";

struct Embedded {
    network: rten::Model,
    signature: Signature,
    input: NodeId,
    outputs: Vec<NodeId>,
    threads: Option<Arc<ThreadPool>>,
}

pub(crate) fn open(
    path: &Path,
    bytes: Vec<u8>,
    options: &LoadOptions,
) -> Result<Box<dyn Model>, LoadError> {
    let refused = |reason: String| LoadError::NotAModel {
        path: path.to_owned(),
        back_end: NAME,
        reason,
    };
    // The library promises memory safety for hostile files, and not that it never panics.
    let network = catch_unwind(|| rten::Model::load(bytes))
        .map_err(|_| refused("the file is damaged".to_owned()))?
        .map_err(|error| refused(error.to_string()))?;
    let ports = |ids: &[NodeId]| ids.iter().map(|id| port(&network, *id)).collect();
    let signature = Signature {
        back_end: NAME.to_owned(),
        inputs: ports(network.input_ids()),
        outputs: ports(network.output_ids()),
    };
    let input = *network
        .input_ids()
        .first()
        .ok_or_else(|| refused("it has no input".to_owned()))?;
    let outputs = network.output_ids().to_vec();
    let threads = options
        .threads
        .map(|n| Arc::new(ThreadPool::with_num_threads(n)));
    Ok(Box::new(Embedded {
        network,
        signature,
        input,
        outputs,
        threads,
    }))
}

fn port(network: &rten::Model, id: NodeId) -> Port {
    let node = network.node_info(id);
    let shape = node.as_ref().and_then(rten::NodeInfo::shape);
    let shape = shape.map(|dimensions| {
        let size = |d: &Dimension| match d {
            Dimension::Fixed(size) => Some(*size),
            Dimension::Symbolic(_) => None,
        };
        dimensions.iter().map(size).collect()
    });
    let kind = node.as_ref().and_then(rten::NodeInfo::dtype);
    Port {
        name: node.and_then(|n| n.name()).unwrap_or_default().to_owned(),
        shape,
        is_f32: kind.is_none_or(|kind| kind == ValueType::Tensor(DataType::Float)),
    }
}

impl Model for Embedded {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn run(&mut self, input: &Tensor, outputs: &mut Vec<Tensor>) -> Result<(), RunError> {
        let takes = &self.signature.inputs[0];
        if !takes.takes(input.shape()) {
            return Err(RunError::Input {
                expected: takes.to_string(),
                found: input.shape().to_vec(),
            });
        }
        let failed = |reason: String| RunError::BackEnd {
            back_end: NAME.to_owned(),
            reason,
        };
        let view = TensorView::from_data(input.shape(), input.values());
        let options = RunOptions::default().with_thread_pool(self.threads.clone());
        let run = || {
            let inputs = vec![(self.input, view.into())];
            self.network.run(inputs, &self.outputs, Some(options))
        };
        let values = catch_unwind(AssertUnwindSafe(run))
            .map_err(|_| failed("it panicked".to_owned()))?
            .map_err(|error| failed(error.to_string()))?;
        outputs.resize_with(values.len(), Tensor::default);
        for ((value, output), port) in values.iter().zip(outputs).zip(&self.signature.outputs) {
            let view = value
                .as_tensor_view::<f32>()
                .ok_or_else(|| RunError::Output {
                    name: port.name.clone(),
                    found: "not single precision".to_owned(),
                })?;
            output.reset(view.shape());
            for (place, number) in output.values_mut().iter_mut().zip(view.iter()) {
                *place = *number;
            }
        }
        Ok(())
    }
}
