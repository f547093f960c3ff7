//! Poses in the plane.

use nalgebra::{Isometry2, Matrix3, UnitComplex, Vector2, Vector3};

use super::Group;

/// A pose in the plane: `world_from_body`, metres and radians.
///
/// Tangent vectors are `(x, y, theta)`. The step is the group's exponential, `pose * Exp(delta)`: the
/// arc that a constant twist describes. `local` is its logarithm with the angle in `[-pi, pi]`: the
/// error of GTSAM's `BetweenFactorPose2` (4.3). g2o takes the translation's difference itself
/// instead, which is the same to first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se2 {
    /// Where the body is, in the world.
    pub translation: Vector2<f64>,
    /// How it is turned.
    pub rotation: UnitComplex<f64>,
}

impl Se2 {
    /// From a position and an angle.
    pub fn new(x: f64, y: f64, theta: f64) -> Self {
        Self {
            translation: Vector2::new(x, y),
            rotation: UnitComplex::new(theta),
        }
    }

    /// The heading in [-pi, pi].
    #[inline(always)]
    pub fn theta(&self) -> f64 {
        self.rotation.im.atan2(self.rotation.re)
    }

    /// The pose reached from the identity by a constant twist for unit time.
    #[inline(always)]
    pub fn exp(twist: &Vector3<f64>) -> Self {
        let theta = twist.z;
        let (sin_half, cos_half) = (0.5 * theta).sin_cos();
        // sin(theta)/theta and (1 - cos(theta))/theta.
        let half_sinc = if theta.abs() < SERIES_BELOW {
            0.5 - theta * theta / 48.0
        } else {
            sin_half / theta
        };
        let (a, b) = (2.0 * half_sinc * cos_half, 2.0 * half_sinc * sin_half);
        Self {
            translation: Vector2::new(a * twist.x - b * twist.y, b * twist.x + a * twist.y),
            rotation: UnitComplex::new_unchecked(nalgebra::Complex::new(
                1.0 - 2.0 * sin_half * sin_half,
                2.0 * sin_half * cos_half,
            )),
        }
    }

    /// The twist that reaches this pose: the inverse of [`exp`](Self::exp).
    #[inline(always)]
    pub fn log(&self) -> Vector3<f64> {
        let theta = self.theta();
        let (a, _) = half_cotangent(theta, &self.rotation);
        let t = self.translation;
        Vector3::new(
            a * t.x + 0.5 * theta * t.y,
            a * t.y - 0.5 * theta * t.x,
            theta,
        )
    }
}

/// Below this angle series replace quotients that cancel: their next terms are below 1e-15.
const SERIES_BELOW: f64 = 1e-3;

/// `a = theta/2 cot(theta/2)` and `da/dtheta`. The inverse of the V matrix is
/// `[[a, theta/2], [-theta/2, a]]`.
#[inline(always)]
fn half_cotangent(theta: f64, rotation: &UnitComplex<f64>) -> (f64, f64) {
    let theta2 = theta * theta;
    if theta.abs() < SERIES_BELOW {
        return (1.0 - theta2 / 12.0, -theta / 6.0 * (1.0 + theta2 / 30.0));
    }
    // cot(theta/2) = sin / (1 - cos) = (1 + cos) / sin: whichever does not cancel.
    let (c, s) = (rotation.re, rotation.im);
    let cot = if c > 0.0 {
        (1.0 + c) / s
    } else {
        s / (1.0 - c)
    };
    // 1 / sin^2(theta/2) = 1 + cot^2(theta/2).
    let slope = 0.5 * cot - 0.25 * theta * (1.0 + cot * cot);
    (0.5 * theta * cot, slope)
}

impl From<Isometry2<f64>> for Se2 {
    fn from(pose: Isometry2<f64>) -> Self {
        Self {
            translation: pose.translation.vector,
            rotation: pose.rotation,
        }
    }
}

impl From<Se2> for Isometry2<f64> {
    fn from(pose: Se2) -> Self {
        Self::from_parts(pose.translation.into(), pose.rotation)
    }
}

/// `(a * b).re`, `.im` without a detour, scaled back to length one to first order: rounding does
/// not add up over any number of steps.
#[inline(always)]
fn turn(a: UnitComplex<f64>, b: UnitComplex<f64>) -> UnitComplex<f64> {
    let re = a.re * b.re - a.im * b.im;
    let im = a.re * b.im + a.im * b.re;
    let scale = 1.5 - 0.5 * (re * re + im * im);
    UnitComplex::new_unchecked(nalgebra::Complex::new(re * scale, im * scale))
}

impl Group for Se2 {
    const DIM: usize = 3;
    type Tangent = Vector3<f64>;
    type Matrix = Matrix3<f64>;

    fn identity() -> Self {
        Self::new(0.0, 0.0, 0.0)
    }

    #[inline(always)]
    fn compose(&self, other: &Self) -> Self {
        Self {
            translation: self.translation + self.rotation * other.translation,
            rotation: turn(self.rotation, other.rotation),
        }
    }

    #[inline(always)]
    fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self {
            translation: -(rotation * self.translation),
            rotation,
        }
    }

    #[inline(always)]
    fn retract(&self, delta: &Vector3<f64>) -> Self {
        self.compose(&Self::exp(delta))
    }

    #[inline(always)]
    fn local(&self, other: &Self) -> Vector3<f64> {
        self.between(other).log()
    }

    /// With `rho = V^-1(theta) t`: a step `(u, w)` of `other` changes `theta` by `w` and `t` by
    /// `R u`, hence `rho` by `V^-1 R u` plus the change of `V^-1` with `theta`.
    #[inline(always)]
    fn local_with_jacobian(&self, other: &Self) -> (Vector3<f64>, Matrix3<f64>) {
        let between = self.between(other);
        let theta = between.theta();
        let (a, slope) = half_cotangent(theta, &between.rotation);
        let (t, half) = (between.translation, 0.5 * theta);
        let (c, s) = (between.rotation.re, between.rotation.im);
        // V^-1 R has the same form as V^-1: a rotation and a scaling.
        let (p, q) = (a * c + half * s, a * s - half * c);
        let jacobian = Matrix3::new(
            p,
            -q,
            slope * t.x + 0.5 * t.y,
            q,
            p,
            slope * t.y - 0.5 * t.x,
            0.0,
            0.0,
            1.0,
        );
        let r = Vector3::new(a * t.x + half * t.y, a * t.y - half * t.x, theta);
        (r, jacobian)
    }

    #[inline(always)]
    fn adjoint(&self) -> Matrix3<f64> {
        let (c, s) = (self.rotation.re, self.rotation.im);
        let t = self.translation;
        Matrix3::new(c, -s, t.y, s, c, -t.x, 0.0, 0.0, 1.0)
    }

    fn is_finite(&self) -> bool {
        let t = self.translation;
        [t.x, t.y, self.rotation.re, self.rotation.im]
            .iter()
            .all(|v| v.is_finite())
    }
}
