//! How long a scan of each ready-made world takes one core to simulate. The time is the thread's
//! own, as Linux counts it, so that other programs hardly disturb it.
//!
//! `cargo run --release -p hachi-world --example simulation_speed`
#![allow(clippy::print_stdout, reason = "a program that reports to a person")]

use hachi_world::{Preset, Simulation, SimulationConfig};

/// Stretches of a patrol that are simulated, evenly spread over it, and how long each lasts.
const STRETCHES: usize = 8;
const STRETCH_S: f64 = 1.0;

/// Milliseconds that this thread has run: the first number of its schedstat, in nanoseconds.
fn busy_ms() -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(f64::NAN, |ns| ns * 1e-6)
}

fn main() -> Result<(), rayon::ThreadPoolBuildError> {
    let only: Vec<String> = std::env::args().skip(1).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    println!("world            parts  ms a scan: least  median  most");
    for preset in Preset::ALL {
        if !only.is_empty() && !only.iter().any(|name| name == preset.name()) {
            continue;
        }
        let config = SimulationConfig::preset(preset, 1, 1e6);
        let mut times_ms: Vec<f64> = (0..STRETCHES)
            .map(|stretch| {
                let at_s = config.trajectory.period_s() * stretch as f64 / STRETCHES as f64;
                let mut config = config.clone();
                config.duration_s = at_s + STRETCH_S;
                let mut simulation = Simulation::new(config.clone());
                simulation.skip_to(config.start + (at_s * 1e9) as i64);
                pool.install(|| {
                    let began_ms = busy_ms();
                    while simulation.next_packet().is_some() {}
                    (busy_ms() - began_ms) / (10.0 * STRETCH_S)
                })
            })
            .collect();
        times_ms.sort_by(f64::total_cmp);
        println!(
            "{:16} {:6} {:16.2} {:7.2} {:5.2}",
            preset.name(),
            config.scene.primitive_count(),
            times_ms[0],
            times_ms[STRETCHES / 2],
            times_ms[STRETCHES - 1],
        );
    }
    Ok(())
}
