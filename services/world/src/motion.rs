//! How a body moves about its mean: the bobbing of a trot, the shaking of a hand.
//!
//! Sums of sines, so that every derivative is known and the amplitude and frequency of a recording
//! are what the configuration says.

use hachi_hal::{Pose, Rotation};
use nalgebra::Translation3;

use crate::smooth;

/// What a harmonic moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// Left, metres.
    Sway,
    /// Up, metres.
    Height,
    /// About x, radians.
    Roll,
    /// About y, radians.
    Pitch,
    /// About z, radians.
    Yaw,
}

/// One sine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// What it moves.
    pub axis: Axis,
    /// Its amplitude, metres or radians.
    pub amplitude: f64,
    /// Its frequency, hertz.
    pub frequency_hz: f64,
    /// Its phase at the start, radians.
    pub phase: f64,
}

/// The body's motion about its mean.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyMotion {
    /// The sines that add up to it.
    pub harmonics: Vec<Harmonic>,
    /// Whether it stops when the body stands (a gait) or not (a hand).
    pub only_while_moving: bool,
}

/// A body that shakes from the first moment does so after this many seconds.
const SET_IN_S: f64 = 1.0;

impl BodyMotion {
    /// None.
    pub fn none() -> Self {
        Self {
            harmonics: Vec::new(),
            only_while_moving: true,
        }
    }

    /// A quadruped at a trot: 2 Hz, 1.5 cm up and down, 1 degree of pitch, 1.5 degrees of roll.
    pub fn trot() -> Self {
        let frequency_hz = 2.0;
        let harmonic = |axis, amplitude, phase| Harmonic {
            axis,
            amplitude,
            frequency_hz,
            phase,
        };
        Self {
            harmonics: vec![
                harmonic(Axis::Height, 0.015, 0.0),
                harmonic(Axis::Pitch, 1f64.to_radians(), 1.1),
                harmonic(Axis::Roll, 1.5f64.to_radians(), 0.4),
            ],
            only_while_moving: true,
        }
    }

    /// On wheels over paving: 3 mm up and down, half a degree of pitch and roll.
    pub fn rolling() -> Self {
        let harmonic = |axis, amplitude, frequency_hz, phase| Harmonic {
            axis,
            amplitude,
            frequency_hz,
            phase,
        };
        Self {
            harmonics: vec![
                harmonic(Axis::Height, 0.003, 3.1, 0.0),
                harmonic(Axis::Pitch, 0.5f64.to_radians(), 1.3, 0.9),
                harmonic(Axis::Roll, 0.5f64.to_radians(), 0.9, 0.3),
            ],
            only_while_moving: true,
        }
    }

    /// Carried by hand at a brisk pace: steps and shakes at 2 Hz, and the bearer looks left and
    /// right, at up to 80 degrees a second on top of the turns of the path.
    pub fn hand_held() -> Self {
        let harmonic = |axis, amplitude, frequency_hz, phase| Harmonic {
            axis,
            amplitude,
            frequency_hz,
            phase,
        };
        Self {
            harmonics: vec![
                harmonic(Axis::Height, 0.03, 2.0, 0.0),
                harmonic(Axis::Sway, 0.03, 1.0, 0.7),
                harmonic(Axis::Pitch, 3f64.to_radians(), 2.0, 1.3),
                harmonic(Axis::Roll, 3f64.to_radians(), 2.0, 2.1),
                // 23 degrees at 0.55 Hz: 80 degrees a second at most.
                harmonic(Axis::Yaw, 23f64.to_radians(), 0.55, 0.0),
            ],
            only_while_moving: false,
        }
    }

    /// The displacement after `time_s` seconds of a body that moves with a share `activity` (0 to
    /// 1) of its full speed: takes points of the displaced body to the body at its mean.
    pub(crate) fn displacement(&self, time_s: f64, activity: f64) -> Pose {
        let scale = if self.only_while_moving {
            activity
        } else {
            smooth::step(time_s / SET_IN_S)
        };
        let [mut sway, mut height, mut roll, mut pitch, mut yaw] = [0.0; 5];
        for harmonic in &self.harmonics {
            let angle = std::f64::consts::TAU * harmonic.frequency_hz * time_s + harmonic.phase;
            let value = scale * harmonic.amplitude * angle.sin();
            *match harmonic.axis {
                Axis::Sway => &mut sway,
                Axis::Height => &mut height,
                Axis::Roll => &mut roll,
                Axis::Pitch => &mut pitch,
                Axis::Yaw => &mut yaw,
            } += value;
        }
        Pose::from_parts(
            Translation3::new(0.0, sway, height),
            Rotation::from_euler_angles(roll, pitch, yaw),
        )
    }
}
