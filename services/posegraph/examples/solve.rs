//! Solves a g2o file every way and says how long each took.
//!
//! `cargo run --release -p hachi-posegraph --example solve -- FILE.g2o`
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::fs::File;
use std::io::BufReader;
use std::time::Instant;

use hachi_posegraph::batch::{self, Method, Options};
use hachi_posegraph::g2o::{self, Contents, Document};
use hachi_posegraph::initialise::{self, Rigid};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("give a g2o file")?;
    let begun = Instant::now();
    let document = g2o::read(BufReader::new(File::open(path)?))?;
    println!("read in {:.1} ms", begun.elapsed().as_secs_f64() * 1e3);
    match document {
        Document::Plane(contents) => solve(contents),
        Document::Space(contents) => solve(contents),
    }
}

fn solve<G: Rigid>(mut contents: Contents<G>) -> Result<(), Box<dyn Error>> {
    let graph = contents.graph()?;
    println!(
        "{} poses, {} edges, {:?}",
        graph.len(),
        contents.edges.len(),
        contents.repairs
    );
    for start in ["file", "tree", "rotations"] {
        let mut graph = graph.clone();
        let begun = Instant::now();
        match start {
            "tree" => initialise::spanning_tree(&mut graph),
            "rotations" => initialise::rotations_first(&mut graph)?,
            _ => {}
        }
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        println!("{start}: error {:.8} in {ms:.1} ms", graph.error());
        for method in [Method::GaussNewton, Method::LevenbergMarquardt] {
            let mut graph = graph.clone();
            let options = Options {
                method,
                ..Options::default()
            };
            let begun = Instant::now();
            let report = batch::optimize(&mut graph, &options)?;
            let ms = begun.elapsed().as_secs_f64() * 1e3;
            println!("  {method:?}: {report:?} in {ms:.1} ms");
        }
    }
    Ok(())
}
