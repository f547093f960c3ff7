//! One leg of three joints: joints to foot, its derivative, and back.
//!
//! In: joint angles, or a place for the foot, base frame. Out: the centre of the foot's sphere,
//! the Jacobian, joint angles. Hip about +x, thigh and calf about +y; at zero angles the leg hangs
//! straight down, and the calf's angle is negative with the knee behind.
//!
//! With sides `s` (+1 left, -1 right), sines and cosines `s0, c0, s1, c1, s12, c12` of hip, thigh
//! and thigh plus calf: `x = -l1 s1 - l2 s12`, `zeta = -l1 c1 - l2 c12`,
//! `y = s d c0 - zeta s0`, `z = s d s0 + zeta c0`. Checked against the URDFs' chains.

use core::f64::consts::{PI, TAU};

use hachi_hal::{Leg, LegKinematics, LegPosture, Matrix3, Vector3};
use libm::{acos, atan2, cos, sin, sqrt};

/// Lengths of a quadruped's legs, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegGeometry {
    /// From the base's middle to the hips, forward.
    pub hip_forward: f64,
    /// From the base's middle to the hips, sideways.
    pub hip_sideways: f64,
    /// From the hip's axis to the plane in which thigh and calf move.
    pub abduction: f64,
    /// Thigh.
    pub thigh: f64,
    /// Calf, to the centre of the foot.
    pub calf: f64,
    /// Radius of the foot.
    pub foot_radius: f64,
}

impl LegGeometry {
    /// Where the leg's hip joint is in the base frame.
    pub fn hip(&self, leg: Leg) -> Vector3 {
        Vector3::new(
            leg.end() * self.hip_forward,
            leg.side() * self.hip_sideways,
            0.0,
        )
    }

    /// Height of the base over the ground with every leg at these angles on level ground, metres.
    pub fn standing_height(&self, angles: &Vector3) -> f64 {
        self.foot_radius - self.foot_in_base(Leg::FrontLeft, angles).z
    }
}

/// Sines and cosines of one leg's angles, and what follows from them.
struct Bent {
    s0: f64,
    c0: f64,
    /// Foot in the leg's plane: forward.
    x: f64,
    /// Foot in the leg's plane: up, which is negative.
    zeta: f64,
    /// The calf's part of `x`.
    calf_x: f64,
    /// The calf's part of `zeta`.
    calf_zeta: f64,
}

impl Bent {
    fn new(geometry: &LegGeometry, angles: &Vector3) -> Self {
        let (q0, q1, q12) = (angles.x, angles.y, angles.y + angles.z);
        let (calf_x, calf_zeta) = (-geometry.calf * sin(q12), -geometry.calf * cos(q12));
        Self {
            s0: sin(q0),
            c0: cos(q0),
            x: calf_x - geometry.thigh * sin(q1),
            zeta: calf_zeta - geometry.thigh * cos(q1),
            calf_x,
            calf_zeta,
        }
    }
}

impl LegKinematics for LegGeometry {
    fn foot_in_base(&self, leg: Leg, angles: &Vector3) -> Vector3 {
        let Bent {
            s0, c0, x, zeta, ..
        } = Bent::new(self, angles);
        let aside = leg.side() * self.abduction;
        self.hip(leg) + Vector3::new(x, aside * c0 - zeta * s0, aside * s0 + zeta * c0)
    }

    fn jacobian(&self, leg: Leg, angles: &Vector3) -> Matrix3 {
        let bent = Bent::new(self, angles);
        let (s0, c0) = (bent.s0, bent.c0);
        let aside = leg.side() * self.abduction;
        // A turn about +y moves x by zeta and zeta by -x.
        let planar = |x: f64, zeta: f64| Vector3::new(zeta, x * s0, -x * c0);
        Matrix3::from_columns(&[
            Vector3::new(
                0.0,
                -aside * s0 - bent.zeta * c0,
                aside * c0 - bent.zeta * s0,
            ),
            planar(bent.x, bent.zeta),
            planar(bent.calf_x, bent.calf_zeta),
        ])
    }

    fn shank_axes(&self, _: Leg, angles: &Vector3) -> Matrix3 {
        let knee_axis = Vector3::new(0.0, cos(angles.x), sin(angles.x));
        Matrix3::from_columns(&[Vector3::x(), knee_axis, knee_axis])
    }

    fn joints_for(&self, leg: Leg, foot: &Vector3) -> LegPosture {
        let [x, y, z] = (*foot - self.hip(leg)).into();
        let aside = leg.side() * self.abduction;
        // Nearer to the hip's axis than the abduction link is long there is no foot.
        let down_squared = y * y + z * z - aside * aside;
        let zeta = -sqrt(down_squared.max(0.0));
        let q0 = wrapped(atan2(z, y) - atan2(zeta, aside));
        let (l1, l2) = (self.thigh, self.calf);
        let bend = (x * x + zeta * zeta - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
        let q2 = -acos(bend.clamp(-1.0, 1.0));
        let q1 = wrapped(atan2(-x, -zeta) - atan2(l2 * sin(q2), l1 + l2 * cos(q2)));
        // A stretched leg gives 1 and a rounding error. Not-a-number is not reachable.
        const ROUNDING: f64 = 1e-12;
        LegPosture {
            angles: Vector3::new(q0, q1, q2),
            reachable: down_squared >= 0.0 && bend.abs() <= 1.0 + ROUNDING,
        }
    }

    fn foot_radius_m(&self) -> f64 {
        self.foot_radius
    }
}

/// An angle within (-pi, pi].
fn wrapped(angle: f64) -> f64 {
    if angle > PI {
        angle - TAU
    } else if angle <= -PI {
        angle + TAU
    } else {
        angle
    }
}
