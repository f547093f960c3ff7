//! The light that a colour picture is taken in.

use std::f64::consts::TAU;

use parry3d::math::Vector;

use crate::scene::narrow;

/// Light, as the camera's exposure leaves it. It changes nothing in the depth picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// How bright it is in red, green and blue: ones show everything in its own colour.
    pub level: [f64; 3],
    /// Share of it that comes from everywhere, 0 to 1; the rest comes from one side.
    pub ambient: f64,
    /// Towards that side, in the map; of any length but zero.
    pub towards: [f64; 3],
    /// Share by which it grows brighter and darker,
    pub swing: f64,
    /// and how long it takes to do so once, seconds.
    pub period_s: f64,
}

/// From everywhere and above, and steady.
impl Default for Light {
    fn default() -> Self {
        Self {
            level: [1.0; 3],
            ambient: 0.6,
            towards: [0.0, 0.0, 1.0],
            swing: 0.0,
            period_s: 60.0,
        }
    }
}

/// Light at one moment.
pub(super) struct Lighting {
    level: [f64; 3],
    ambient: f32,
    towards: Vector,
}

impl Light {
    /// At a time, seconds since the simulation's start.
    pub(super) fn at(&self, time_s: f64) -> Lighting {
        let strength = 1.0 + self.swing * (TAU * time_s / self.period_s).sin();
        Lighting {
            level: self.level.map(|level| level * strength),
            ambient: self.ambient as f32,
            towards: narrow(nalgebra::Vector3::from(self.towards).normalize()),
        }
    }
}

impl Lighting {
    /// How bright a surface of this normal is, for each colour.
    pub fn on(&self, normal: Vector) -> [f64; 3] {
        let light = self.ambient + (1.0 - self.ambient) * normal.dot(self.towards).max(0.0);
        self.level.map(|level| level * f64::from(light))
    }

    /// How bright the sky is, for each colour.
    pub const fn sky(&self) -> [f64; 3] {
        self.level
    }
}
