//! The height of the floor: zero, and ramps that rise over it; outdoors, hills.
//!
//! The same function gives the scene its ramp surface and the robot its footing, so the footprint
//! of the truth lies on what the LiDAR sees. It can be differentiated twice.

use crate::smooth::{self, Rise};

/// Over how many metres a ramp's slope sets in and ends.
const BLEND_M: f64 = 0.5;

/// A raised stretch of floor: a ramp up, a level stretch, a ramp down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaisedFloor {
    /// Where the ramp up begins, on the centre line, metres.
    pub start: [f64; 2],
    /// Direction of the centre line, a unit vector.
    pub along: [f64; 2],
    /// How far it reaches to either side of the centre line, metres.
    pub half_width_m: f64,
    /// Length of each of the two ramps, metres.
    pub ramp_m: f64,
    /// Length of the level stretch between them, metres.
    pub level_m: f64,
    /// Height of the level stretch, metres.
    pub height_m: f64,
}

impl RaisedFloor {
    /// From the foot of one ramp to the foot of the other, metres.
    pub fn length_m(&self) -> f64 {
        2.0 * self.ramp_m + self.level_m
    }

    /// The height `along_m` metres from the start.
    pub fn profile(&self, along_m: f64) -> f64 {
        let rise = Rise::over(self.ramp_m, self.height_m, BLEND_M);
        rise.value(along_m) - rise.value(along_m - self.ramp_m - self.level_m)
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - self.start[0], y - self.start[1]);
        let across = dy * self.along[0] - dx * self.along[1];
        if across.abs() > self.half_width_m {
            return 0.0;
        }
        self.profile(dx * self.along[0] + dy * self.along[1])
    }
}

/// A wave of the ground, as long crested as the terrain is wide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// How far it rises and falls, metres.
    pub amplitude_m: f64,
    /// From crest to crest, metres.
    pub length_m: f64,
    /// Direction in which it runs, a unit vector.
    pub along: [f64; 2],
    /// Phase at the origin, radians.
    pub phase_rad: f64,
}

impl Wave {
    /// Height and slope along x and y.
    fn rise(&self, x: f64, y: f64) -> Rising {
        let number = std::f64::consts::TAU / self.length_m;
        let along = x * self.along[0] + y * self.along[1];
        let (sin, cos) = (number * along + self.phase_rad).sin_cos();
        let slope = self.amplitude_m * number * cos;
        Rising {
            height: self.amplitude_m * sin,
            slope: self.along.map(|share| slope * share),
        }
    }
}

/// The ground at a place.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rising {
    /// Metres.
    pub height: f64,
    /// How it rises along x and y.
    pub slope: [f64; 2],
}

/// Rolling ground: waves that add up, level about the origin.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Terrain {
    /// The waves that add up to it.
    pub waves: Vec<Wave>,
    /// How far around the origin it is level, metres.
    pub level_m: f64,
    /// Over how many metres beyond that the waves set in.
    pub blend_m: f64,
}

impl Terrain {
    /// The ground's height at a place, metres.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.rise(x, y).height
    }

    /// Height and slope at a place.
    pub(crate) fn rise(&self, x: f64, y: f64) -> Rising {
        let mut sum = Rising::default();
        for wave in &self.waves {
            let rise = wave.rise(x, y);
            sum.height += rise.height;
            sum.slope = [0, 1].map(|axis| sum.slope[axis] + rise.slope[axis]);
        }
        let away = (x * x + y * y).sqrt();
        let beyond = (away - self.level_m) / self.blend_m.max(1e-9);
        if beyond >= 1.0 {
            return sum;
        }
        // Where the ground sets in, the way out is a way up or down too.
        let share = smooth::step(beyond);
        let setting_in = smooth::step_slope(beyond) / self.blend_m.max(1e-9) / away.max(1e-9);
        Rising {
            height: share * sum.height,
            slope: [
                share * sum.slope[0] + setting_in * x * sum.height,
                share * sum.slope[1] + setting_in * y * sum.height,
            ],
        }
    }
}

/// The floor of a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Floor {
    /// Stretches that rise over the level floor; they must not overlap.
    pub raised: Vec<RaisedFloor>,
    /// What it lies on, where that is not level.
    pub terrain: Option<Terrain>,
}

impl Floor {
    /// The floor's height at a place, metres.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let terrain = self.terrain.as_ref();
        self.raised_height(x, y) + terrain.map_or(0.0, |terrain| terrain.height(x, y))
    }

    /// How far what is raised lies over the terrain, metres.
    pub(crate) fn raised_height(&self, x: f64, y: f64) -> f64 {
        self.raised.iter().map(|raised| raised.height(x, y)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raised_floor_is_level_on_top_and_zero_outside() {
        let floor = Floor {
            raised: vec![RaisedFloor {
                start: [2.0, 1.0],
                along: [0.0, 1.0],
                half_width_m: 1.0,
                ramp_m: 3.0,
                level_m: 2.0,
                height_m: 0.3,
            }],
            ..Floor::default()
        };
        assert_eq!(floor.height(2.0, 0.9), 0.0);
        assert_eq!(floor.height(3.2, 5.0), 0.0);
        assert!((floor.height(2.5, 5.0) - 0.3).abs() < 1e-12);
        assert!((floor.height(2.0, 2.5) - 0.15).abs() < 1e-12);
        assert!(floor.height(2.0, 9.1).abs() < 1e-12);
    }
    #[test]
    fn ground_is_level_at_the_origin_and_rolls_beyond() {
        let terrain = Terrain {
            waves: vec![Wave {
                amplitude_m: 1.5,
                length_m: 120.0,
                along: [1.0, 0.0],
                phase_rad: 0.0,
            }],
            level_m: 8.0,
            blend_m: 30.0,
        };
        assert_eq!(terrain.height(0.0, 7.9), 0.0);
        assert_eq!(terrain.height(-5.0, 5.0), 0.0);
        // Past the blend: a quarter wave, and a full one, from the origin.
        assert!((terrain.height(150.0, 3.0) - 1.5).abs() < 1e-9);
        assert!(terrain.height(120.0, -70.0).abs() < 1e-9);
        assert!((terrain.height(90.0, 0.0) + 1.5).abs() < 1e-9);
        // The slope is that of the heights around, where the ground sets in and beyond.
        for (x, y) in [(3.0, 2.0), (15.0, -9.0), (-7.0, 22.0), (80.0, 5.0)] {
            let slope = terrain.rise(x, y).slope;
            let step = 1e-4;
            let along_x = terrain.height(x + step, y) - terrain.height(x - step, y);
            let along_y = terrain.height(x, y + step) - terrain.height(x, y - step);
            assert!((slope[0] - along_x / (2.0 * step)).abs() < 1e-7, "{x} {y}");
            assert!((slope[1] - along_y / (2.0 * step)).abs() < 1e-7, "{x} {y}");
        }
    }
}
