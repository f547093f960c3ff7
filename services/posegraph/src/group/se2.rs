//! Poses in the plane.

use nalgebra::{Isometry2, Matrix3, UnitComplex, Vector2, Vector3};

use super::Group;

/// A pose in the plane: `world_from_body`, metres and radians.
///
/// Tangent vectors are `(x, y, theta)`. The step is *not* the group's exponential but the pose of
/// these three numbers, `pose * (x, y, R(theta))`; `local` reads the three numbers of
/// `self^-1 * other` with the angle in (-pi, pi]. This is the error of g2o's `EDGE_SE2` and of
/// GTSAM's `BetweenFactorPose2`.
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

    /// The heading in (-pi, pi].
    #[inline(always)]
    pub fn theta(&self) -> f64 {
        self.rotation.im.atan2(self.rotation.re)
    }
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
        self.compose(&Self::new(delta.x, delta.y, delta.z))
    }

    #[inline(always)]
    fn local(&self, other: &Self) -> Vector3<f64> {
        let between = self.between(other);
        Vector3::new(
            between.translation.x,
            between.translation.y,
            between.theta(),
        )
    }

    #[inline(always)]
    fn local_with_jacobian(&self, other: &Self) -> (Vector3<f64>, Matrix3<f64>) {
        let between = self.between(other);
        let (c, s) = (between.rotation.re, between.rotation.im);
        let t = between.translation;
        (
            Vector3::new(t.x, t.y, between.theta()),
            Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0),
        )
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
