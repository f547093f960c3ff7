//! One pair of surfaces: how far apart they are, how much that weighs, which way it pulls.
//!
//! Each piece of surface has the covariance `I - (1 - THICKNESS) n n'` (m²): a metre along the
//! surface, `THICKNESS` across. The weight of a pair is the inverse of the sum of both, in closed
//! form by Woodbury's identity, so that no 3x3 matrix is inverted. Everything is expressed in the
//! source frame, with the update on the right: `target_from_source * exp(delta)`, `delta` being
//! rotation then translation.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::cloud::SurfacePoint;

/// Variance across a surface where the one along it is 1 (Segal et al. 2009, section III).
const THICKNESS: f32 = 1e-3;

/// Weight of one pair across its surface when both normals agree.
pub(crate) const FULL_WEIGHT: f64 = 0.5 / THICKNESS as f64;

/// How much a pair that fits badly counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Kernel {
    /// Every pair counts in full.
    #[default]
    None,
    /// Geman-McClure.
    GemanMcClure {
        /// Distance across the surface at which a pair's weight has dropped to a quarter.
        scale_m: f32,
    },
    /// Cauchy.
    Cauchy {
        /// Distance across the surface at which a pair's weight has dropped to a half.
        scale_m: f32,
    },
}

impl Kernel {
    /// Squared Mahalanobis distance of the kernel's scale.
    fn scale_sq(scale_m: f32) -> f32 {
        scale_m * scale_m / (2.0 * THICKNESS)
    }

    /// Weight for a squared Mahalanobis distance.
    pub(crate) fn weight(self, mahalanobis_sq: f32) -> f32 {
        match self {
            Self::None => 1.0,
            Self::GemanMcClure { scale_m } => {
                let w = 1.0 / (1.0 + mahalanobis_sq / Self::scale_sq(scale_m));
                w * w
            }
            Self::Cauchy { scale_m } => 1.0 / (1.0 + mahalanobis_sq / Self::scale_sq(scale_m)),
        }
    }

    /// The loss, whose derivative by the squared distance is half the weight.
    pub(crate) fn loss(self, mahalanobis_sq: f32) -> f32 {
        match self {
            Self::None => 0.5 * mahalanobis_sq,
            Self::GemanMcClure { scale_m } => {
                let s = Self::scale_sq(scale_m);
                0.5 * mahalanobis_sq * s / (s + mahalanobis_sq)
            }
            Self::Cauchy { scale_m } => {
                let s = Self::scale_sq(scale_m);
                0.5 * s * (mahalanobis_sq / s).ln_1p()
            }
        }
    }
}

/// A pose in single precision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Transform {
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
}

impl Transform {
    pub(crate) fn new(pose: &Pose) -> Self {
        let m = pose.rotation.to_rotation_matrix();
        Self {
            rotation: std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)] as f32)),
            translation: std::array::from_fn(|r| pose.translation.vector[r] as f32),
        }
    }

    /// The pose a share of the way to `other`; good for the small turns between two knots.
    #[inline]
    pub(crate) fn blend(&self, other: &Self, share: f32) -> Self {
        let mix = |a: f32, b: f32| a + share * (b - a);
        Self {
            rotation: std::array::from_fn(|r| {
                std::array::from_fn(|c| mix(self.rotation[r][c], other.rotation[r][c]))
            }),
            translation: std::array::from_fn(|r| mix(self.translation[r], other.translation[r])),
        }
    }

    #[inline]
    pub(crate) fn apply(&self, p: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|r| dot(self.rotation[r], p) + self.translation[r])
    }

    #[inline]
    fn rotate_back(&self, v: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|c| {
            self.rotation[0][c] * v[0] + self.rotation[1][c] * v[1] + self.rotation[2][c] * v[2]
        })
    }
}

/// A pair in the source frame: residual, and the weight matrix in factored form.
pub(crate) struct Pair {
    /// Target minus moved source.
    residual: [f32; 3],
    /// Target normal.
    n: [f32; 3],
    /// Source normal.
    m: [f32; 3],
    /// Weights of `nn' + mm'` and of `nm' + mn'` beside `I / 2`.
    same: f32,
    crossed: f32,
}

impl Pair {
    #[inline]
    pub(crate) fn new(
        source: &SurfacePoint,
        target: &SurfacePoint,
        moved: [f32; 3],
        transform: &Transform,
    ) -> Self {
        let difference: [f32; 3] = std::array::from_fn(|a| target.position[a] - moved[a]);
        let n = transform.rotate_back(target.normal);
        // A source point that has no normal is taken to lie on the target's surface.
        let m = if source.normal == [0.0; 3] {
            n
        } else {
            source.normal
        };
        let c = dot(n, m);
        let b = 2.0 / (1.0 - THICKNESS) - 1.0;
        let scale = 0.5 / (b * b - c * c);
        Self {
            residual: transform.rotate_back(difference),
            n,
            m,
            same: b * scale,
            crossed: c * scale,
        }
    }

    /// The weight matrix times a vector.
    #[inline]
    fn weigh(&self, v: [f32; 3]) -> [f32; 3] {
        let (nv, mv) = (dot(self.n, v), dot(self.m, v));
        let along_n = self.same * nv + self.crossed * mv;
        let along_m = self.same * mv + self.crossed * nv;
        std::array::from_fn(|a| 0.5 * v[a] + along_n * self.n[a] + along_m * self.m[a])
    }

    #[inline]
    pub(crate) fn mahalanobis_sq(&self) -> f32 {
        dot(self.residual, self.weigh(self.residual))
    }

    /// Linearises about the current pose; `p` is the source point's position.
    #[inline]
    pub(crate) fn linearize(&self, p: [f32; 3], kernel: Kernel) -> PairTerms {
        let weighted = self.weigh(self.residual);
        let mahalanobis_sq = dot(self.residual, weighted);
        let w = kernel.weight(mahalanobis_sq);
        let (n, m) = (self.n, self.m);
        let (half, same, crossed) = (0.5 * w, self.same * w, self.crossed * w);
        let entry = |r: usize, c: usize| {
            same * (n[r] * n[c] + m[r] * m[c]) + crossed * (n[r] * m[c] + m[r] * n[c])
        };
        let translation = [
            half + entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            half + entry(1, 1),
            entry(1, 2),
            half + entry(2, 2),
        ];
        // The residual after a step is `residual + p x rotation - translation`. With the weight
        // matrix M: A = [p]x M, column by column; then its rows crossed with p once more.
        let [xx, xy, xz, yy, yz, zz] = translation;
        let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let a: [[f32; 3]; 3] = std::array::from_fn(|c| cross(p, rows[c]));
        let b: [[f32; 3]; 3] = std::array::from_fn(|r| cross(p, [a[0][r], a[1][r], a[2][r]]));
        let torque = cross(p, weighted);
        PairTerms {
            rotation: [b[0][0], b[0][1], b[0][2], b[1][1], b[1][2], b[2][2]],
            coupling: std::array::from_fn(|k| a[k % 3][k / 3]),
            translation,
            gradient: std::array::from_fn(|k| -w * if k < 3 { torque[k] } else { weighted[k - 3] }),
            tangential: half,
            across: dot(n, self.residual),
            loss: kernel.loss(mahalanobis_sq),
        }
    }
}

/// What one pair contributes: upper triangles in blocks, rotation first.
pub(crate) struct PairTerms {
    rotation: [f32; 6],
    coupling: [f32; 9],
    translation: [f32; 6],
    pub(crate) gradient: [f32; 6],
    /// The part of the weight that is the same in every direction, which holds a point to where
    /// on the surface its partner happened to be.
    tangential: f32,
    /// Distance across the target's surface, metres.
    pub(crate) across: f32,
    pub(crate) loss: f32,
}

/// Sum of many pairs' information.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct InformationSum {
    rotation: [f64; 6],
    coupling: [f64; 9],
    translation: [f64; 6],
    tangential: f64,
}

impl InformationSum {
    /// Information about translation that every direction has alike, see [`PairTerms`].
    pub(crate) fn tangential(&self) -> f64 {
        self.tangential
    }

    #[inline]
    pub(crate) fn add(&mut self, terms: &PairTerms, weight: f64) {
        for k in 0..6 {
            self.rotation[k] += weight * f64::from(terms.rotation[k]);
            self.translation[k] += weight * f64::from(terms.translation[k]);
        }
        for k in 0..9 {
            self.coupling[k] += weight * f64::from(terms.coupling[k]);
        }
        self.tangential += weight * f64::from(terms.tangential);
    }

    pub(crate) fn matrix(&self) -> Matrix6<f64> {
        let mut out = Matrix6::zeros();
        let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (k, (r, c)) in upper.into_iter().enumerate() {
            out[(r, c)] = self.rotation[k];
            out[(c, r)] = self.rotation[k];
            out[(3 + r, 3 + c)] = self.translation[k];
            out[(3 + c, 3 + r)] = self.translation[k];
        }
        for r in 0..3 {
            for c in 0..3 {
                out[(r, 3 + c)] = self.coupling[3 * r + c];
                out[(3 + c, r)] = self.coupling[3 * r + c];
            }
        }
        out
    }
}

#[inline]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::{Rotation, Vector3};
    use nalgebra::{Matrix3, Vector6};

    /// The textbook form: residual' (C_target + R C_source R')^-1 residual.
    fn textbook(source: &SurfacePoint, target: &SurfacePoint, pose: &Pose) -> f64 {
        let covariance = |n: [f32; 3]| -> Matrix3<f64> {
            let n = nalgebra::Vector3::from(n.map(f64::from));
            Matrix3::identity() - n * n.transpose() * (1.0 - f64::from(THICKNESS))
        };
        let r = pose.rotation.to_rotation_matrix().into_inner();
        let sum = covariance(target.normal) + r * covariance(source.normal) * r.transpose();
        let p = pose * nalgebra::Point3::from(source.position.map(f64::from));
        let d = nalgebra::Vector3::from(target.position.map(f64::from)) - p.coords;
        (d.transpose() * sum.try_inverse().expect("positive definite") * d)[0]
    }

    fn example() -> (SurfacePoint, SurfacePoint, Pose) {
        let unit = |v: [f32; 3]| -> [f32; 3] { nalgebra::Vector3::from(v).normalize().into() };
        let source = SurfacePoint {
            position: [3.0, -1.5, 0.4],
            normal: unit([0.2, 0.9, -0.1]),
        };
        let target = SurfacePoint {
            position: [2.95, -1.2, 0.55],
            normal: unit([0.05, 0.95, 0.1]),
        };
        let pose = Pose::new(
            Vector3::new(0.1, 0.2, -0.05),
            Vector3::new(0.02, -0.03, 0.1),
        );
        (source, target, pose)
    }

    fn pair_at(pose: &Pose) -> Pair {
        let (source, target, _) = example();
        let transform = Transform::new(pose);
        Pair::new(
            &source,
            &target,
            transform.apply(source.position),
            &transform,
        )
    }

    #[test]
    fn the_closed_form_weight_is_the_inverse_of_the_summed_covariances() {
        let (source, target, pose) = example();
        let (ours, truth) = (
            f64::from(pair_at(&pose).mahalanobis_sq()),
            textbook(&source, &target, &pose),
        );
        assert!((ours - truth).abs() < 1e-3 * truth, "{ours} {truth}");
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_loss() {
        let (source, target, pose) = example();
        let terms = pair_at(&pose).linearize(source.position, Kernel::None);
        for k in 0..6 {
            let moved = |step: f64| {
                let mut d = Vector6::zeros();
                d[k] = step;
                let turn = Rotation::from_scaled_axis(d.fixed_rows::<3>(0).into_owned());
                let shift: Vector3 = d.fixed_rows::<3>(3).into_owned();
                // The source's covariance turns with the pose; that second-order term is what
                // Gauss-Newton leaves out, so here it is held still in the target's frame.
                let normal = nalgebra::Vector3::from(source.normal.map(f64::from));
                let normal = (turn.inverse() * normal).map(|v| v as f32).into();
                let new = pose * Pose::from_parts(shift.into(), turn);
                0.5 * textbook(&SurfacePoint { normal, ..source }, &target, &new)
            };
            let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            let ours = f64::from(terms.gradient[k]);
            assert!(
                (slope - ours).abs() < 0.05 * slope.abs().max(5.0),
                "{k}: {slope} {ours}"
            );
        }
    }

    #[test]
    fn a_kernel_s_weight_is_the_slope_of_its_loss() {
        for kernel in [
            Kernel::None,
            Kernel::GemanMcClure { scale_m: 0.1 },
            Kernel::Cauchy { scale_m: 0.1 },
        ] {
            for d in [0.01f32, 1.0, 5.0, 40.0] {
                let h = 1e-2 * d;
                let slope = (kernel.loss(d + h) - kernel.loss(d - h)) / (2.0 * h);
                assert!(
                    (slope - 0.5 * kernel.weight(d)).abs() < 2e-3,
                    "{kernel:?} {d} {slope}"
                );
            }
        }
    }
}
