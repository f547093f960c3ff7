//! How sure a measured transform is, in metres and radians.
//!
//! In: what an alignment found, or the way odometry went. Out: information matrices, translation
//! first, of an update on the right: what the pose graph takes.
//!
//! The Hessian of GICP is no inverse covariance. Its weights are pure numbers (a metre along a
//! surface against three centimetres across), and its pairs are far from independent: neighbouring
//! surfaces share the ring that measured them, the pose that placed them and the thing they lie on.
//! So it is scaled by the distances that the pairs really have from each other, divided by how many
//! pairs err together, and bounded by what no number of pairs can mend: submaps are bent a little
//! by the odometry that gathered them.

use hachi_hal::Pose;
use hachi_posegraph::{Group, Se3};
use hachi_registration::{Degeneracy, Registration};
use nalgebra::{Matrix3, Matrix6, Vector6};

use crate::alignment::Fitness;

/// Weight of a pair across its surface in GICP's Hessian, `1 / (2 * 0.001)`: see
/// `hachi_registration::pair`.
const PAIR_WEIGHT: f64 = 500.0;

/// Pairs that err together. Of 3,000 surfaces about sixty are independent: the walls, floors and
/// pillars in view. Measured on simulated buildings: with it, the squared errors of loops over their
/// variances average about one.
const PAIRS_ALIKE: f64 = 50.0;

/// Distance across a surface that the best of pairs have, metres: a LiDAR's noise, averaged.
const LEAST_RESIDUAL_M: f64 = 0.01;

/// What no number of pairs can mend: metres and radians, one standard deviation.
const LEAST_SIGMA_M: f64 = 0.015;
const LEAST_SIGMA_RAD: f64 = 0.003;

/// Standard deviation of a direction that nothing was said of, metres and radians: as good as
/// unknown, and the matrix stays positive definite.
const UNKNOWN_M: f64 = 100.0;
const UNKNOWN_RAD: f64 = 10.0;

/// How odometry errs over a way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OdometryNoise {
    /// Of the position after a metre, metres, one standard deviation; grows with the root.
    pub metres_per_root_metre: f64,
    /// Of the attitude after a metre, radians.
    pub radians_per_root_metre: f64,
    /// Of the attitude after a radian's turn, radians.
    pub radians_per_root_radian: f64,
    /// Along a direction that the scan left open, as a share of the way.
    pub open_share: f64,
    /// Of a scan that was carried without being placed, metres.
    pub carried_m: f64,
    /// The same, radians.
    pub carried_rad: f64,
}

impl Default for OdometryNoise {
    fn default() -> Self {
        Self {
            metres_per_root_metre: 0.01,
            radians_per_root_metre: 0.002,
            radians_per_root_radian: 0.002,
            open_share: 0.1,
            carried_m: 0.05,
            carried_rad: 0.02,
        }
    }
}

/// Covariance of the way since a node began; grows scan by scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WayCovariance {
    /// In the node's frame: translation first.
    covariance: Matrix6<f64>,
}

impl Default for WayCovariance {
    fn default() -> Self {
        Self {
            covariance: Matrix6::zeros(),
        }
    }
}

impl WayCovariance {
    /// One more scan, `node_from_base` being where it was placed, `moved_m` and `turned_rad` how far
    /// that is from the one before.
    pub fn add(
        &mut self,
        noise: &OdometryNoise,
        node_from_base: &nalgebra::UnitQuaternion<f64>,
        moved_m: f64,
        turned_rad: f64,
        open: Option<&Degeneracy>,
        carried: bool,
    ) {
        let shift = noise.metres_per_root_metre.powi(2) * moved_m;
        let turn = noise.radians_per_root_metre.powi(2) * moved_m
            + noise.radians_per_root_radian.powi(2) * turned_rad;
        let (mut shift, mut turn) = (Matrix3::identity() * shift, Matrix3::identity() * turn);
        if let Some(open) = open {
            let rotation = node_from_base.to_rotation_matrix();
            for direction in &open.directions[..open.translations] {
                let d = rotation * direction;
                shift += d * d.transpose() * (noise.open_share * moved_m.max(0.01)).powi(2);
            }
            for axis in &open.axes[..open.rotations] {
                let a = rotation * axis;
                turn += a * a.transpose() * (noise.open_share * turned_rad.max(0.01)).powi(2);
            }
        }
        if carried {
            shift += Matrix3::identity() * noise.carried_m.powi(2);
            turn += Matrix3::identity() * noise.carried_rad.powi(2);
        }
        let mut block = self.covariance.fixed_view_mut::<3, 3>(0, 0);
        block += shift;
        let mut block = self.covariance.fixed_view_mut::<3, 3>(3, 3);
        block += turn;
    }

    /// The covariance, with the least errors that any way has.
    pub fn covariance(&self) -> Matrix6<f64> {
        let floor = sigmas(0.002, 0.0003);
        self.covariance + Matrix6::from_diagonal(&floor.component_mul(&floor))
    }

    /// Its inverse.
    pub fn information(&self) -> Matrix6<f64> {
        invert(&self.covariance())
    }
}

/// Information of an alignment, open directions being unknown.
pub fn of_alignment(found: &Registration, fitness: &Fitness) -> Matrix6<f64> {
    let seen = found.degeneracy.projection_on_observed();
    let hessian = seen.transpose() * found.information * seen;
    let metric = translation_first(&hessian) * metric_scale(fitness);
    bounded(&metric, LEAST_SIGMA_M, LEAST_SIGMA_RAD)
}

/// What GICP's Hessian has to be multiplied by to be information in metres and radians.
pub fn metric_scale(fitness: &Fitness) -> f64 {
    let residual = fitness.residual_m.max(LEAST_RESIDUAL_M);
    1.0 / (PAIR_WEIGHT * residual * residual * PAIRS_ALIKE)
}

/// Information with errors no smaller than these, and something small where it had none.
pub fn bounded(information: &Matrix6<f64>, least_m: f64, least_rad: f64) -> Matrix6<f64> {
    let unknown = sigmas(UNKNOWN_M, UNKNOWN_RAD).map(|s| 1.0 / (s * s));
    let least = sigmas(least_m, least_rad);
    let floor = Matrix6::from_diagonal(&least.component_mul(&least));
    let positive = (information + information.transpose()) * 0.5 + Matrix6::from_diagonal(&unknown);
    invert(&(invert(&positive) + floor))
}

/// The covariance of updates on the right of a pose, seen where `there_from_here` leads: that of
/// `pose * there_from_here.inverse()`.
pub fn carried(covariance: &Matrix6<f64>, there_from_here: &Pose) -> Matrix6<f64> {
    let pose = Se3::new(there_from_here.translation.vector, there_from_here.rotation);
    let adjoint = pose.adjoint();
    adjoint * covariance * adjoint.transpose()
}

/// What a measurement would tell of a pose that is known with `covariance`, nats: half the log
/// determinant of how much the covariance shrinks. Two directions known twice as well, in standard
/// deviations, are 1.4 nats. (Ila, Porta and Andrade-Cetto, *Information-based compact pose SLAM*,
/// T-RO 2010.)
pub fn gain(covariance: &Matrix6<f64>, measured: &Matrix6<f64>) -> f64 {
    let half_log_determinant = |matrix: &Matrix6<f64>| {
        let symmetric = (matrix + matrix.transpose()) * 0.5;
        let factor = symmetric.cholesky()?;
        Some(
            factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|d| d.ln())
                .sum::<f64>(),
        )
    };
    let both = half_log_determinant(&(covariance + measured));
    both.zip(half_log_determinant(measured))
        .map_or(0.0, |(both, alone)| both - alone)
}

/// The largest standard deviations of position and attitude: metres, radians.
pub fn largest_sigmas(covariance: &Matrix6<f64>) -> (f64, f64) {
    let largest = |from: usize| {
        (from..from + 3)
            .map(|i| covariance[(i, i)].max(0.0).sqrt())
            .fold(0.0, f64::max)
    };
    (largest(0), largest(3))
}

/// Swaps rotation and translation blocks.
pub fn translation_first(rotation_first: &Matrix6<f64>) -> Matrix6<f64> {
    let swap = |i: usize| (i + 3) % 6;
    Matrix6::from_fn(|r, c| rotation_first[(swap(r), swap(c))])
}

/// The inverse of a positive definite matrix; of one that is not, that of its diagonal.
pub fn invert(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    let symmetric = (matrix + matrix.transpose()) * 0.5;
    symmetric.cholesky().map_or_else(
        || Matrix6::from_diagonal(&symmetric.diagonal().map(|d| 1.0 / d.max(1e-12))),
        |c| c.inverse(),
    )
}

fn sigmas(metres: f64, radians: f64) -> Vector6<f64> {
    Vector6::new(metres, metres, metres, radians, radians, radians)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn errors_along_a_way_grow_with_its_root() {
        let noise = OdometryNoise::default();
        let way = |scans: usize| {
            let mut way = WayCovariance::default();
            for _ in 0..scans {
                way.add(&noise, &UnitQuaternion::identity(), 0.1, 0.0, None, false);
            }
            invert(&way.information())
        };
        let (short, long) = (way(100), way(400));
        let ratio = (long[(0, 0)] / short[(0, 0)]).sqrt();
        assert!((ratio - 2.0).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn a_corridor_s_axis_is_unknown_and_the_rest_is_not() {
        let mut open = Degeneracy {
            translations: 1,
            ..Degeneracy::default()
        };
        open.directions[0] = nalgebra::Vector3::x();
        let found = Registration {
            target_from_source: Pose::identity(),
            converged: true,
            iterations: 5,
            pairs: 3000,
            inlier_share: 1.0,
            residual_m: 0.02,
            error: 1.0,
            information: Matrix6::from_diagonal_element(3000.0 * 500.0),
            degeneracy: open,
        };
        let fitness = Fitness {
            overlap: 1.0,
            fit_share: 1.0,
            residual_m: 0.02,
        };
        let covariance = invert(&of_alignment(&found, &fitness));
        assert!(covariance[(0, 0)].sqrt() > 50.0, "{covariance}");
        assert!(covariance[(1, 1)].sqrt() < 0.02, "{covariance}");
        assert!(covariance[(5, 5)].sqrt() < 0.005, "{covariance}");
    }
}
