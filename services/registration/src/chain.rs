//! The poses of a sensor through one scan, and what ties them together besides the points.
//!
//! In: the chain of the scan before, the time the new scan took, measured motions if there are
//! any. Out: terms of the normal equations over all knots; the prior of the next scan.

use hachi_hal::{Pose, Rotation, Vector3};
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector6};

use crate::degeneracy::Degeneracy;

/// Most intervals one scan is cut into.
pub const MAX_INTERVALS: usize = 6;
/// The intervals' ends, and the knot before.
pub(crate) const KNOTS: usize = MAX_INTERVALS + 2;
const SIZE: usize = 6 * KNOTS;

/// How firmly the place along an open direction is held from scan to scan, 1/m²: a centimetre. Far
/// more than rounding errors, far less than what a scan says of a direction that it sees.
const PLACE_HELD: f64 = 1e4;

type Information12 = SMatrix<f64, 12, 12>;

/// Normal equations over all knots, six rows each: rotation, then translation.
#[derive(Debug, Clone)]
pub(crate) struct ChainSystem {
    matrix: SMatrix<f64, SIZE, SIZE>,
    gradient: SVector<f64, SIZE>,
}

/// The poses of the sensor at evenly spaced moments of one scan, and at the moment before it.
#[derive(Debug, Clone)]
pub struct Chain {
    /// `target_from_sensor`. The first two belong to the scan before: its last two.
    poses: [Pose; KNOTS],
    /// Seconds from each knot to the next.
    gaps_s: [f64; KNOTS - 1],
    len: usize,
    /// The first new interval bridges a time without scans.
    leads: bool,
    /// What the scan before left known of the first two knots.
    expected: [Pose; 2],
    information: Information12,
}

/// A measured motion from one knot to the next: gyroscope, legs, wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// `earlier_from_later`.
    pub motion: Pose,
    /// Standard deviation of its turn about each axis.
    pub turn_sigma_rad: f64,
    /// Standard deviation of its shift along each axis; infinite if only the turn was measured.
    pub shift_sigma_m: f64,
}

/// Accelerations that are ordinary for the robot: one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Agility {
    /// m/s².
    pub acceleration: f64,
    /// rad/s².
    pub angular_acceleration: f64,
    /// How many times more than ordinary the speed may change between two scans.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub between_scans: f64,
}

impl Default for Agility {
    /// A trotting quadruped: 2 cm at 3 Hz is 7 m/s², 1.5 degrees at 3 Hz is 9 rad/s².
    fn default() -> Self {
        Self {
            acceleration: 8.0,
            angular_acceleration: 8.0,
            between_scans: 1.0,
        }
    }
}

impl Chain {
    /// A chain that ends at `pose`, of unknown speed.
    pub fn starting_at(pose: Pose) -> Self {
        let mut information = Information12::zeros();
        // Where it is holds to a millimetre: it defines the map. How fast it came, nobody knows.
        information.fixed_view_mut::<6, 6>(0, 0).fill_diagonal(1e-4);
        information.fixed_view_mut::<6, 6>(6, 6).fill_diagonal(1e6);
        Self {
            poses: [pose; KNOTS],
            gaps_s: [0.1; KNOTS - 1],
            len: 2,
            leads: false,
            expected: [pose; 2],
            information,
        }
    }

    /// The poses from the end of the scan before to the end of this one.
    pub fn poses(&self) -> &[Pose] {
        &self.poses[1..self.len]
    }

    /// The pose at the end of the scan.
    pub fn last(&self) -> &Pose {
        &self.poses[self.len - 1]
    }

    /// Moves the whole chain; for a map whose origin is moved along with the robot.
    pub fn translate(&mut self, by: &Vector3) {
        for pose in self.poses.iter_mut().chain(&mut self.expected) {
            pose.translation.vector += by;
        }
    }

    /// Forgets all but the last two knots and appends `intervals` new ones over `span_s` seconds,
    /// guessed at the speed of the scan before. Where scans are missing before this one, `lead_s` is
    /// the time without any: it is bridged by the first interval, the others cut up the rest.
    pub fn extend(&mut self, lead_s: f64, intervals: usize, span_s: f64) {
        let (kept, intervals) = (self.len - 2, intervals.clamp(1, MAX_INTERVALS));
        // The mean over the scan before: the last gap alone is short and noisy.
        let old_span: f64 = self.gaps_s[1..self.len.max(3) - 1].iter().sum();
        let old_motion = if self.len > 2 {
            self.poses[1].inv_mul(self.last())
        } else {
            Pose::identity()
        };
        let first_gap = self.gaps_s[kept];
        self.poses.copy_within(kept..self.len, 0);
        self.expected = [self.poses[0], self.poses[1]];
        self.len = 2 + intervals;
        self.leads = lead_s > 0.0 && intervals > 1;
        let gap = if self.leads {
            let gap = (span_s - lead_s) / (intervals - 1) as f64;
            self.gaps_s = [gap; KNOTS - 1];
            self.gaps_s[1] = lead_s;
            gap
        } else {
            let gap = span_s / intervals as f64;
            self.gaps_s = [gap; KNOTS - 1];
            gap
        };
        debug_assert!(gap > 0.0, "a scan takes time");
        self.gaps_s[0] = first_gap;
        self.guess_motion(&old_motion, old_span);
    }

    /// Guesses the new knots evenly in time on the way to `end`.
    pub fn guess_end(&mut self, end: &Pose) {
        let motion = self.poses[1].inv_mul(end);
        let span: f64 = self.gaps_s[1..self.len - 1].iter().sum();
        self.guess_motion(&motion, span);
        self.poses[self.len - 1] = *end;
    }

    /// Guesses each new knot by the measured motion from the one before, where there is one.
    pub fn guess_increments(&mut self, increments: &[Increment]) {
        for (i, increment) in increments.iter().enumerate().take(self.len - 2) {
            let mut motion = increment.motion;
            if !increment.shift_sigma_m.is_finite() {
                motion.translation = self.poses[i + 1].inv_mul(&self.poses[i + 2]).translation;
            }
            self.poses[i + 2] = self.poses[i + 1] * motion;
        }
    }

    /// Guesses the new knots at the speed of a motion that took `span_s` seconds.
    fn guess_motion(&mut self, motion: &Pose, span_s: f64) {
        for i in 2..self.len {
            let step = scaled(motion, self.gaps_s[i - 1] / span_s.max(1e-9));
            self.poses[i] = self.poses[i - 1] * step;
            self.poses[i].rotation.renormalize();
        }
    }

    /// Moves every knot by its six rows of a solution.
    pub(crate) fn apply(&mut self, step: &SVector<f64, SIZE>) {
        for (i, pose) in self.poses[..self.len].iter_mut().enumerate() {
            let turn: Vector3 = step.fixed_rows::<3>(6 * i).into_owned();
            let shift: Vector3 = step.fixed_rows::<3>(6 * i + 3).into_owned();
            *pose *= Pose::from_parts(shift.into(), Rotation::from_scaled_axis(turn));
            // Products of unit quaternions lose their length a rounding error at a time.
            pose.rotation.renormalize_fast();
        }
    }

    /// Keeps, as the prior of the next scan, what `system` says of the last two knots.
    ///
    /// `trust` below 1 takes off for the errors of neighbouring scans not being independent. Where
    /// the scan left a direction `open` nothing renews what is taken off, and after some dozen scans
    /// the place along it would be anybody's: there the last pose is held to what it was found to
    /// be, so that it moves on by the motion from scan to scan alone.
    pub(crate) fn keep_marginal(&mut self, system: &ChainSystem, trust: f64, open: &Degeneracy) {
        self.information = system.marginal_of_last_two(self.len) * trust;
        let mut last = self.information.fixed_view_mut::<6, 6>(6, 6);
        last += open.hold(PLACE_HELD);
    }
}

/// The share of a motion that `factor` times its duration would bring.
fn scaled(motion: &Pose, factor: f64) -> Pose {
    Pose::from_parts(
        (motion.translation.vector * factor).into(),
        Rotation::from_scaled_axis(motion.rotation.scaled_axis() * factor),
    )
}

impl ChainSystem {
    pub(crate) fn new() -> Self {
        Self {
            matrix: SMatrix::zeros(),
            gradient: SVector::zeros(),
        }
    }

    /// Starts over with the prior on the first two knots and the bound on acceleration.
    pub(crate) fn reset(&mut self, chain: &Chain, agility: &Agility) {
        self.matrix.fill(0.0);
        self.gradient.fill(0.0);
        for unused in 6 * chain.len..SIZE {
            self.matrix[(unused, unused)] = 1.0;
        }
        self.add_prior(chain);
        self.add_smoothness(chain, agility);
    }

    /// Adds `J' W J` and `J' W r` of one term that touches knots from `first` on.
    fn add<const N: usize>(
        &mut self,
        first: usize,
        jacobians: &[Matrix6<f64>; N],
        weight: &Vector6<f64>,
        residual: &Vector6<f64>,
    ) {
        for (r, left) in jacobians.iter().enumerate() {
            let weighted = left.transpose() * Matrix6::from_diagonal(weight);
            self.add_gradient(first + r, &(weighted * residual));
            for (c, right) in jacobians.iter().enumerate() {
                self.add_block(first + r, first + c, &(weighted * right));
            }
        }
    }

    pub(crate) fn add_block(&mut self, row: usize, column: usize, block: &Matrix6<f64>) {
        let mut view = self.matrix.fixed_view_mut::<6, 6>(6 * row, 6 * column);
        view += block;
    }

    pub(crate) fn add_gradient(&mut self, knot: usize, gradient: &Vector6<f64>) {
        let mut view = self.gradient.fixed_rows_mut::<6>(6 * knot);
        view += gradient;
    }

    fn add_prior(&mut self, chain: &Chain) {
        let mut residual = SVector::<f64, 12>::zeros();
        for i in 0..2 {
            let d = chain.expected[i].inv_mul(&chain.poses[i]);
            let (turn, shift) = (
                d.rotation.scaled_axis(),
                d.rotation.inverse() * d.translation.vector,
            );
            residual.fixed_rows_mut::<3>(6 * i).copy_from(&turn);
            residual.fixed_rows_mut::<3>(6 * i + 3).copy_from(&shift);
        }
        let mut view = self.matrix.fixed_view_mut::<12, 12>(0, 0);
        view += chain.information;
        let mut view = self.gradient.fixed_rows_mut::<12>(0);
        view += chain.information * residual;
    }

    /// Ties the speed after each knot to the speed before it.
    fn add_smoothness(&mut self, chain: &Chain, agility: &Agility) {
        for i in 1..chain.len - 1 {
            let unusual = match i {
                1 => agility.between_scans,
                // At both ends of a time without scans.
                2 if chain.leads => agility.between_scans,
                _ => 1.0,
            };
            let (before, after) = (chain.gaps_s[i - 1], chain.gaps_s[i]);
            let first = Step::between(&chain.poses[i - 1], &chain.poses[i]);
            let second = Step::between(&chain.poses[i], &chain.poses[i + 1]);
            let time = 0.5 * (before + after);
            let weight = Vector6::from_fn(|k, _| {
                let usual = if k < 3 {
                    agility.angular_acceleration
                } else {
                    agility.acceleration
                };
                1.0 / (usual * unusual * time).powi(2)
            });
            let jacobians = [
                -first.by_earlier / before,
                second.by_earlier / after - first.by_later / before,
                second.by_later / after,
            ];
            let residual = second.value / after - first.value / before;
            self.add(i - 1, &jacobians, &weight, &residual);
        }
    }

    /// Ties the `i`-th new knot to the one before by a measured motion.
    pub(crate) fn add_increment(&mut self, chain: &Chain, i: usize, increment: &Increment) {
        if i + 2 >= chain.len {
            return;
        }
        let step = Step::between(&chain.poses[i + 1], &chain.poses[i + 2]);
        let residual = step.value - Step::between(&Pose::identity(), &increment.motion).value;
        let weight = Vector6::from_fn(|k, _| {
            let sigma = if k < 3 {
                increment.turn_sigma_rad
            } else {
                increment.shift_sigma_m
            };
            if sigma.is_finite() && sigma > 0.0 {
                1.0 / (sigma * sigma)
            } else {
                0.0
            }
        });
        self.add(i + 1, &[step.by_earlier, step.by_later], &weight, &residual);
    }

    /// The step to the minimum; `None` if the equations are singular or not finite.
    pub(crate) fn solve(&self) -> Option<SVector<f64, SIZE>> {
        let step = self.matrix.cholesky()?.solve(&-self.gradient);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }

    /// Information on the last two of `len` knots once the others are free.
    ///
    /// Gaussian elimination of the leading rows leaves the Schur complement behind.
    fn marginal_of_last_two(&self, len: usize) -> Information12 {
        let mut left = self.matrix;
        let (keep, end) = (6 * (len - 2), 6 * len);
        for k in 0..keep {
            let pivot = left[(k, k)];
            if pivot <= 1e-12 {
                continue;
            }
            for r in k + 1..end {
                let factor = left[(r, k)] / pivot;
                if factor != 0.0 {
                    for c in k + 1..end {
                        left[(r, c)] -= factor * left[(k, c)];
                    }
                }
            }
        }
        let block: Information12 = left.fixed_view::<12, 12>(keep, keep).into_owned();
        (block + block.transpose()) * 0.5
    }
}

/// The motion from one knot to the next and its derivatives by both (turn, then shift).
struct Step {
    value: Vector6<f64>,
    by_earlier: Matrix6<f64>,
    by_later: Matrix6<f64>,
}

impl Step {
    fn between(earlier: &Pose, later: &Pose) -> Self {
        let d = earlier.inv_mul(later);
        let (turn, shift) = (d.rotation.scaled_axis(), d.translation.vector);
        let rotation = d.rotation.to_rotation_matrix().into_inner();
        let (mut by_earlier, mut by_later) = (Matrix6::zeros(), Matrix6::zeros());
        by_earlier
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-rotation.transpose());
        by_earlier
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&shift.cross_matrix());
        by_earlier
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&-Matrix3::identity());
        by_later
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&Matrix3::identity());
        by_later.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
        let value = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        Self {
            value,
            by_earlier,
            by_later,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivatives_of_a_step_are_its_slopes() {
        let a = Pose::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.2, 0.9));
        let b = a * Pose::new(
            Vector3::new(0.2, -0.1, 0.05),
            Vector3::new(0.01, 0.02, -0.03),
        );
        let step = Step::between(&a, &b);
        let moved = |pose: &Pose, k: usize, h: f64| {
            let mut d = Vector6::zeros();
            d[k] = h;
            let turn: Vector3 = d.fixed_rows::<3>(0).into_owned();
            let shift: Vector3 = d.fixed_rows::<3>(3).into_owned();
            pose * Pose::from_parts(shift.into(), Rotation::from_scaled_axis(turn))
        };
        for k in 0..6 {
            let h = 1e-6;
            let by_a = (Step::between(&moved(&a, k, h), &b).value
                - Step::between(&moved(&a, k, -h), &b).value)
                / (2.0 * h);
            let by_b = (Step::between(&a, &moved(&b, k, h)).value
                - Step::between(&a, &moved(&b, k, -h)).value)
                / (2.0 * h);
            // The turn's derivatives leave out the log map's curvature: a percent at these angles.
            assert!(
                (by_a - step.by_earlier.column(k)).amax() < 0.03,
                "{k} {by_a}"
            );
            assert!((by_b - step.by_later.column(k)).amax() < 0.03, "{k} {by_b}");
        }
    }

    #[test]
    fn with_nothing_seen_the_chain_goes_on_at_its_speed() {
        let mut chain = Chain::starting_at(Pose::identity());
        let step = Pose::new(Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.05));
        chain.extend(0.0, 1, 0.1);
        chain.guess_end(&step);
        // As if a scan had fixed both knots well.
        chain.information = Information12::identity() * 1e6;
        chain.extend(0.0, 4, 0.1);
        chain.information = Information12::identity() * 1e6;
        let mut system = ChainSystem::new();
        for _ in 0..5 {
            system.reset(&chain, &Agility::default());
            let d = system.solve().expect("solvable");
            chain.apply(&d);
        }
        let expected = step * step;
        let error = expected.inv_mul(chain.last());
        assert!(error.translation.vector.norm() < 2e-3, "{error}");
        assert!(error.rotation.angle() < 2e-3, "{error}");
    }
}
