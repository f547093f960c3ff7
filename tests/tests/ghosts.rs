//! Mirror ghosts in the simulated glass building: from the sensor's bytes, through its driver,
//! to what the filters keep, judged by the simulator's truth about every return.
#![allow(clippy::print_stderr, reason = "the figures are worth reading")]

use hachi_cloud::{FilterConfig, Filters, Reason, ScanFrames};
use hachi_hal::{Point, Stamp, Vector3};
use hachi_velodyne::packet::{Decoder, DecoderConfig, PointBatch};
use hachi_world::{Preset, ReturnLabel, ReturnTruth, Simulation, SimulationConfig};

/// One turn with the truth about each point.
#[derive(Default)]
struct Turn {
    points: Vec<Point>,
    truth: Vec<ReturnTruth>,
    /// When each point's packet came.
    stamps: Vec<Stamp>,
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
                turn.stamps.clear();
            }
            turn.points.push(*point);
            turn.truth.push(*truth);
            turn.stamps.push(packet.stamp);
            turn.end = packet.stamp;
        }
    }
}

/// Of so many real points one is held to the measure that ghosts are held to.
const CONTROL: usize = 50;

/// Counts over many turns.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    turns: usize,
    ghosts: usize,
    ghosts_kept: usize,
    /// Those of them that lie where nothing is. The others fall on real surfaces: a pane's image of
    /// the floor on the floor behind it, that of the corridor's end on the wall that goes on there.
    ghosts_in_the_air: usize,
    real: usize,
    /// Real points that the measure for ghosts would call wrong, by every [`CONTROL`]th of them.
    real_in_the_air: usize,
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
    fn add(&mut self, world: &SimulationConfig, turn: &Turn, labels: &[Reason]) {
        self.turns += 1;
        for (i, (truth, label)) in turn.truth.iter().zip(labels).enumerate() {
            let in_the_air = || is_in_the_air(world, &turn.points[i], turn.stamps[i]);
            let (removed, kept) = (usize::from(!label.is_kept()), usize::from(label.is_kept()));
            self.kept += kept;
            if truth.label.is_ghost() {
                self.ghosts += 1;
                self.ghosts_kept += kept;
                self.ghosts_in_the_air += usize::from(label.is_kept() && in_the_air());
            } else if truth.label != ReturnLabel::GlassSurface {
                self.real += 1;
                if self.real.is_multiple_of(CONTROL) {
                    self.real_in_the_air += CONTROL * usize::from(in_the_air());
                }
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

/// Whether no surface of the world is within a voxel of the map (5 cm) of a point, to either side
/// along any axis: the building's walls, floors and ceilings lie across the axes.
fn is_in_the_air(world: &SimulationConfig, point: &Point, stamp: Stamp) -> bool {
    const VOXEL_M: f64 = 0.05;
    let at = nalgebra::Point3::from(point.position().map(f64::from));
    let at = (world.map_from_lidar(stamp) * at).coords;
    (0..3).all(|axis| {
        let along = Vector3::ith(axis, 1.0);
        let is_free = |direction| world.scene.distance(at, direction, VOXEL_M).is_none();
        is_free(along) && is_free(-along)
    })
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
        tally.add(&truth, turn, filters.labels());
    });
    tally
}

#[test]
fn most_ghosts_in_a_corridor_of_glass_go_and_little_that_is_real_is_taken_for_one() {
    for seed in 1..=3 {
        let tally = walk(Preset::GlassCorridor, seed, 8.0, 3);
        let removed = tally.ghosts_removed();
        let among_kept = tally.ghosts_among_kept();
        let in_the_air = Tally::share(tally.ghosts_in_the_air, tally.kept);
        let control = Tally::share(tally.real_in_the_air, tally.real);
        let real = Tally::share(tally.real_as_ghosts, tally.real);
        let floor = Tally::share(tally.floor_as_ghosts, tally.floor);
        eprintln!(
            "seed {seed}: {in_the_air:.4} of what is kept are ghosts where nothing is (of the real \
             points {control:.4} would be); {removed:.4} of the ghosts removed, {among_kept:.4} of \
             what is kept came by a mirror, {real:.4} of the real points taken for ghosts, {tally:?}"
        );
        assert!(tally.turns > 20 && tally.ghosts > 10_000, "{tally:?}");
        assert!(in_the_air < 0.01, "seed {seed}: {in_the_air}");
        assert!(control < 0.01, "the measure is wrong: {control}");
        assert!(removed > 0.7, "seed {seed}: {removed}");
        assert!(among_kept < 0.05, "seed {seed}: {among_kept}");
        assert!(real < 0.01, "seed {seed}: {real}");
        assert!(floor < 0.02, "seed {seed}: {floor}");
    }
}
