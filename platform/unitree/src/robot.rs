//! What one robot of this maker is in numbers. The numbers themselves are in the robots' own
//! crates.

use hachi_hal::Vector3;

use crate::command::CommandLimits;
use crate::contact::ContactConfig;
use crate::frame::Layout;
use crate::kinematics::LegGeometry;

/// A quadruped of this maker: everything that differs between one and the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quadruped {
    /// Its frames.
    pub layout: Layout,
    /// Its legs.
    pub geometry: LegGeometry,
    /// What its joints can do.
    pub joints: JointLimits,
    /// What may be asked of it.
    pub limits: CommandLimits,
    /// How its feet tell that they stand.
    pub contact: ContactConfig,
    /// Where it answers.
    pub endpoints: Endpoints,
    /// Weight with battery, kg.
    pub mass_kg: f64,
    /// Where the inertial sensor sits on the base, metres; it is not turned.
    pub imu_in_base: [f64; 3],
    /// HighState frames a second.
    pub high_state_hz: f64,
    /// How often the contents of a HighState are new, a second.
    pub refresh_hz: f64,
}

impl Quadruped {
    /// Its name.
    pub const fn name(&self) -> &'static str {
        self.layout.model.name()
    }

    /// Where the inertial sensor sits on the base, metres.
    pub fn base_from_imu(&self) -> Vector3 {
        Vector3::from(self.imu_in_base)
    }
}

/// Least and most of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Least.
    pub least: f64,
    /// Most.
    pub most: f64,
}

impl Span {
    /// From `least` to `most`.
    pub const fn new(least: f64, most: f64) -> Self {
        Self { least, most }
    }

    /// As far to both sides of zero.
    pub const fn about_zero(most: f64) -> Self {
        Self { least: -most, most }
    }

    /// The nearest value within; not-a-number becomes zero, or the end next to it.
    pub fn clamp(&self, value: f64) -> f64 {
        let value = if value.is_nan() { 0.0 } else { value };
        value.max(self.least).min(self.most)
    }

    /// Whether the value lies within, or beyond by no more than `margin`.
    pub fn contains(&self, value: f64, margin: f64) -> bool {
        value >= self.least - margin && value <= self.most + margin
    }

    /// What both allow.
    pub const fn intersection(&self, other: &Self) -> Self {
        Self {
            least: if self.least > other.least {
                self.least
            } else {
                other.least
            },
            most: if self.most < other.most {
                self.most
            } else {
                other.most
            },
        }
    }
}

/// What hip, thigh and calf can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Where the mechanics end (URDF), rad.
    pub mechanical: [Span; 3],
    /// What the maker's library lets pass, rad.
    pub library: [Span; 3],
    /// Most torque, Nm.
    pub torque: [f64; 3],
    /// Most speed, rad/s.
    pub speed: [f64; 3],
}

impl JointLimits {
    /// Angles that may be commanded: what mechanics and library both allow.
    pub const fn commanded(&self) -> [Span; 3] {
        [
            self.mechanical[0].intersection(&self.library[0]),
            self.mechanical[1].intersection(&self.library[1]),
            self.mechanical[2].intersection(&self.library[2]),
        ]
    }
}

/// Addresses and ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Endpoints {
    /// The high-level service.
    pub high: ([u8; 4], u16),
    /// The motor controller.
    pub low: ([u8; 4], u16),
    /// Port that the host sends from, and is answered at.
    pub local_port: u16,
}
