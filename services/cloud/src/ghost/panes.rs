//! Where panes of glass may stand: vertical planes through weak returns.
//!
//! In: positions of weak returns, turned upright, relative to the sensor. Out: candidate planes,
//! best first. A Hough transform over direction and distance of vertical planes; each peak is
//! refined by least squares and its returns are taken out before the next. A clean pane returns
//! light only where it is met head-on, a small spot that long dark walls would outvote; so there
//! are two rounds, the first with votes for nearly head-on planes alone.

use alloc::vec::Vec;

use crate::float::{norm, sqrt};

/// Directions: two degrees each.
const DIRECTIONS: usize = 180;
const STEP_RAD: f32 = core::f32::consts::TAU / DIRECTIONS as f32;
/// Distances of 10 cm, out to 20 m.
const DISTANCES: usize = 200;
const DISTANCE_STEP_M: f32 = 0.1;
/// Nearer planes would cut the robot.
const NEAREST_M: f32 = 0.3;
/// Weak returns that vote in the first round, at most, and in the second, where each votes for five
/// times as many planes, and those sought are long.
const VOTERS: usize = 1200;
const LATER_VOTERS: usize = 600;
const MIN_VOTES: u16 = 8;
/// Half the width of the strip of returns that belong to a plane.
const STRIP_M: f32 = 0.1;
/// Within 16 degrees of head-on: a clean pane's glint.
const HEAD_ON: usize = 8;
/// Planes taken from each round.
const EACH_ROUND: usize = 4;

/// A vertical plane: `cos * x + sin * y = distance`, upright and relative to the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub(crate) cos: f32,
    pub(crate) sin: f32,
    pub(crate) distance: f32,
}

impl Line {
    fn offset(&self, [x, y]: [f32; 2]) -> f32 {
        self.cos * x + self.sin * y - self.distance
    }
}

/// Finds candidate planes. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct PaneSearch {
    directions: Vec<[f32; 2]>,
    votes: Vec<u16>,
    weak: Vec<[f32; 2]>,
    voters: Vec<[f32; 2]>,
    pub(crate) found: Vec<Line>,
}

impl PaneSearch {
    /// Searches among `weak`, horizontal positions relative to the sensor; answers in `found`.
    pub(crate) fn search(&mut self, weak: impl Iterator<Item = [f32; 2]>) {
        if self.directions.is_empty() {
            // Thrice around, so that no reach from the middle round leaves the table.
            self.directions.extend((0..3 * DIRECTIONS).map(|i| {
                let angle = i as f32 * STEP_RAD;
                [libm::cosf(angle), libm::sinf(angle)]
            }));
            self.found.reserve(2 * EACH_ROUND);
        }
        self.weak.clear();
        self.weak.extend(weak);
        self.found.clear();
        self.round(HEAD_ON, VOTERS);
        self.round(DIRECTIONS / 4, LATER_VOTERS);
    }

    fn round(&mut self, reach: usize, voters: usize) {
        let step = self.weak.len().div_ceil(voters).max(1);
        self.voters.clear();
        self.voters.extend(self.weak.iter().step_by(step));
        self.votes.clear();
        self.votes.resize(DIRECTIONS * DISTANCES, 0);
        for voter in 0..self.voters.len() {
            self.vote(self.voters[voter], reach, 1);
        }
        for _ in 0..EACH_ROUND {
            let Some(line) = self.peak().and_then(|line| self.refine(line)) else {
                return;
            };
            let mut left = self.voters.len();
            let mut at = 0;
            while at < left {
                if line.offset(self.voters[at]).abs() < STRIP_M {
                    let voter = self.voters[at];
                    self.vote(voter, reach, u16::MAX);
                    left -= 1;
                    self.voters.swap(at, left);
                } else {
                    at += 1;
                }
            }
            self.voters.truncate(left);
            let is_new = |other: &Line| {
                other.cos * line.cos + other.sin * line.sin < 0.999
                    || (other.distance - line.distance).abs() > STRIP_M
            };
            if self.found.iter().all(is_new) {
                self.found.push(line);
            }
        }
    }

    /// Adds `weight` (wrapping, so that `u16::MAX` takes a vote back) to all planes through a
    /// position whose direction is within `reach` steps of the position's own.
    fn vote(&mut self, [x, y]: [f32; 2], reach: usize, weight: u16) {
        let own = (libm::atan2f(y, x) / STEP_RAD) as i32 + DIRECTIONS as i32;
        // Between half a turn and one and a half turns; NaN is 0 as a whole number.
        let own = own.clamp(DIRECTIONS as i32 / 2, 2 * DIRECTIONS as i32) as usize;
        for turned in own - reach..=own + reach {
            let [cos, sin] = self.directions[turned];
            let direction = match turned / DIRECTIONS {
                0 => turned,
                1 => turned - DIRECTIONS,
                _ => turned - 2 * DIRECTIONS,
            };
            let distance = cos * x + sin * y;
            if distance < NEAREST_M {
                continue;
            }
            let bin = (distance / DISTANCE_STEP_M) as usize;
            if bin < DISTANCES {
                let slot = &mut self.votes[direction * DISTANCES + bin];
                *slot = slot.wrapping_add(weight);
            }
        }
    }

    fn peak(&self) -> Option<Line> {
        let most = self.votes.iter().copied().max()?;
        if most < MIN_VOTES {
            return None;
        }
        let at = self.votes.iter().position(|v| *v == most)?;
        let [cos, sin] = self.directions[at / DISTANCES];
        Some(Line {
            cos,
            sin,
            distance: ((at % DISTANCES) as f32 + 0.5) * DISTANCE_STEP_M,
        })
    }

    /// Least squares on the weak returns in the strip around the line, twice.
    fn refine(&self, mut line: Line) -> Option<Line> {
        for _ in 0..2 {
            let strip = || {
                self.weak
                    .iter()
                    .filter(|p| line.offset(**p).abs() < STRIP_M)
            };
            let count = strip().count() as f32;
            if count < f32::from(MIN_VOTES) {
                return None;
            }
            let mean = strip().fold([0.0; 2], |m, p| [m[0] + p[0] / count, m[1] + p[1] / count]);
            let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
            for p in strip() {
                let (x, y) = (p[0] - mean[0], p[1] - mean[1]);
                xx += x * x;
                xy += x * y;
                yy += y * y;
            }
            // Along the largest spread, at half the angle of (xx - yy, 2 xy); the normal is across.
            let (difference, twice) = (xx - yy, 2.0 * xy);
            let length = norm([difference, twice, 0.0]);
            if !(length > 0.0 && length.is_finite()) {
                return None;
            }
            let along_x = sqrt((0.5 * (1.0 + difference / length)).max(0.0));
            let along_y = sqrt((0.5 * (1.0 - difference / length)).max(0.0));
            let along_y = if twice < 0.0 { -along_y } else { along_y };
            let (cos, sin) = (-along_y, along_x);
            let distance = cos * mean[0] + sin * mean[1];
            let sign = if distance < 0.0 { -1.0 } else { 1.0 };
            line = Line {
                cos: cos * sign,
                sin: sin * sign,
                distance: distance * sign,
            };
        }
        (line.distance >= NEAREST_M).then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_glint_and_a_long_dark_wall_are_both_found() {
        // A pane 1.5 m to the left, turned by 20 degrees, seen 0.3 m around its foot; a dark wall
        // 6 m ahead, 8 m long.
        let turn = 20f32.to_radians();
        let (sin, cos) = (90f32.to_radians() + turn).sin_cos();
        let glint = (0..40).map(|i| {
            let along = i as f32 * 0.015 - 0.3;
            [1.5 * cos - along * sin, 1.5 * sin + along * cos]
        });
        let wall = (0..800).map(|i| [6.0, i as f32 * 0.01 - 4.0]);
        let mut search = PaneSearch::default();
        search.search(glint.chain(wall));
        let has = |cos: f32, sin: f32, distance: f32| {
            search.found.iter().any(|line| {
                line.cos * cos + line.sin * sin > 0.9999 && (line.distance - distance).abs() < 0.01
            })
        };
        assert!(
            has(cos, sin, 1.5) && has(1.0, 0.0, 6.0),
            "{:?}",
            search.found
        );
    }
}
