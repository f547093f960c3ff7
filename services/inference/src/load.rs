//! A model from its file, on the back end that is there, checked against its manifest.
//!
//! In: the path of an ONNX file. Its manifest lies beside it (the same name with `.toml`), or is
//! one of the [`known`]. With the feature `own`, the name of a network in the program itself does
//! as well. Out: a [`Loaded`] model that has answered once: what it announces and
//! what it gives are what the manifest says, in shape and in finite numbers.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::known;
use crate::manifest::{Manifest, ManifestError};
use crate::model::{Model, RunError};
use crate::onnx_file::{self, NotOnnx};
use crate::tensor::Tensor;

/// Larger files are refused: networks for a robot are smaller.
pub const MAX_MODEL_BYTES: u64 = 2 << 30;
/// No manifest is longer.
const MAX_MANIFEST_BYTES: u64 = 64 * 1024;

/// What runs models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BackEnd {
    /// Pure Rust, in this program.
    Embedded,
    /// ONNX Runtime's shared library.
    OnnxRuntime,
}

/// How a model is run.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions {
    /// Which back end; the fastest that is there, if none is named: ONNX Runtime where it is built
    /// in and `ORT_DYLIB_PATH` names its library.
    pub back_end: Option<BackEnd>,
    /// Threads; as many as there are cores if none are named.
    pub threads: Option<usize>,
    /// The manifest, if it lies elsewhere.
    pub manifest: Option<PathBuf>,
    /// Whether to ask for CUDA or TensorRT, and fail without them (with the feature `jetson`).
    pub accelerated: bool,
}

/// A model that answers as its manifest says.
pub struct Loaded {
    /// Its description.
    pub manifest: Manifest,
    /// Itself.
    pub model: Box<dyn Model>,
}

impl std::fmt::Debug for Loaded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Loaded")
            .field("manifest", &self.manifest)
            .field("signature", self.model.signature())
            .finish()
    }
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A file can't be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file is too large.
    #[error("{} has more than {limit} bytes", path.display())]
    TooLarge {
        /// Which.
        path: PathBuf,
        /// How many it may have.
        limit: u64,
    },
    /// Nothing says how to use it.
    #[error("{} has no manifest: {} is missing", model.display(), expected.display())]
    NoManifest {
        /// The model.
        model: PathBuf,
        /// Where the manifest should lie.
        expected: PathBuf,
    },
    /// The manifest is none, or of another model.
    #[error("{}: {source}", path.display())]
    Manifest {
        /// The manifest or the model.
        path: PathBuf,
        /// What is wrong.
        source: ManifestError,
    },
    /// The file is no ONNX file, or part of one.
    #[error("{}: {source}", path.display())]
    NotOnnx {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: NotOnnx,
    },
    /// The file is no model that the back end knows.
    #[error("{} is no model for {back_end}: {reason}", path.display())]
    NotAModel {
        /// The file.
        path: PathBuf,
        /// What refused it.
        back_end: &'static str,
        /// Why.
        reason: String,
    },
    /// It loads, and does not run.
    #[error("{} does not run: {source}", path.display())]
    Trial {
        /// The file.
        path: PathBuf,
        /// Why.
        source: RunError,
    },
    /// The back end is not there.
    #[error("{back_end} is not there: {reason}")]
    Unavailable {
        /// Which.
        back_end: &'static str,
        /// Why.
        reason: String,
    },
}

/// Loads a model and tries it once.
///
/// # Errors
/// [`LoadError`], with what was expected and found.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let bytes = match own_bytes(path) {
        Some(bytes) => bytes.to_vec(),
        None => read(path, MAX_MODEL_BYTES)?,
    };
    let manifest = manifest_of(path, options)?;
    let wrong = |source| LoadError::Manifest {
        path: path.to_owned(),
        source,
    };
    onnx_file::check(&bytes).map_err(|source| LoadError::NotOnnx {
        path: path.to_owned(),
        source,
    })?;
    let mut model = open(path, bytes, options)?;
    manifest.check_signature(model.signature()).map_err(wrong)?;
    let images = if manifest.input.many { 2 } else { 1 };
    let input = Tensor::zeros(&manifest.input_shape(images));
    let mut outputs = Vec::new();
    model
        .run(&input, &mut outputs)
        .map_err(|source| LoadError::Trial {
            path: path.to_owned(),
            source,
        })?;
    for (index, output) in outputs.iter().enumerate() {
        manifest
            .check_output(index, images, output.shape())
            .map_err(wrong)?;
        if !output.values().iter().all(|v| v.is_finite()) {
            let announced = model.signature().outputs.get(index);
            return Err(LoadError::Trial {
                path: path.to_owned(),
                source: RunError::Output {
                    name: announced.map_or_else(String::new, |port| port.name.clone()),
                    found: "not all finite numbers".to_owned(),
                },
            });
        }
    }
    Ok(Loaded { manifest, model })
}

/// The manifest of a model: named, its own, beside it, or known.
///
/// # Errors
/// There is none, or it is wrong.
pub fn manifest_of(path: &Path, options: &LoadOptions) -> Result<Manifest, LoadError> {
    let own = own_manifest(path).filter(|_| options.manifest.is_none());
    if let Some(text) = own {
        return parse(text, path);
    }
    let beside = path.with_extension("toml");
    let file = options.manifest.clone().unwrap_or_else(|| beside.clone());
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let text = match read(&file, MAX_MANIFEST_BYTES) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(LoadError::Io { source, .. })
            if source.kind() == std::io::ErrorKind::NotFound && options.manifest.is_none() =>
        {
            let known = stem.and_then(known::manifest);
            let known = known.ok_or_else(|| LoadError::NoManifest {
                model: path.to_owned(),
                expected: beside.clone(),
            })?;
            known.to_owned()
        }
        Err(error) => return Err(error),
    };
    parse(&text, &file)
}

fn parse(text: &str, path: &Path) -> Result<Manifest, LoadError> {
    Manifest::from_toml(text).map_err(|source| LoadError::Manifest {
        path: path.to_owned(),
        source,
    })
}

#[cfg(feature = "own")]
fn own_bytes(path: &Path) -> Option<&'static [u8]> {
    crate::own::Own::from_name(path).map(crate::own::Own::bytes)
}

#[cfg(feature = "own")]
fn own_manifest(path: &Path) -> Option<&'static str> {
    crate::own::Own::from_name(path).map(crate::own::Own::manifest)
}

#[cfg(not(feature = "own"))]
const fn own_bytes(_: &Path) -> Option<&'static [u8]> {
    None
}

#[cfg(not(feature = "own"))]
const fn own_manifest(_: &Path) -> Option<&'static str> {
    None
}

fn read(path: &Path, limit: u64) -> Result<Vec<u8>, LoadError> {
    let io = |source| LoadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(io)?;
    file.take(limit + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limit {
        return Err(LoadError::TooLarge {
            path: path.to_owned(),
            limit,
        });
    }
    Ok(bytes)
}

#[cfg_attr(
    not(any(feature = "embedded", feature = "onnxruntime")),
    allow(unused_variables, reason = "without a back end nothing is opened")
)]
fn open(path: &Path, bytes: Vec<u8>, options: &LoadOptions) -> Result<Box<dyn Model>, LoadError> {
    let named = std::env::var_os("ORT_DYLIB_PATH").is_some();
    let usual = match cfg!(feature = "onnxruntime") && (named || !cfg!(feature = "embedded")) {
        true => BackEnd::OnnxRuntime,
        false => BackEnd::Embedded,
    };
    match options.back_end.unwrap_or(usual) {
        #[cfg(feature = "embedded")]
        BackEnd::Embedded => crate::embedded::open(path, bytes, options),
        #[cfg(feature = "onnxruntime")]
        BackEnd::OnnxRuntime => crate::onnxruntime::open(path, &bytes, options),
        #[allow(
            unreachable_patterns,
            reason = "which back ends there are is a matter of features"
        )]
        other => Err(LoadError::Unavailable {
            back_end: match other {
                BackEnd::Embedded => "the embedded back end",
                BackEnd::OnnxRuntime => "ONNX Runtime",
            },
            reason: "this program is built without it".to_owned(),
        }),
    }
}
