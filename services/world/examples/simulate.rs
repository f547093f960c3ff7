//! Writes a simulated capture and its truth: `simulation.pcap`, `truth.tum` and `true_loops.csv`,
//! the loops of the walk.
//!
//! `cargo run --release -p hachi-world --example simulate -- --preset glass-corridor --seconds 20 --out DIR`
#![allow(clippy::print_stdout, reason = "a program that reports to a person")]

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use hachi_world::{
    LoopSearch, Preset, SensorKind, Simulation, SimulationConfig, write_pcap, write_tum,
};

#[derive(Parser)]
struct Arguments {
    /// office, glass-corridor, corridor, stress, building, campus or campus-long.
    #[arg(long, default_value = "office", value_parser = preset)]
    preset: Preset,
    /// vlp16, vlp16-dual or helios16p.
    #[arg(long, default_value = "vlp16", value_parser = sensor)]
    sensor: SensorKind,
    /// Decides the layout of the building and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How long the robot walks.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// The folder for the files.
    #[arg(long)]
    out: PathBuf,
}

fn preset(name: &str) -> Result<Preset, String> {
    Preset::from_name(name).ok_or_else(|| {
        let names: Vec<_> = Preset::ALL.iter().map(|preset| preset.name()).collect();
        format!("choose one of {}", names.join(", "))
    })
}

fn sensor(name: &str) -> Result<SensorKind, String> {
    match name {
        "vlp16" => Ok(SensorKind::Vlp16),
        "vlp16-dual" => Ok(SensorKind::Vlp16Dual),
        "helios16p" => Ok(SensorKind::Helios16P),
        _ => Err("choose one of vlp16, vlp16-dual, helios16p".into()),
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.out)?;
    let mut config = SimulationConfig::preset(arguments.preset, arguments.seed, arguments.seconds);
    config.sensor = arguments.sensor;
    println!(
        "{}: {} objects of {} parts, one round takes {:.1} s",
        arguments.preset.name(),
        config.scene.object_count(),
        config.scene.primitive_count(),
        config.trajectory.period_s(),
    );
    let mut simulation = Simulation::new(config);
    let began = Instant::now();
    let capture = File::create(arguments.out.join("simulation.pcap"))?;
    let packets = write_pcap(&mut simulation, BufWriter::new(capture))?;
    let took = began.elapsed().as_secs_f64();
    let truth = File::create(arguments.out.join("truth.tum"))?;
    write_tum(simulation.config().truth(10_000_000), BufWriter::new(truth))?;
    let loops = simulation.config().true_loops(&LoopSearch::default());
    let mut table = BufWriter::new(File::create(arguments.out.join("true_loops.csv"))?);
    writeln!(
        table,
        "from_s,to_s,earlier_from_s,earlier_to_s,length_m,distance_m,yaw_deg,direction"
    )?;
    let start = simulation.config().start;
    for pass in &loops.passes {
        let times = [
            pass.first.later,
            pass.last.later,
            pass.first.earlier,
            pass.last.earlier,
        ]
        .map(|stamp| format!("{:.2}", stamp.secs_since(start)));
        writeln!(
            table,
            "{},{:.1},{:.2},{:.1},{:?}",
            times.join(","),
            pass.length_m(),
            pass.nearest.distance_m,
            pass.nearest.yaw_rad.to_degrees(),
            pass.direction(),
        )?;
    }
    table.flush()?;
    println!("{:.1} m, {} loops", loops.way_m, loops.passes.len());
    println!(
        "{packets} packets in {took:.2} s: {:.1} times live",
        arguments.seconds / took
    );
    Ok(())
}
