//! Feeds a g2o file to iSAM2 one pose at a time and says how long updates took.
//!
//! `cargo run --release -p hachi-posegraph --example incremental -- FILE.g2o [RELINEARISE [PROPAGATE]]`
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::fs::File;
use std::io::BufReader;
use std::time::Instant;

use hachi_posegraph::g2o::{self, Contents, Document};
use hachi_posegraph::initialise::Rigid;
use hachi_posegraph::replay::Replay;
use hachi_posegraph::{Isam2, Isam2Config};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give a g2o file")?;
    let mut config = Isam2Config::default();
    if let Some(threshold) = arguments.next() {
        config.relinearise_threshold = threshold.parse()?;
    }
    if let Some(threshold) = arguments.next() {
        config.propagate_threshold = threshold.parse()?;
    }
    match g2o::read(BufReader::new(File::open(path)?))? {
        Document::Plane(contents) => feed(contents, config),
        Document::Space(contents) => feed(contents, config),
    }
}

fn feed<G: Rigid>(mut contents: Contents<G>, config: Isam2Config) -> Result<(), Box<dyn Error>> {
    let mut graph = contents.graph()?;
    let mut isam = Isam2::new(config);
    let mut replay = Replay::new(&graph);
    let mut ms = Vec::new();
    let mut relinearised = 0;
    let mut affected = 0;
    let mut solved = 0;
    while let Some(step) = replay.next_step(&isam) {
        let begun = Instant::now();
        let report = isam.update(&step.factors, &[(step.key, step.pose)], &[])?;
        ms.push(begun.elapsed().as_secs_f64() * 1e3);
        relinearised += report.relinearised;
        affected += report.affected;
        solved += report.solved;
    }
    let error = |isam: &Isam2<G>, graph: &mut hachi_posegraph::Graph<G>| {
        for (key, pose) in isam.estimates() {
            graph.set_pose(key, pose)?;
        }
        Ok::<f64, hachi_posegraph::Error>(graph.squared_error())
    };
    println!("error as fed {:.6}", error(&isam, &mut graph)?);
    for _ in 0..5 {
        isam.update(&[], &[], &[])?;
    }
    println!(
        "error after 5 more updates {:.6}",
        error(&isam, &mut graph)?
    );
    let total: f64 = ms.iter().sum();
    ms.sort_by(f64::total_cmp);
    let at = |share: f64| ms[((ms.len() - 1) as f64 * share) as usize];
    println!(
        "{} updates, {total:.1} ms, median {:.4}, p99 {:.3}, max {:.2}; \
         {relinearised} relinearised, {affected} affected, {solved} solved",
        ms.len(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
    Ok(())
}
