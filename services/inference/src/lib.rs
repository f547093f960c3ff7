//! Neural networks: ONNX models behind one trait, described and checked by a manifest.
//!
//! In: an ONNX file with its manifest ([`Manifest`]); images. Out: numbers ([`Tensor`]). What the
//! numbers mean is decoded elsewhere (`hachi-people`).
//!
//! | module | holds |
//! |---|---|
//! | [`tensor`] | [`Tensor`]: numbers and a shape |
//! | [`model`] | the trait [`Model`], what a model takes and gives |
//! | [`manifest`] | [`Manifest`]: how to feed a model and read its answer, from TOML |
//! | [`known`] | manifests of published models that have none beside them |
//! | [`load`](mod@load) | a model from its file, on the back end that is there, checked against its manifest |
//! | `own` | with the feature `own`: two small networks in the program itself, for the simulated world |
//! | [`onnx_file`] | whether bytes are a whole ONNX file |
//! | [`preprocess`] | an image, or a part of it, as a model's input |
//! | [`fixed`] | a model of fixed answers, for tests without weights |
//!
//! Back ends: `embedded` (rten, pure Rust, the default) and `onnxruntime` (the shared library that
//! `ORT_DYLIB_PATH` names, opened at run time; with `jetson` on CUDA or TensorRT).
#![forbid(unsafe_code)]

#[cfg(feature = "embedded")]
mod embedded;
pub mod fixed;
pub mod known;
pub mod load;
pub mod manifest;
pub mod model;
pub mod onnx_file;
#[cfg(feature = "onnxruntime")]
mod onnxruntime;
#[cfg(feature = "own")]
pub mod own;
pub mod preprocess;
mod resample;
pub mod tensor;

pub use load::{BackEnd, LoadError, LoadOptions, Loaded, load};
pub use manifest::{Decoder, InputLayout, Manifest, ManifestError};
pub use model::{Model, Port, RunError, Signature};
#[cfg(feature = "own")]
pub use own::Own;
pub use preprocess::{ImageError, ImageView, Placement, Preprocessor, Region};
pub use tensor::Tensor;
