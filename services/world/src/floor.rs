//! The height of the floor: zero, and ramps that rise over it.
//!
//! The same function gives the scene its ramp surface and the robot its footing, so the footprint
//! of the truth lies on what the LiDAR sees. It can be differentiated twice.

use crate::smooth::Rise;

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

/// The floor of a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Floor {
    /// Stretches that rise over the level floor; they must not overlap.
    pub raised: Vec<RaisedFloor>,
}

impl Floor {
    /// The floor's height at a place, metres.
    pub fn height(&self, x: f64, y: f64) -> f64 {
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
        };
        assert_eq!(floor.height(2.0, 0.9), 0.0);
        assert_eq!(floor.height(3.2, 5.0), 0.0);
        assert!((floor.height(2.5, 5.0) - 0.3).abs() < 1e-12);
        assert!((floor.height(2.0, 2.5) - 0.15).abs() < 1e-12);
        assert!(floor.height(2.0, 9.1).abs() < 1e-12);
    }
}
