//! Where each laser points.
//!
//! Angles, rings and the vertical corrections of the VLP-16 are the manual's table; the Hi-Res has
//! the same order in steps of 1.33°.

use super::{CHANNELS, LASER_COUNT, Model};

/// One laser of the fan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laser {
    /// Elevation, degrees, up positive.
    pub elevation_deg: f64,
    /// Rank by elevation, 0 is the lowest.
    pub ring: u16,
    /// How much higher than the sensor's origin the beam starts, millimetres.
    pub vertical_correction_mm: f64,
}

/// The VLP-16's lasers in firing order.
pub const LASERS: [Laser; LASER_COUNT] = {
    const MM: [f64; LASER_COUNT] = [
        11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2,
    ];
    let mut lasers = [Laser {
        elevation_deg: 0.0,
        ring: 0,
        vertical_correction_mm: 0.0,
    }; LASER_COUNT];
    let mut id = 0;
    while id < LASER_COUNT {
        // Even lasers are the lower half, odd ones the upper half, both upwards.
        let ring = id / 2 + (id % 2) * 8;
        lasers[id] = Laser {
            elevation_deg: -15.0 + 2.0 * ring as f64,
            ring: ring as u16,
            vertical_correction_mm: MM[id],
        };
        id += 1;
    }
    lasers
};

/// Elevations of the Hi-Res in firing order, degrees (manual, Puck Hi-Res supplement).
const HI_RES_DEG: [f64; LASER_COUNT] = [
    -10.00, 0.67, -8.67, 2.00, -7.33, 3.33, -6.00, 4.67, -4.67, 6.00, -3.33, 7.33, -2.00, 8.67,
    -0.67, 10.00,
];

/// The VLP-16's corrections are this times the tangent of the elevation, downwards, to their
/// printed digit; the Hi-Res has the same optics, so its corrections follow from its angles.
const CORRECTION_ARM_MM: f64 = 41.8;

/// The fan of one model, ready for decoding: one entry for each channel of a block, so that the
/// decoder's loops run over whole blocks.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserTable {
    /// Cosine of the elevation.
    pub(super) cos: [f32; CHANNELS],
    /// Sine of the elevation.
    pub(super) sin: [f32; CHANNELS],
    /// Added to z, metres.
    pub(super) lift_m: [f32; CHANNELS],
    /// Rank by elevation.
    pub(super) ring: [u16; CHANNELS],
}

impl LaserTable {
    /// The fan of `model`; `vertical_correction` lifts each beam to where it leaves the sensor.
    pub fn new(model: Model, vertical_correction: bool) -> Self {
        let mut table = Self {
            cos: [0.0; CHANNELS],
            sin: [0.0; CHANNELS],
            lift_m: [0.0; CHANNELS],
            ring: [0; CHANNELS],
        };
        for channel in 0..CHANNELS {
            let id = channel % LASER_COUNT;
            let laser = &LASERS[id];
            let (degrees, lift_mm) = match model {
                Model::Vlp16 => (laser.elevation_deg, laser.vertical_correction_mm),
                Model::HiRes => {
                    let degrees = HI_RES_DEG[id];
                    let lift_mm = -CORRECTION_ARM_MM * libm::tan(degrees.to_radians());
                    (degrees, lift_mm)
                }
            };
            let (sin, cos) = libm::sincos(degrees.to_radians());
            table.cos[channel] = cos as f32;
            table.sin[channel] = sin as f32;
            table.ring[channel] = laser.ring;
            if vertical_correction {
                table.lift_m[channel] = (lift_mm * 1e-3) as f32;
            }
        }
        table
    }
}
