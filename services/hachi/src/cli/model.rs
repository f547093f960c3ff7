//! Arguments of the commands about neural networks.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// What can be done with a network.
#[derive(Debug, Subcommand)]
#[command(after_help = "Example:\n  hachi model check models/yolox_nano_416x416.onnx")]
pub enum Model {
    /// Load a model, compare it with its manifest, run it once.
    Check(ModelArguments),
    /// Measure how fast a model runs.
    Bench(ModelBenchArguments),
}

/// Arguments of `hachi model check`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
The manifest lies beside the model, with .toml for .onnx; some published models need none.

Example:
  hachi model check detector.onnx --json")]
pub struct ModelArguments {
    /// The model: a file, `own:detector` or `own:reid`.
    #[arg(value_name = "MODEL.onnx")]
    pub model: PathBuf,
    /// Its manifest, if it lies elsewhere.
    #[arg(long, value_name = "FILE.toml")]
    pub manifest: Option<PathBuf>,
    /// What runs it [default: ONNX Runtime where it is there].
    #[arg(long, value_enum)]
    pub back_end: Option<BackEndArgument>,
    /// Threads [default: one for each core].
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Run it on the GPU, and fail where there is none.
    #[arg(long)]
    pub gpu: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi model bench`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  hachi model bench detector.onnx --runs 50 --threads 1")]
pub struct ModelBenchArguments {
    /// The model and what runs it.
    #[command(flatten)]
    pub model: ModelArguments,
    /// How often it is run.
    #[arg(long, value_name = "N", default_value = "20")]
    pub runs: NonZeroUsize,
}

/// What runs a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BackEndArgument {
    /// Pure Rust, in this program.
    Embedded,
    /// ONNX Runtime's shared library, which ORT_DYLIB_PATH names.
    Onnxruntime,
}
