//! Where the beams of a firing go: the head's turn, the lasers' angles, the body's motion.
//!
//! In: a sensor, where it is when the first and when the last laser of a group of sixteen fires,
//! how far the head has turned. Out: sixteen rays in the map, the lower eight and the upper eight.
//! Elsewhere: what they hit (`fan`, `optics`), when a group fires (`sensor`).

use std::f64::consts::TAU;

use hachi_hal::{Pose, Vector3};
use nalgebra::Matrix3;
use parry3d::query::Ray;

use crate::helios;
use crate::optics::{Wanted, beam};
use crate::sensor::{SensorKind, TURN_NS};

/// Lasers of a group.
pub(crate) const LASERS: usize = 16;
/// Half the distance between the two halves of a beam at its divergence of 3 mrad (VLP-16
/// manual), radians: at edges they see two things.
const HALF_BEAM_RAD: f64 = 0.000_75;

/// Sine and cosine.
#[derive(Debug, Clone, Copy)]
struct Angle {
    sin: f64,
    cos: f64,
}

impl Angle {
    fn new(radians: f64) -> Self {
        let (sin, cos) = radians.sin_cos();
        Self { sin, cos }
    }

    /// The sum of two angles, by the addition theorem.
    fn plus(self, other: Self) -> Self {
        Self {
            sin: self.sin * other.cos + self.cos * other.sin,
            cos: self.cos * other.cos - self.sin * other.sin,
        }
    }
}

/// One laser, as the first of its group fires at azimuth zero.
#[derive(Debug, Clone, Copy)]
struct Laser {
    /// How far the head has turned when this one fires.
    turned: Angle,
    /// The azimuth of its beam.
    azimuth: Angle,
    rise: Angle,
    /// When it fires, as a share of the group's time.
    share: f64,
}

/// The lasers of a sensor.
#[derive(Debug)]
pub(crate) struct Head {
    lasers: [Laser; LASERS],
    /// From a laser to its place by elevation.
    places: [usize; LASERS],
    /// From the middle of the beam to the sides that are cast.
    sides: Vec<Angle>,
    /// How much of the light each side has.
    pub gain: f32,
    /// The echoes that the sensor is after.
    pub wanted: Wanted,
    lens_m: f64,
}

impl Head {
    pub fn new(sensor: SensorKind) -> Self {
        // A sensor that reports two echoes also sees both sides of an edge: half the beam each.
        let (sides, gain, wanted): (&[f64], f32, _) = match sensor {
            SensorKind::Vlp16Dual => (&[-HALF_BEAM_RAD, HALF_BEAM_RAD], 0.5, Wanted::Every),
            SensorKind::Vlp16 | SensorKind::Helios16P => (&[0.0], 1.0, Wanted::Strongest),
        };
        let first = sensor.firing(0, 0).offset_ns;
        let last = sensor.firing(0, LASERS - 1).offset_ns;
        let mut by_elevation: [usize; LASERS] = std::array::from_fn(|laser| laser);
        let elevation = |laser: &usize| sensor.firing(0, *laser).elevation_rad;
        by_elevation.sort_by(|a, b| elevation(a).total_cmp(&elevation(b)));
        let mut places = [0; LASERS];
        for (place, laser) in by_elevation.into_iter().enumerate() {
            places[laser] = place;
        }
        Self {
            places,
            lasers: by_elevation.map(|laser| {
                let firing = sensor.firing(0, laser);
                let since = (firing.offset_ns - first) as f64;
                let turned = since / TURN_NS as f64 * TAU;
                Laser {
                    turned: Angle::new(turned),
                    azimuth: Angle::new(turned + firing.azimuth_offset_rad),
                    rise: Angle::new(firing.elevation_rad),
                    share: since / (last - first) as f64,
                }
            }),
            sides: sides.iter().map(|side| Angle::new(*side)).collect(),
            gain,
            wanted,
            lens_m: match sensor {
                SensorKind::Vlp16 | SensorKind::Vlp16Dual => 0.0,
                SensorKind::Helios16P => helios::LENS_M,
            },
        }
    }

    /// Rays of a group.
    pub fn rays(&self) -> usize {
        LASERS * self.sides.len()
    }

    /// Where among the rays of a group those of a laser are.
    pub fn rays_of(&self, laser: usize) -> impl Iterator<Item = usize> {
        let place = self.places[laser];
        (0..self.sides.len()).map(move |side| LASERS * side + place)
    }

    /// Adds the rays of a group. Its first laser fires with the sensor at `from` and the head turned
    /// by `turned_rad`, its last one with the sensor at `to`.
    ///
    /// In between (35 µs) the pose is interpolated: a body shaken at 60 rad/s² departs from that
    /// by 1e-8 rad.
    pub fn aim(&self, from: &Pose, to: &Pose, turned_rad: f64, rays: &mut Vec<Ray>) {
        let [from, to] = [from, to].map(|pose| {
            let turn = pose.rotation.to_rotation_matrix().into_inner();
            (turn, pose.translation.vector)
        });
        let turned = Angle::new(turned_rad);
        for side in &self.sides {
            let head = turned.plus(*side);
            rays.extend(self.lasers.iter().map(|laser| {
                let turn: Matrix3<f64> = from.0 + (to.0 - from.0) * laser.share;
                let mut origin = from.1 + (to.1 - from.1) * laser.share;
                if self.lens_m > 0.0 {
                    let lens = turned.plus(laser.turned);
                    origin += turn * Vector3::new(lens.cos, -lens.sin, 0.0) * self.lens_m;
                }
                // Azimuth runs clockwise seen from above, from x.
                let azimuth = head.plus(laser.azimuth);
                let level = laser.rise.cos;
                let direction =
                    Vector3::new(level * azimuth.cos, -level * azimuth.sin, laser.rise.sin);
                beam(origin.into(), (turn * direction).normalize().into())
            }));
        }
    }
}
