//! True loops: when the robot comes back to where it has been.
//!
//! In: a configuration's trajectory, how near and after how long a way counts. Out: revisits
//! (moments at which an earlier place is near) and passes (runs of them: one loop each), with
//! the headings' difference, to hold a SLAM's ledger of loops against. Memory grows with the
//! length of the way: one sample a step.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_4, PI, TAU};

use hachi_hal::{Stamp, Vector3};

use crate::simulation::SimulationConfig;

/// What counts as coming back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopSearch {
    /// An earlier place is near within this, metres.
    pub radius_m: f64,
    /// The way between both visits is at least so long, metres.
    pub least_way_m: f64,
    /// Along the way, one place in so many metres is looked at.
    pub step_m: f64,
}

/// 5 m, as the protocol for precision and recall has it, after 50 m, every metre.
impl Default for LoopSearch {
    fn default() -> Self {
        Self {
            radius_m: 5.0,
            least_way_m: 50.0,
            step_m: 1.0,
        }
    }
}

/// How the headings of two visits of a place compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Within 45 degrees of each other.
    Same,
    /// Neither the same nor opposite: ways that cross.
    Across,
    /// Within 45 degrees of opposite: a lane driven back.
    Opposite,
}

impl Direction {
    fn of(yaw_rad: f64) -> Self {
        match yaw_rad.abs() {
            yaw if yaw <= FRAC_PI_4 => Self::Same,
            yaw if yaw < 3.0 * FRAC_PI_4 => Self::Across,
            _ => Self::Opposite,
        }
    }
}

/// A moment at which the robot is near an earlier place: of one earlier visit, the nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Revisit {
    /// When it was there before.
    pub earlier: Stamp,
    /// When it is near again.
    pub later: Stamp,
    /// Between the two places, metres.
    pub distance_m: f64,
    /// From the earlier heading to the later one, radians, -pi to pi.
    pub yaw_rad: f64,
    /// From the start to the earlier place along the way, metres.
    pub earlier_way_m: f64,
    /// From the start to the later place along the way, metres.
    pub later_way_m: f64,
}

impl Revisit {
    /// How the two headings compare.
    pub fn direction(&self) -> Direction {
        Direction::of(self.yaw_rad)
    }
}

/// A run of revisits of one earlier visit: one loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopPass {
    /// The first revisit of the run.
    pub first: Revisit,
    /// The last of them.
    pub last: Revisit,
    /// The one with the least distance; the first of those that are equal.
    pub nearest: Revisit,
    /// How many.
    pub revisits: usize,
}

impl LoopPass {
    /// How the headings compare where the two ways are nearest.
    pub fn direction(&self) -> Direction {
        self.nearest.direction()
    }

    /// How much of the later way is near the earlier one, metres.
    pub fn length_m(&self) -> f64 {
        self.last.later_way_m - self.first.later_way_m
    }
}

/// The true loops of a configuration.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrueLoops {
    /// In the order of the later moment; one for each earlier visit of the place.
    pub revisits: Vec<Revisit>,
    /// In the order of their first revisit.
    pub passes: Vec<LoopPass>,
    /// The whole way, metres.
    pub way_m: f64,
}

impl SimulationConfig {
    /// The true loops between the start and the end.
    pub fn true_loops(&self, search: &LoopSearch) -> TrueLoops {
        let radius_m = search.radius_m.max(1e-3);
        let step_m = search.step_m.max(1e-2);
        let (samples, way_m) = samples(self, step_m);
        let mut revisits = Vec::new();
        let mut grid: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        let cell = |place: &Vector3| [0, 1].map(|axis| (place[axis] / radius_m).floor() as i64);
        // Samples enter the grid once the way since is long enough.
        let mut entered = 0;
        for later in &samples {
            while samples[entered].way_m <= later.way_m - search.least_way_m {
                let entry = grid.entry(cell(&samples[entered].place)).or_default();
                entry.push(entered);
                entered += 1;
            }
            let [x, y] = cell(&later.place);
            let mut near: Vec<usize> = (-1..=1)
                .flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]))
                .filter_map(|cell| grid.get(&cell))
                .flatten()
                .copied()
                .filter(|&i| (samples[i].place - later.place).norm() <= radius_m)
                .collect();
            near.sort_unstable();
            // A visit goes on as long as the way does not leave the radius for good.
            for visit in near.chunk_by(|&a, &b| samples[b].way_m - samples[a].way_m <= radius_m) {
                revisits.extend(nearest(&samples, visit, later));
            }
        }
        let passes = passes(&revisits, radius_m + 2.0 * step_m);
        TrueLoops {
            revisits,
            passes,
            way_m,
        }
    }
}

struct Sample {
    stamp: Stamp,
    place: Vector3,
    heading: f64,
    way_m: f64,
}

/// The footprint at every step of the way, and the length of the whole way.
fn samples(config: &SimulationConfig, step_m: f64) -> (Vec<Sample>, f64) {
    // A few looks to a step, so that a sample is late by a fraction of one.
    let look_ns = (step_m / config.trajectory.gait().speed.max(0.1) / 8.0 * 1e9).max(1e6) as i64;
    let mut found: Vec<Sample> = Vec::new();
    let (mut way_m, mut due_m) = (0.0, 0.0);
    let mut last: Option<Vector3> = None;
    let mut stamp = config.start;
    while stamp <= config.end() {
        let footprint = config.map_from_footprint(stamp);
        let place = footprint.translation.vector;
        way_m += last.map_or(0.0, |last| (place - last).norm());
        last = Some(place);
        if way_m >= due_m {
            let ahead = footprint.rotation * Vector3::x();
            found.push(Sample {
                stamp,
                place,
                heading: ahead.y.atan2(ahead.x),
                way_m,
            });
            due_m = way_m + step_m;
        }
        stamp = stamp + look_ns;
    }
    (found, way_m)
}

fn nearest(samples: &[Sample], visit: &[usize], later: &Sample) -> Option<Revisit> {
    let distance = |i: usize| (samples[i].place - later.place).norm();
    let nearest = visit
        .iter()
        .copied()
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
    let earlier = &samples[nearest];
    Some(Revisit {
        earlier: earlier.stamp,
        later: later.stamp,
        distance_m: distance(nearest),
        yaw_rad: (later.heading - earlier.heading + PI).rem_euclid(TAU) - PI,
        earlier_way_m: earlier.way_m,
        later_way_m: later.way_m,
    })
}

/// Chains revisits whose earlier and later places both lie within `reach_m` of the last one's.
fn passes(revisits: &[Revisit], reach_m: f64) -> Vec<LoopPass> {
    let mut passes: Vec<LoopPass> = Vec::new();
    // Those that may go on, oldest first.
    let mut open: Vec<usize> = Vec::new();
    for revisit in revisits {
        open.retain(|&i| revisit.later_way_m - passes[i].last.later_way_m <= reach_m);
        let goes_on = open.iter().copied().find(|&i| {
            let last = &passes[i].last;
            last.later < revisit.later
                && (last.earlier_way_m - revisit.earlier_way_m).abs() <= reach_m
        });
        match goes_on {
            Some(i) => {
                let pass = &mut passes[i];
                pass.last = *revisit;
                pass.revisits += 1;
                if revisit.distance_m < pass.nearest.distance_m {
                    pass.nearest = *revisit;
                }
            }
            None => {
                open.push(passes.len());
                passes.push(LoopPass {
                    first: *revisit,
                    last: *revisit,
                    nearest: *revisit,
                    revisits: 1,
                });
            }
        }
    }
    passes
}
