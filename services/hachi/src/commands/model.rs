//! `hachi model check` and `bench`: whether a network is what its manifest says, and how fast.

use std::time::Instant;

use hachi_inference::{BackEnd, LoadOptions, Loaded, Tensor, load};
use serde::Serialize;

use crate::cli::model::{BackEndArgument, Model, ModelArguments, ModelBenchArguments};
use crate::exit::Failure;
use crate::networks::unloaded;
use crate::output;

/// Runs a command.
///
/// # Errors
/// The model can't be loaded or run, or is not what its manifest says.
pub fn run(command: &Model) -> Result<(), Failure> {
    match command {
        Model::Check(arguments) => check(arguments),
        Model::Bench(arguments) => bench(arguments),
    }
}

#[derive(Debug, Serialize)]
struct Checked {
    about: String,
    back_end: String,
    input: String,
    outputs: Vec<String>,
    load_ms: f64,
}

#[derive(Debug, Serialize)]
struct Benched {
    #[serde(flatten)]
    checked: Checked,
    runs: usize,
    median_ms: f64,
    min_ms: f64,
    max_ms: f64,
}

fn open(arguments: &ModelArguments) -> Result<(Loaded, Checked), Failure> {
    let options = LoadOptions {
        back_end: arguments.back_end.map(|back_end| match back_end {
            BackEndArgument::Embedded => BackEnd::Embedded,
            BackEndArgument::Onnxruntime => BackEnd::OnnxRuntime,
        }),
        threads: arguments.threads.map(Into::into),
        manifest: arguments.manifest.clone(),
        accelerated: arguments.gpu,
    };
    let begun = Instant::now();
    let loaded = load(&arguments.model, &options).map_err(|error| unloaded(&error))?;
    let signature = loaded.model.signature();
    let checked = Checked {
        about: loaded.manifest.about.clone(),
        back_end: signature.back_end.clone(),
        input: signature.inputs[0].to_string(),
        outputs: signature.outputs.iter().map(ToString::to_string).collect(),
        load_ms: begun.elapsed().as_secs_f64() * 1e3,
    };
    Ok((loaded, checked))
}

fn check(arguments: &ModelArguments) -> Result<(), Failure> {
    let (_, checked) = open(arguments)?;
    match arguments.json {
        true => output::json(&checked),
        false => output::text(&text(&checked)),
    }
}

fn bench(arguments: &ModelBenchArguments) -> Result<(), Failure> {
    let (mut loaded, checked) = open(&arguments.model)?;
    let input = Tensor::zeros(&loaded.manifest.input_shape(1));
    let mut outputs = Vec::new();
    let mut times_ms = Vec::new();
    for _ in 0..arguments.runs.get() {
        let begun = Instant::now();
        let ran = loaded.model.run(&input, &mut outputs);
        ran.map_err(|error| Failure::new(error, "check the model with `hachi model check`"))?;
        times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    let benched = Benched {
        checked,
        runs: times_ms.len(),
        median_ms: times_ms[times_ms.len() / 2],
        min_ms: times_ms[0],
        max_ms: times_ms[times_ms.len() - 1],
    };
    match arguments.model.json {
        true => output::json(&benched),
        false => output::text(&format!(
            "{}{} runs: median {:.2} ms, least {:.2}, most {:.2}",
            text(&benched.checked),
            benched.runs,
            benched.median_ms,
            benched.min_ms,
            benched.max_ms
        )),
    }
}

fn text(checked: &Checked) -> String {
    let mut text = format!(
        "{}\nruns on {}, loaded and tried in {:.0} ms\ninput   {}\n",
        checked.about, checked.back_end, checked.load_ms, checked.input
    );
    for output in &checked.outputs {
        text += &format!("output  {output}\n");
    }
    text
}
