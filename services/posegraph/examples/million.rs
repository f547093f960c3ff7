//! A robot that drives laps for a million poses and recognises a place a thousand times: time and
//! memory of the batch solver, and of iSAM2 fed one pose at a time.
//!
//! `cargo run --release -p hachi-posegraph --example million -- [batch|isam2|both] [plane|space] [POSES] [LOOPS]`
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Instant;

use hachi_posegraph::batch::{self, Options};
use hachi_posegraph::initialise::{self, Rigid};
use hachi_posegraph::{Dense, Factor, Graph, Isam2, Isam2Config, Se2, Se3, Square};

/// Poses of one lap: a circle of 160 m radius at a metre a step.
const LAP: u64 = 1_000;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize, default: &str| words.get(k).map_or(default, |w| w).to_owned();
    let (what, space) = (word(0, "both"), word(1, "plane"));
    let poses = word(2, "1000000").parse()?;
    let loops = word(3, "1000").parse()?;
    match space.as_str() {
        "space" => run::<Se3>(&what, poses, loops),
        _ => run::<Se2>(&what, poses, loops),
    }
}

/// Numbers that look random and are always the same.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A step of so many metres and radians, normally distributed.
    fn step<G: Rigid>(&mut self, metres: f64, radians: f64) -> G::Tangent {
        let mut step = G::Tangent::zeros();
        for (k, v) in step.numbers_mut().iter_mut().enumerate() {
            let sigma = if k < G::SPACE { metres } else { radians };
            let normal = (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0;
            *v = sigma * normal;
        }
        step
    }
}

const METRES: f64 = 0.01;
const RADIANS: f64 = 0.000_5;

fn information<G: Rigid>() -> G::Matrix {
    let mut information = G::Matrix::identity();
    for k in 0..G::DIM {
        let sigma = if k < G::SPACE { METRES } else { RADIANS };
        information.numbers_mut()[k * (G::DIM + 1)] = 1.0 / (sigma * sigma);
    }
    information
}

/// The true step: a metre forward and the thousandth part of a turn.
fn forward<G: Rigid>() -> G {
    let mut step = G::Tangent::zeros();
    step.numbers_mut()[0] = 1.0;
    step.numbers_mut()[G::DIM - 1] = std::f64::consts::TAU / LAP as f64;
    G::identity().retract(&step)
}

/// Factors of each pose to earlier ones.
struct Drive<G: Rigid> {
    noise: Noise,
    next: u64,
    every: u64,
    step: G,
}

impl<G: Rigid> Drive<G> {
    fn new(poses: u64, loops: u64) -> Self {
        Self {
            noise: Noise(0x9E37_79B9_7F4A_7C15),
            next: 0,
            every: (poses / loops.max(1)).max(1),
            step: forward(),
        }
    }

    fn factors(&mut self) -> Vec<Factor<G>> {
        let (k, information) = (self.next, information::<G>());
        self.next += 1;
        if k == 0 {
            return vec![Factor::prior(0, G::identity(), information)];
        }
        let odometry = self.step.retract(&self.noise.step::<G>(METRES, RADIANS));
        let mut factors = vec![Factor::between(k - 1, k, odometry, information)];
        let laps = k / LAP;
        if k % self.every == self.every - 1 && laps > 0 {
            // The same place, any number of laps ago; recent laps more often, as in a patrol.
            let back = 1 + (laps as f64 * self.noise.uniform().powi(3)) as u64;
            let seen = G::identity().retract(&self.noise.step::<G>(METRES, RADIANS));
            factors.push(Factor::loop_closure(
                k - back.min(laps) * LAP,
                k,
                seen,
                information,
            ));
        }
        factors
    }
}

fn run<G: Rigid>(what: &str, poses: u64, loops: u64) -> Result<(), Box<dyn Error>> {
    if what != "isam2" {
        let mut graph = Graph::<G>::new();
        let mut drive = Drive::new(poses, loops);
        for key in 0..poses {
            graph.insert(key, G::identity())?;
            for factor in drive.factors() {
                graph.add(factor)?;
            }
        }
        let begun = Instant::now();
        initialise::spanning_tree(&mut graph);
        let report = batch::optimize(&mut graph, &Options::default())?;
        println!(
            "batch: {poses} poses, {} factors, {report:?}, {:.1} s, {}",
            graph.factors().count(),
            begun.elapsed().as_secs_f64(),
            peak_memory()
        );
    }
    if what != "batch" {
        let mut drive = Drive::<G>::new(poses, loops);
        let mut isam = Isam2::new(Isam2Config::default());
        let mut ms: Vec<f64> = Vec::with_capacity(poses as usize);
        let mut begun = Instant::now();
        for key in 0..poses {
            let factors = drive.factors();
            let pose = match key {
                0 => G::identity(),
                _ => {
                    let before: G = isam.estimate(key - 1).ok_or("the pose before is there")?;
                    before.compose(factors[0].measured())
                }
            };
            let start = Instant::now();
            isam.update(&factors, &[(key, pose)], &[])?;
            ms.push(start.elapsed().as_secs_f64() * 1e3);
            if (key + 1) % (poses / 10).max(1) == 0 {
                let seconds = begun.elapsed().as_secs_f64();
                println!(
                    "isam2: {} poses, {seconds:.1} s, {}",
                    key + 1,
                    peak_memory()
                );
                begun = Instant::now();
            }
        }
        let total: f64 = ms.iter().sum();
        ms.sort_by(f64::total_cmp);
        let at = |share: f64| ms[((ms.len() - 1) as f64 * share) as usize];
        println!(
            "isam2: error {:.3}, {:.1} s in updates, median {:.4} ms, 99 % {:.4} ms, 99.9 % {:.2} ms, \
             longest {:.0} ms, {}",
            isam.error(),
            total / 1e3,
            at(0.5),
            at(0.99),
            at(0.999),
            at(1.0),
            peak_memory()
        );
    }
    Ok(())
}

/// The most memory this process has held, where the system says so.
fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.map_or_else(
        || "peak memory unknown".to_owned(),
        |peak| format!("peak{peak}"),
    )
}
