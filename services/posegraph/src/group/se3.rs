//! Poses in space.

use nalgebra::{Isometry3, Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};

use super::Group;

/// A pose in space: `world_from_body`, metres.
///
/// Tangent vectors are `(x, y, z, rx, ry, rz)`, translation first, the rotation as a rotation
/// vector. The step is the group's exponential, `pose * Exp(delta)`, and `local` its logarithm with
/// the rotation's angle in `[0, pi]`: the error of GTSAM's `BetweenFactorPose3`, where rotation
/// comes first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se3 {
    /// Where the body is, in the world.
    pub translation: Vector3<f64>,
    /// How it is turned.
    pub rotation: UnitQuaternion<f64>,
}

impl Se3 {
    /// From a position and a rotation.
    pub fn new(translation: Vector3<f64>, rotation: UnitQuaternion<f64>) -> Self {
        Self {
            translation,
            rotation,
        }
    }

    /// The pose reached from the identity by a constant twist for unit time.
    pub fn exp(twist: &Vector6<f64>) -> Self {
        let rho = twist.fixed_rows::<3>(0).into_owned();
        let phi = twist.fixed_rows::<3>(3).into_owned();
        let theta2 = phi.norm_squared();
        // sin(x/2)/x, and the V matrix's (1 - cos)/x^2 and (x - sin)/x^3 (Barfoot, State Estimation
        // for Robotics, eq. 7.82); near zero their series, exact to rounding at the bound.
        let (half_sinc, w, b, c) = if theta2 < SERIES_BELOW {
            (
                0.5 - theta2 / 48.0 * (1.0 - theta2 / 80.0),
                1.0 - theta2 / 8.0 * (1.0 - theta2 / 48.0),
                0.5 - theta2 / 24.0 * (1.0 - theta2 / 30.0),
                1.0 / 6.0 - theta2 / 120.0 * (1.0 - theta2 / 42.0),
            )
        } else {
            let theta = theta2.sqrt();
            let (sin_half, cos_half) = (0.5 * theta).sin_cos();
            let sine = 2.0 * sin_half * cos_half;
            (
                sin_half / theta,
                cos_half,
                2.0 * sin_half * sin_half / theta2,
                (theta - sine) / (theta2 * theta),
            )
        };
        let turned = phi.cross(&rho);
        Self {
            translation: rho + turned * b + phi.cross(&turned) * c,
            rotation: UnitQuaternion::new_unchecked(Quaternion::from_parts(w, phi * half_sinc)),
        }
    }

    /// The twist that reaches this pose: the inverse of [`exp`](Self::exp).
    pub fn log(&self) -> Vector6<f64> {
        let logarithm = Logarithm::of(self);
        stack(&logarithm.rho(&self.translation), &logarithm.phi)
    }
}

/// Below this squared angle series replace quotients that cancel. 1e-4 rad^2: the next term of
/// each series is below 1e-16 there.
const SERIES_BELOW: f64 = 1e-4;

/// The logarithm of a rotation, and what the inverse of the V matrix needs:
/// `V^-1 = I - phi^/2 + c phi^^2`.
struct Logarithm {
    phi: Vector3<f64>,
    theta2: f64,
    c: f64,
    /// `(dc/dtheta) / theta`.
    dc: f64,
}

impl Logarithm {
    #[inline(always)]
    fn of(pose: &Se3) -> Self {
        let q = pose.rotation.as_ref();
        // q and -q are the same rotation: take the shorter way round.
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        let w = sign * q.w;
        let v = q.imag() * sign;
        let sine2 = v.norm_squared();
        if sine2 < SERIES_BELOW / 4.0 {
            // asin(s)/s for s = sin(theta / 2).
            let ratio = 2.0
                * (1.0 + sine2 / 6.0 * (1.0 + 9.0 / 20.0 * sine2 * (1.0 + 25.0 / 42.0 * sine2)));
            let theta2 = sine2 * ratio * ratio;
            return Self {
                phi: v * ratio,
                theta2,
                c: 1.0 / 12.0 + theta2 / 720.0 * (1.0 + theta2 / 42.0),
                dc: 1.0 / 360.0 + theta2 / 7560.0 * (1.0 + 3.0 * theta2 / 80.0),
            };
        }
        let sine = sine2.sqrt();
        let theta = 2.0 * sine.atan2(w);
        let theta2 = theta * theta;
        let cot = w / sine;
        Self {
            phi: v * (theta / sine),
            theta2,
            c: 1.0 / theta2 - cot / (2.0 * theta),
            dc: (-2.0 / theta + 1.0 / (4.0 * sine2) * theta + cot / 2.0) / (theta2 * theta),
        }
    }

    /// `V^-1 t`.
    #[inline(always)]
    fn rho(&self, t: &Vector3<f64>) -> Vector3<f64> {
        let turned = self.phi.cross(t);
        t - turned * 0.5 + self.phi.cross(&turned) * self.c
    }
}

#[inline(always)]
fn stack(rho: &Vector3<f64>, phi: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// Scaled back to length one to first order: rounding does not add up over any number of steps.
#[inline(always)]
fn turn(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let product = a.as_ref() * b.as_ref();
    UnitQuaternion::new_unchecked(product * (1.5 - 0.5 * product.norm_squared()))
}

impl From<Isometry3<f64>> for Se3 {
    fn from(pose: Isometry3<f64>) -> Self {
        Self::new(pose.translation.vector, pose.rotation)
    }
}

impl From<Se3> for Isometry3<f64> {
    fn from(pose: Se3) -> Self {
        Self::from_parts(pose.translation.into(), pose.rotation)
    }
}

impl Group for Se3 {
    const DIM: usize = 6;
    type Tangent = Vector6<f64>;
    type Matrix = Matrix6<f64>;

    fn identity() -> Self {
        Self::new(Vector3::zeros(), UnitQuaternion::identity())
    }

    #[inline(always)]
    fn compose(&self, other: &Self) -> Self {
        Self {
            translation: self.translation + self.rotation * other.translation,
            rotation: turn(&self.rotation, &other.rotation),
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
    fn retract(&self, delta: &Vector6<f64>) -> Self {
        self.compose(&Self::exp(delta))
    }

    #[inline(always)]
    fn local(&self, other: &Self) -> Vector6<f64> {
        self.between(other).log()
    }

    /// With `V^-1(phi) t = rho`: a step `(u, w)` of `other` changes `phi` by `J_r^-1 w` and `t` by
    /// `R u`, hence `rho` by `V^-1 R u = J_r^-1 u` plus the change of `V^-1` with `phi`.
    #[inline(always)]
    fn local_with_jacobian(&self, other: &Self) -> (Vector6<f64>, Matrix6<f64>) {
        let between = self.between(other);
        let logarithm = Logarithm::of(&between);
        let Logarithm { phi, theta2, c, dc } = logarithm;
        let t = &between.translation;
        let rho = logarithm.rho(t);
        let cross = Matrix3::new(0.0, -phi.z, phi.y, phi.z, 0.0, -phi.x, -phi.y, phi.x, 0.0);
        // J_r^-1 = I + phi^/2 + c phi^^2, and phi^^2 = phi phi' - theta^2 I.
        let outer = phi * phi.transpose();
        let right = Matrix3::identity() * (1.0 - c * theta2) + cross * 0.5 + outer * c;
        // d(V^-1 t)/dphi = t^/2 + c (phi.t I + phi t' - 2 t phi') + dc (phi^ phi^ t) phi'.
        let dot = phi.dot(t);
        let twice = phi * dot - t * theta2;
        let t_cross = Matrix3::new(0.0, -t.z, t.y, t.z, 0.0, -t.x, -t.y, t.x, 0.0);
        let change = t_cross * 0.5
            + Matrix3::identity() * (c * dot)
            + phi * (t * c).transpose()
            + (twice * dc - t * (2.0 * c)) * phi.transpose();
        let mixed = change * right;
        let mut jacobian = Matrix6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&right);
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&mixed);
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&right);
        (stack(&rho, &phi), jacobian)
    }

    #[inline(always)]
    fn adjoint(&self) -> Matrix6<f64> {
        let r = self.rotation.to_rotation_matrix().into_inner();
        let t = self.translation;
        let cross = Matrix3::new(0.0, -t.z, t.y, t.z, 0.0, -t.x, -t.y, t.x, 0.0);
        let mut adjoint = Matrix6::zeros();
        adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
        adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&(cross * r));
        adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
        adjoint
    }

    fn is_finite(&self) -> bool {
        self.translation.iter().all(|v| v.is_finite())
            && self.rotation.coords.iter().all(|v| v.is_finite())
    }
}
