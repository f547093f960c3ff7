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

/// Tries guesses; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Search {
    aligner: Aligner,
    thinned: Vec<SurfacePoint>,
}

impl Search {
    /// The best guess around `expected` and `last`, for `source` in the frame of the scan's end.
    pub fn around(
        &mut self,
        source: &[SurfacePoint],
        map: &LocalMap,
        last: &Pose,
        expected: &Pose,
    ) -> Pose {
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
        let mut best = (f64::NEG_INFINITY, *expected);
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
                if score > best.0 {
                    best = (score, found.target_from_source);
                }
            }
        }
        best.1
    }
}
