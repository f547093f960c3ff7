//! Mirror ghosts in the simulated glass building: from the sensor's bytes, through its driver,
//! to what the filters keep, judged by the simulator's truth about every return.
#![allow(clippy::print_stderr, reason = "the figures are worth reading")]

use hachi_cloud::{FilterConfig, Filters, Reason, ScanFrames};
use hachi_hal::{Point, Stamp};
use hachi_velodyne::packet::{Decoder, DecoderConfig, PointBatch};
use hachi_world::{Preset, ReturnLabel, ReturnTruth, Simulation, SimulationConfig};

/// One turn with the truth about each point.
#[derive(Default)]
struct Turn {
    points: Vec<Point>,
    truth: Vec<ReturnTruth>,
    end: Stamp,
}

/// Calls `each` with every whole turn of a simulation.
fn for_each_turn(mut simulation: Simulation, mut each: impl FnMut(&Turn)) {
    let port = simulation.config().sensor.data_port();
    let decoder = Decoder::new(DecoderConfig::default());
    let mut batch = PointBatch::new();
    let (mut turn, mut is_whole) = (Turn::default(), false);
    while let Some(packet) = simulation.next_packet() {
        if packet.port != port {
            continue;
        }
        decoder
            .decode(packet.bytes, 0, &mut batch)
            .expect("a data packet");
        // Both leave out what did not return, and both run in the order of the bytes.
        let truth = (packet.truth.iter()).filter(|truth| truth.label != ReturnLabel::None);
        assert_eq!(batch.as_slice().len(), truth.clone().count());
        for (point, truth) in batch.as_slice().iter().zip(truth) {
            let before = turn.points.last().map_or(0.0, |last| last.azimuth_deg);
            if point.azimuth_deg < before - 180.0 {
                if is_whole {
                    each(&turn);
                }
                is_whole = true;
                turn.points.clear();
                turn.truth.clear();
            }
            turn.points.push(*point);
            turn.truth.push(*truth);
            turn.end = packet.stamp;
        }
    }
}

/// Counts over many turns.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    turns: usize,
    ghosts: usize,
    ghosts_kept: usize,
    real: usize,
    /// Real points called ghosts, and all real points that went.
    real_as_ghosts: usize,
    /// Those of them with a weak return that is not the floor's: what the intensity filter is for.
    real_suspect: usize,
    real_removed: usize,
    floor: usize,
    floor_removed: usize,
    floor_as_ghosts: usize,
    kept: usize,
}

impl Tally {
    fn add(&mut self, turn: &Turn, labels: &[Reason]) {
        self.turns += 1;
        for (truth, label) in turn.truth.iter().zip(labels) {
            let (removed, kept) = (usize::from(!label.is_kept()), usize::from(label.is_kept()));
            self.kept += kept;
            if truth.label.is_ghost() {
                self.ghosts += 1;
                self.ghosts_kept += kept;
            } else if truth.label != ReturnLabel::GlassSurface {
                self.real += 1;
                self.real_removed += removed;
                self.real_suspect += usize::from(*label == Reason::Suspect);
                self.real_as_ghosts += usize::from(*label == Reason::Ghost);
                if truth.label == ReturnLabel::Floor {
                    self.floor += 1;
                    self.floor_removed += removed;
                    self.floor_as_ghosts += usize::from(*label == Reason::Ghost);
                }
            }
        }
    }

    fn share(part: usize, of: usize) -> f64 {
        part as f64 / of.max(1) as f64
    }

    fn ghosts_removed(&self) -> f64 {
        1.0 - Self::share(self.ghosts_kept, self.ghosts)
    }

    fn ghosts_among_kept(&self) -> f64 {
        Self::share(self.ghosts_kept, self.kept)
    }
}

fn walk(preset: Preset, seed: u64, seconds: f64, every: usize) -> Tally {
    let config = SimulationConfig::preset(preset, seed, seconds);
    let truth = config.clone();
    let mut filters = Filters::new(FilterConfig::default()).expect("the defaults work");
    let (mut kept, mut tally, mut number) = (Vec::new(), Tally::default(), 0);
    for_each_turn(Simulation::new(config), |turn| {
        number += 1;
        if number % every != 0 {
            return;
        }
        let frames = ScanFrames {
            footprint_from_lidar: Some(truth.footprint_from_lidar(turn.end)),
            ..ScanFrames::default()
        };
        filters.step(&turn.points, &frames, &mut kept);
        tally.add(turn, filters.labels());
    });
    tally
}

#[test]
fn most_ghosts_in_a_corridor_of_glass_go_and_little_that_is_real_is_taken_for_one() {
    for seed in 1..=3 {
        let tally = walk(Preset::GlassCorridor, seed, 8.0, 3);
        let removed = tally.ghosts_removed();
        let among_kept = tally.ghosts_among_kept();
        let real = Tally::share(tally.real_as_ghosts, tally.real);
        let floor = Tally::share(tally.floor_as_ghosts, tally.floor);
        eprintln!(
            "seed {seed}: {removed:.4} of the ghosts removed, {among_kept:.4} of what is kept are \
             ghosts, {real:.4} of the real points taken for ghosts, {tally:?}"
        );
        assert!(tally.turns > 20 && tally.ghosts > 10_000, "{tally:?}");
        assert!(removed > 0.7, "seed {seed}: {removed}");
        assert!(among_kept < 0.05, "seed {seed}: {among_kept}");
        assert!(real < 0.01, "seed {seed}: {real}");
        assert!(floor < 0.02, "seed {seed}: {floor}");
    }
}
