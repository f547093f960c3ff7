//! Looking farther when a scan does not fit where it was expected.
//!
//! A hand-held or falling sensor turns by tens of degrees between two scans. Around the last pose
//! and the expected one, turns about the vertical are tried with a thinned scan and a long reach;
//! the one that leaves the fewest points unexplained is the new guess.

use hachi_hal::{Pose, Rotation, Vector3};
use hachi_registration::{Aligner, AlignerConfig, Kernel, LocalMap, SurfacePoint};

/// Turns tried, degrees: far enough for 60 degrees between two scans, close enough that each lies
/// within the catchment of its neighbour.
const TURNS_DEG: [f64; 11] = [
    0.0, 12.0, -12.0, 24.0, -24.0, 36.0, -36.0, 48.0, -48.0, 60.0, -60.0,
];

/// Points used for one try.
const POINTS: usize = 500;

/// Placements found, at most.
const PLACES: usize = 3;

/// Two placements nearer to each other than this, in metres and radians, are one.
const SAME_M: f64 = 0.3;
const SAME_RAD: f64 = 0.1;

/// Tries guesses; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Search {
    aligner: Aligner,
    thinned: Vec<SurfacePoint>,
    found: Vec<(f64, Pose)>,
}

impl Search {
    /// Searches around `expected` and `last` for `source`, in the frame of the scan's end.
    pub fn around(
        &mut self,
        source: &[SurfacePoint],
        map: &LocalMap,
        last: &Pose,
        expected: &Pose,
    ) {
        let stride = source.len().div_ceil(POINTS).max(1);
        self.thinned.clear();
        self.thinned.extend(source.iter().step_by(stride));
        let cell_m = map.cell_m();
        let config = AlignerConfig {
            reach_m: 1.9 * cell_m,
            max_iterations: 8,
            translation_epsilon_m: 0.01,
            rotation_epsilon_rad: 0.005,
            kernel: Kernel::GemanMcClure {
                scale_m: 0.5 * cell_m,
            },
            ..AlignerConfig::default()
        };
        self.found.clear();
        self.found.reserve(PLACES + 1);
        for start in [expected, last] {
            for turn in TURNS_DEG {
                let turned = Rotation::from_axis_angle(&Vector3::z_axis(), turn.to_radians());
                let guess = start * Pose::from_parts(Vector3::zeros().into(), turned);
                let found = self
                    .aligner
                    .align(&self.thinned, map, &guess, None, &config);
                // Points explained, discounted by how badly: a residual of a fifth of a cell is
                // what a random placement in a room reaches.
                let badness = found.residual_m / (0.2 * f64::from(cell_m));
                let score = found.inlier_share / (1.0 + badness * badness);
                self.keep(score, found.target_from_source);
            }
        }
        if self.found.is_empty() {
            self.found.push((0.0, *expected));
        }
    }

    /// The placements of the last search with their scores, best first: at least one, at most three
    /// that differ.
    pub fn found(&self) -> &[(f64, Pose)] {
        &self.found
    }

    /// Keeps a placement if it is among the best that differ.
    fn keep(&mut self, score: f64, pose: Pose) {
        if !score.is_finite() {
            return;
        }
        let is_same = |(_, other): &(f64, Pose)| {
            let apart = other.inv_mul(&pose);
            apart.translation.vector.norm() < SAME_M && apart.rotation.angle() < SAME_RAD
        };
        match self.found.iter_mut().find(|found| is_same(found)) {
            Some(found) if found.0 >= score => return,
            Some(found) => *found = (score, pose),
            None => self.found.push((score, pose)),
        }
        self.found.sort_by(|a, b| b.0.total_cmp(&a.0));
        self.found.truncate(PLACES);
    }
}
