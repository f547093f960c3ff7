//! Writes a simulated capture and its truth: `simulation.pcap` and `truth.tum`.
//!
//! `cargo run --release -p hachi-world --example simulate -- --preset glass-corridor --seconds 20 --out DIR`
#![allow(clippy::print_stdout, reason = "a program that reports to a person")]

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use hachi_world::{Preset, SensorKind, Simulation, SimulationConfig, write_pcap, write_tum};

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
    println!(
        "{packets} packets in {took:.2} s: {:.1} times live",
        arguments.seconds / took
    );
    Ok(())
}
