//! A robot that is set down anywhere in a building whose map is saved, facing anywhere, and walks
//! off: it finds itself, and never says that it knows where it is when it does not.
//!
//! The building has two wings that are furnished alike to the last chair, and a corridor of cells.
//! In CI a few starts in a part of it; `HACHI_LOCALISE_STARTS=200 cargo test --release -p hachi
//! --test localise -- --nocapture` is the figure in BENCHMARKS.md. `HACHI_LOCALISE_SEED` is another
//! building, `HACHI_LOCALISE_FIRST` the start to begin with, `HACHI_LOCALISE_MAP` a file to keep the
//! building's map in.
#![allow(clippy::print_stderr, reason = "the figures are worth reading")]

use std::path::Path;
use std::sync::Arc;

use hachi::config::MappingConfig;
use hachi::mapping::Mapping;
use hachi::recording::{ScanSource, from_packets};
use hachi_bridge::message::Sensor;
use hachi_hal::{Pose, Stamp, Vector3};
use hachi_slam::node::levelled;
use hachi_slam::overlay::OverlayStore;
use hachi_slam::saved::SavedMap;
use hachi_slam::{Node, Slam, SubmapStore};
use hachi_store::{Access, Identity, MapFile};
use hachi_trajectory::{Alignment, EvaluationOptions, Trajectory, evaluate};
use hachi_world::{Gait, Preset, SimulatedLidar, Simulation, SimulationConfig, TrajectoryBuilder};

/// A place is right within this.
const RIGHT_M: f64 = 0.2;
const RIGHT_DEG: f64 = 2.0;

/// How far a robot may walk to find itself, metres.
const WAY_M: f64 = 60.0;

/// The way is given by places so far apart: its corners are rounded as the mapped way's are.
const STRIDE_M: f64 = 2.5;

/// Off the mapped way, at most, metres.
const ASIDE_M: f64 = 0.3;

#[derive(Debug)]
enum Outcome {
    Found {
        metres: f64,
        degrees: f64,
        scans: usize,
    },
    /// What it said last.
    NotFound(#[allow(dead_code, reason = "printed")] String),
}

impl Outcome {
    fn is_right(&self) -> bool {
        matches!(self, Self::Found { metres, degrees, .. }
            if *metres <= RIGHT_M && *degrees <= RIGHT_DEG)
    }

    fn is_wrong(&self) -> bool {
        matches!(self, Self::Found { .. }) && !self.is_right()
    }
}

/// A building, and how long the robot that mapped it walked.
struct Mapped {
    world: SimulationConfig,
    /// Where its map's frame lies.
    world_from_map: Pose,
}

fn scans_of(world: &SimulationConfig) -> Box<dyn ScanSource + Send> {
    let lidar = SimulatedLidar::new(Simulation::new(world.clone()));
    from_packets(Sensor::Velodyne, lidar, |_| Vec::new())
}

fn identity() -> Identity {
    Identity {
        platform: String::new(),
        sensor: String::new(),
    }
}

fn resumed(saved: SavedMap, store: Box<dyn SubmapStore>) -> Mapping {
    let config = MappingConfig::default();
    let slam = Slam::resume(config.slam.clone(), saved, store).unwrap();
    Mapping::new(config, &std::env::temp_dir())
        .unwrap()
        .with_slam(slam)
}

/// Where the frame of a map lies in the world: the rigid alignment of all its nodes.
fn frame_of(map: &Path, world: &SimulationConfig) -> Pose {
    let saved = MapFile::open(map, Access::Read).unwrap().load().unwrap();
    let path = |pose: &dyn Fn(&Node) -> Pose| {
        let samples = saved.nodes.iter().map(|node| (node.stamp, pose(node)));
        Trajectory::from_samples(samples.collect()).0
    };
    let estimate = path(&|node| node.map_from_node);
    let truth = path(&|node| levelled(&world.map_from_lidar(node.stamp), &Vector3::z()));
    let options = EvaluationOptions {
        alignment: Alignment::Se3,
        ..EvaluationOptions::default()
    };
    let aligned = evaluate(&truth, &estimate, &options).unwrap();
    eprintln!(
        "map of {} nodes, {:.3} m off the truth (rmse), {:.3} m at most",
        saved.nodes.len(),
        aligned.ape.rmse,
        aligned.ape.max
    );
    aligned.estimate.poses()[0] * estimate.poses()[0].inverse()
}

impl Mapped {
    /// Walks through a building for so long and keeps the map.
    fn walk(seed: u64, seconds: f64, path: &Path) -> Self {
        let world = SimulationConfig::preset(Preset::Building, seed, seconds);
        if !path.exists() {
            let map = MapFile::create(path, &identity()).unwrap();
            let mut mapping = resumed(SavedMap::default(), Box::new(map));
            let (mut scans, mut points) = (scans_of(&world), Vec::new());
            while let Some(header) = scans.next_scan(&mut points).unwrap() {
                mapping.step(&header, &points, &[], &[]);
            }
            mapping.finish().unwrap();
        }
        Self {
            world_from_map: frame_of(path, &world),
            world,
        }
    }

    /// Where the robot that mapped the building was, on the floor.
    fn place(&self, seconds: f64) -> [f64; 2] {
        let footprint = self.world.trajectory.map_from_footprint(seconds);
        [footprint.translation.x, footprint.translation.y]
    }

    /// The `i`-th start: somewhere near the mapped way, facing anywhere, then along the way one way or
    /// the other. Places, headings and directions are spread evenly (the roots of x⁵ = x + 1).
    fn start(&self, i: usize) -> SimulationConfig {
        const ROOT: f64 = 1.167_303_978_261_418_7;
        let spread = |k: i32| ((i + 1) as f64 * ROOT.powi(-k)).fract();
        let (first, last) = (2.0, self.world.duration_s - 2.0);
        let begun = first + spread(1) * (last - first);
        let heading = spread(2) * std::f64::consts::TAU;
        let aside_m = ASIDE_M * (2.0 * spread(3) - 1.0);
        // The robot walks one metre a second.
        let room = [begun - first, last - begun];
        let forwards = if room[0].min(room[1]) < 20.0 {
            room[1] > room[0]
        } else {
            spread(4) < 0.5
        };
        let step = if forwards { 1.0 } else { -1.0 };
        let steps = (WAY_M.min(room[usize::from(forwards)]) / STRIDE_M) as usize;
        let way: Vec<[f64; 2]> = (1..=steps)
            .map(|k| self.place(begun + step * STRIDE_M * k as f64))
            .collect();
        let footprint = self.world.trajectory.map_from_footprint(begun);
        let aside = footprint * nalgebra::Point3::new(0.0, aside_m, 0.0);
        let start = [aside.x, aside.y];
        let gait = Gait {
            corner_cut_m: 1.4,
            ..Gait::trotting(1.0)
        };
        let there = TrajectoryBuilder::new(start, heading, gait)
            .stand(1.0)
            .walk(&way);
        let mut back: Vec<[f64; 2]> = way[..way.len() - 1].iter().rev().copied().collect();
        back.push(start);
        let trajectory = there
            .walk(&back)
            .turn_to(heading)
            .build(self.world.scene.floor().clone())
            .unwrap();
        SimulationConfig {
            duration_s: steps as f64 * STRIDE_M + 4.0,
            trajectory: Arc::new(trajectory),
            seed: 1_000 + i as u64,
            ..self.world.clone()
        }
    }

    /// Starts there with nothing but the map, until the place is said to be known.
    fn localise(&self, map: &Path, world: &SimulationConfig) -> Outcome {
        let file = MapFile::open(map, Access::Read).unwrap();
        let saved = file.load().unwrap();
        let mut mapping = resumed(saved, Box::new(OverlayStore::over(file)));
        let mut scans = scans_of(world);
        let mut points = Vec::new();
        let mut count = 0;
        let mut last = "no scan".to_owned();
        while let Some(header) = scans.next_scan(&mut points).unwrap() {
            count += 1;
            mapping.step(&header, &points, &[], &[]);
            let place = mapping.place().unwrap();
            last = place.condition.to_string();
            if place.condition.is_ok() {
                let outcome = self.found(world, place.stamp, &place.map_from_base, count);
                if !outcome.is_right() {
                    self.explain(world, &mapping);
                }
                return outcome;
            }
        }
        self.explain(world, &mapping);
        Outcome::NotFound(last)
    }

    /// Every place that was asked: how it fitted, and how far it is from the truth.
    fn explain(&self, world: &SimulationConfig, mapping: &Mapping) {
        let map = mapping.slam().unwrap().slam().map();
        for entry in map.ledger() {
            let (node, old) = (
                map.node(entry.node).unwrap(),
                map.node(entry.candidate).unwrap(),
            );
            if node.session == old.session || entry.inlier_share.is_nan() {
                continue;
            }
            let truth = self
                .world_from_map
                .inv_mul(&world.map_from_lidar(node.stamp));
            let off = truth.inv_mul(&(old.map_from_node * entry.candidate_from_node));
            let t = off.translation.vector;
            eprintln!(
                "  node {} at {}: fit {:.2} seen through {:.3} open {} {}, off {:.2} {:.2} {:.2} m, {:.1} degrees",
                entry.node,
                entry.candidate,
                entry.overlap * entry.inlier_share,
                entry.seen_through,
                entry.open,
                entry.verdict.name(),
                t.x,
                t.y,
                t.z,
                off.rotation.euler_angles().2.to_degrees(),
            );
        }
    }

    fn found(&self, world: &SimulationConfig, stamp: Stamp, pose: &Pose, scans: usize) -> Outcome {
        let truth = self.world_from_map.inv_mul(&world.map_from_lidar(stamp));
        let off = truth.inv_mul(pose);
        Outcome::Found {
            metres: off.translation.vector.norm(),
            degrees: off.rotation.angle().to_degrees(),
            scans,
        }
    }
}

fn number(name: &str) -> Option<usize> {
    std::env::var(name).ok().map(|text| text.parse().unwrap())
}

#[test]
fn a_robot_set_down_anywhere_finds_itself_and_is_never_ok_and_wrong() {
    let asked = number("HACHI_LOCALISE_STARTS");
    let seed = number("HACHI_LOCALISE_SEED").unwrap_or(1) as u64;
    // The whole patrol for the figure; one round of the first corridors otherwise.
    let seconds = if asked.is_some() { 340.0 } else { 90.0 };
    let starts = asked.unwrap_or(3);
    let folder = tempfile::tempdir().unwrap();
    let map = std::env::var("HACHI_LOCALISE_MAP")
        .map_or_else(|_| folder.path().join("building.map"), Into::into);
    let mapped = Mapped::walk(seed, seconds, &map);
    let first = number("HACHI_LOCALISE_FIRST").unwrap_or(0);
    let (mut right, mut wrong, mut ways) = (0, 0, Vec::new());
    for i in first..first + starts {
        let outcome = mapped.localise(&map, &mapped.start(i));
        right += usize::from(outcome.is_right());
        wrong += usize::from(outcome.is_wrong());
        if let Outcome::Found { scans, .. } = outcome {
            ways.push(scans);
        }
        eprintln!("start {i}: {outcome:?}");
    }
    ways.sort_unstable();
    eprintln!(
        "{right} of {starts} right, {wrong} OK and wrong, the rest not found; known after {:?} scans \
         in the median, {:?} at most",
        ways.get(ways.len() / 2),
        ways.last(),
    );
    assert_eq!(wrong, 0);
    assert!(right * 100 >= 99 * starts, "{right} of {starts}");
}
