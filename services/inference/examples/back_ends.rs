//! How fast models run on each back end of this build, one image at a time.
//!
//! `ORT_DYLIB_PATH=libonnxruntime.so cargo run --release -p hachi-inference --features onnxruntime
//! --example back_ends -- THREADS MODEL.onnx...`
#![allow(clippy::print_stdout, reason = "an example prints its result")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use hachi_inference::{BackEnd, LoadOptions, Tensor, load};

const RUNS: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let threads = arguments
        .next()
        .ok_or("give a number of threads")?
        .parse()?;
    for model in arguments {
        for back_end in [BackEnd::Embedded, BackEnd::OnnxRuntime] {
            let options = LoadOptions {
                back_end: Some(back_end),
                threads: Some(threads),
                ..LoadOptions::default()
            };
            let mut loaded = match load(Path::new(&model), &options) {
                Ok(loaded) => loaded,
                Err(error) => {
                    println!("{error}");
                    continue;
                }
            };
            let input = Tensor::zeros(&loaded.manifest.input_shape(1));
            let mut outputs = Vec::new();
            let mut times_ms = Vec::new();
            for _ in 0..RUNS {
                let begun = Instant::now();
                loaded.model.run(&input, &mut outputs)?;
                times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
            }
            times_ms.sort_by(f64::total_cmp);
            let name = &loaded.model.signature().back_end;
            println!(
                "{model}  {name}: median {:.1} ms, least {:.1}",
                times_ms[RUNS / 2],
                times_ms[0]
            );
        }
    }
    Ok(())
}
