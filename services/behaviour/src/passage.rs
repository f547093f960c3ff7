//! A way past what stands around: through a door, beside a chair.
//!
//! In: where a behaviour wants to go, and what stands around, base frame. Out: a velocity that the
//! gate will most likely let pass, and whether there is one. The gate has the last word, and nothing
//! here makes it milder.
//!
//! A lane is a straight strip as wide as the robot with its margins. Where the lane towards the goal
//! is not free, lanes in directions and offsets around it are looked at; the robot turns into the
//! nearest free one, steps sideways into its middle, and only then walks on. A door is a gap that a
//! lane fits through. Where there is no room to turn round, it walks out backwards.

use std::f64::consts::PI;
use std::ops::Range;

use hachi_hal::BodyVelocity;

use crate::config::SafetyConfig;
use crate::obstacles::Obstacles;
use crate::swept::free_share;

/// Where to go, as seen from the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Off the heading, rad, positive to the left.
    pub bearing_rad: f64,
    /// How far, m.
    pub far_m: f64,
    /// How fast along straight stretches, m/s.
    pub speed_m_per_s: f64,
}

/// What is wished for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The velocity.
    pub velocity: BodyVelocity,
    /// Whether things that stand around ask for something else than straight on.
    pub hindered: bool,
}

/// Turn per angle off the way, 1/s.
const TURN_GAIN: f64 = 1.8;
/// Farther off the way than this it turns on the spot, rad: 45 degrees.
const TURN_ON_THE_SPOT_RAD: f64 = 0.8;
/// Sideways speed per offset, 1/s.
const SIDEWAYS_GAIN: f64 = 1.5;

/// Directions that are tried to either side of the goal's, and from one to the next, rad.
const DIRECTIONS: i32 = 16;
const DIRECTION_RAD: f64 = 0.035;
/// Offsets that are tried to either side, and from one to the next, m.
const OFFSETS: usize = 60;
const OFFSET_M: f64 = 0.01;
/// Offsets of one direction.
const LANES: usize = 2 * OFFSETS + 1;

/// How far ahead a lane has to be free, m: less than a room is deep.
const AHEAD_M: f64 = 1.2;
/// The room that is kept to both sides of a lane where there is as much, m.
const SPARE_M: f64 = 0.1;
/// What stands beside the robot is kept off by the gate; a lane minds it only where it would be
/// touched, m.
const BESIDE_M: f64 = 0.05;
/// In a narrow lane the robot turns to its direction before it walks, rad.
const TURNED_RAD: f64 = 0.06;

/// A goal at these bearings is neither before the robot nor behind it, rad: 60 to 110 degrees.
const ABREAST_RAD: Range<f64> = 1.05..1.9;
/// It turns round again where it has this much more room than it needs, m.
const TURNING_SPARE_M: f64 = 0.03;

/// What moves less than this, m/s or rad/s, stands.
const SLOWEST: f64 = 0.02;

/// A free strip: its direction off the heading, the offset to its middle part, and how far beside
/// the robot's own strip it begins (0 where the robot is in it).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Lane {
    direction_rad: f64,
    offset_m: f64,
    beside_m: f64,
    room_m: f64,
}

/// Finds ways past things. Keeps only whether it walks backwards.
#[derive(Debug, Clone)]
pub struct Passage {
    config: SafetyConfig,
    backwards: bool,
}

impl Passage {
    /// For a robot of this size with these limits.
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            config,
            backwards: false,
        }
    }

    /// The velocity towards `way` among `obstacles`.
    pub fn step(&mut self, way: &Way, obstacles: &Obstacles) -> Step {
        // A goal that lies abreast must not change the way it faces again and again.
        let (behind_rad, spare_m) = match self.backwards {
            true => (ABREAST_RAD.start, TURNING_SPARE_M),
            false => (ABREAST_RAD.end, 0.0),
        };
        let behind = way.bearing_rad.abs() > behind_rad;
        self.backwards = behind && !self.can_turn_round(spare_m, obstacles);
        let velocity = match self.backwards {
            // The robot's outline is the same both ways round.
            true => {
                let way = Way {
                    bearing_rad: wrapped(way.bearing_rad + PI),
                    speed_m_per_s: way.speed_m_per_s.min(self.config.backward_m_per_s),
                    ..*way
                };
                let v = self.towards(&way, obstacles, -1.0);
                BodyVelocity {
                    forward: -v.forward,
                    left: -v.left,
                    yaw_rate: v.yaw_rate,
                }
            }
            false => self.towards(way, obstacles, 1.0),
        };
        let part = self.free_part(velocity, obstacles);
        Step {
            velocity: part.unwrap_or(velocity),
            hindered: part != Some(self.pursue(way.bearing_rad, way.speed_m_per_s)),
        }
    }

    /// Whether it can turn on the spot all the way round.
    fn can_turn_round(&self, spare_m: f64, obstacles: &Obstacles) -> bool {
        let radius = self.turning_radius_m() + spare_m;
        let away = |[x, y]: &[f32; 2]| f64::from(*x).hypot(f64::from(*y)) >= radius;
        obstacles.places().iter().all(away)
    }

    /// Into the best lane and along it; straight on where there is none. `facing` is -1 for a robot
    /// that walks backwards.
    fn towards(&self, way: &Way, obstacles: &Obstacles, facing: f64) -> BodyVelocity {
        let Some(lane) = self.best_lane(way, obstacles, facing) else {
            return self.pursue(way.bearing_rad, way.speed_m_per_s);
        };
        let narrow = lane.room_m < 2.0 * SPARE_M;
        if lane.offset_m == 0.0 && !narrow {
            return self.pursue(lane.direction_rad, way.speed_m_per_s);
        }
        let most = self.config.sideways_m_per_s;
        let sideways = (SIDEWAYS_GAIN * lane.offset_m).clamp(-most, most);
        let along = match lane.beside_m == 0.0 && lane.direction_rad.abs() < TURNED_RAD {
            true => way.speed_m_per_s,
            false => 0.0,
        };
        let (sin, cos) = lane.direction_rad.sin_cos();
        BodyVelocity {
            forward: along * cos - sideways * sin,
            left: along * sin + sideways * cos,
            yaw_rate: self.turn(lane.direction_rad),
        }
    }

    /// The free lane that asks least of the robot.
    fn best_lane(&self, way: &Way, obstacles: &Obstacles, facing: f64) -> Option<Lane> {
        let mut best: Option<(f64, Lane)> = None;
        for k in -DIRECTIONS..=DIRECTIONS {
            let off = f64::from(k) * DIRECTION_RAD;
            let direction = wrapped(way.bearing_rad + off);
            let taken = self.taken(direction, way.far_m, obstacles, facing);
            for lane in free_lanes(direction, &taken) {
                // A metre aside is as much as a radian; a tight fit is worse than either.
                let tight = (2.0 * SPARE_M - lane.room_m).max(0.0);
                let cost = off.abs() + lane.offset_m.abs() + 5.0 * tight;
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, lane));
                }
            }
        }
        best.map(|(_, lane)| lane)
    }

    /// The offsets at which something stands in a lane in this direction.
    fn taken(
        &self,
        direction: f64,
        far_m: f64,
        obstacles: &Obstacles,
        facing: f64,
    ) -> [bool; LANES] {
        let config = &self.config;
        let (sin, cos) = direction.sin_cos();
        let ends_m = config.half_length_m + config.margin_m + far_m.min(AHEAD_M);
        let mut steps = [0i16; LANES + 1];
        for [x, y] in obstacles.places() {
            let (x, y) = (facing * f64::from(*x), facing * f64::from(*y));
            let (ahead, aside) = (x * cos + y * sin, y * cos - x * sin);
            if ahead < -config.half_length_m || ahead > ends_m {
                continue;
            }
            let keep = match ahead > config.half_length_m {
                true => config.half_width_m + config.margin_m,
                false => config.half_width_m + BESIDE_M,
            };
            let cell = |offset: f64| offset / OFFSET_M + OFFSETS as f64;
            let from = cell(aside - keep).floor() + 1.0;
            let to = cell(aside + keep).ceil();
            if to > 0.0 && from < LANES as f64 {
                steps[from.max(0.0) as usize] += 1;
                steps[(to as usize).min(LANES)] -= 1;
            }
        }
        let mut there = 0;
        std::array::from_fn(|cell| {
            there += steps[cell];
            there > 0
        })
    }

    /// What of a velocity the gate will let pass: all of it, or a part that makes room for the rest.
    fn free_part(&self, velocity: BodyVelocity, obstacles: &Obstacles) -> Option<BodyVelocity> {
        let BodyVelocity {
            forward,
            left,
            yaw_rate,
        } = velocity;
        let part = |forward, left, yaw_rate| BodyVelocity {
            forward,
            left,
            yaw_rate,
        };
        let passes = |v: &BodyVelocity| {
            let moves = v.forward.hypot(v.left) > SLOWEST || v.yaw_rate.abs() > SLOWEST;
            moves && free_share(v, obstacles, &self.config) > 0.0
        };
        let parts = [
            velocity,
            part(forward, left, 0.0),
            part(forward, 0.0, 0.0),
            part(0.0, 0.0, yaw_rate),
            part(0.0, left, 0.0),
            self.room_to_turn(obstacles),
        ];
        parts.into_iter().find(passes)
    }

    /// Away from what is too near to turn, if that is on one side.
    fn room_to_turn(&self, obstacles: &Obstacles) -> BodyVelocity {
        let radius = self.turning_radius_m();
        let mut away = [0.0; 2];
        for [x, y] in obstacles.places() {
            let (x, y) = (f64::from(*x), f64::from(*y));
            let range = x.hypot(y);
            if range < radius && range > 0.0 {
                let share = (radius - range) / range;
                away = [away[0] - share * x, away[1] - share * y];
            }
        }
        let length = away[0].hypot(away[1]);
        let speed = match length > SLOWEST {
            true => self.config.sideways_m_per_s / length,
            false => 0.0,
        };
        BodyVelocity {
            forward: speed * away[0],
            left: speed * away[1],
            yaw_rate: 0.0,
        }
    }

    /// What it keeps free around its middle to turn all the way round.
    fn turning_radius_m(&self) -> f64 {
        let config = &self.config;
        config.half_length_m.hypot(config.half_width_m) + config.margin_m
    }

    /// Towards a bearing with nothing in the way.
    fn pursue(&self, bearing_rad: f64, speed_m_per_s: f64) -> BodyVelocity {
        let forward = match bearing_rad.abs() < TURN_ON_THE_SPOT_RAD {
            true => speed_m_per_s * bearing_rad.cos().powi(2),
            false => 0.0,
        };
        BodyVelocity {
            forward,
            left: 0.0,
            yaw_rate: self.turn(bearing_rad),
        }
    }

    fn turn(&self, angle: f64) -> f64 {
        let most = self.config.turn_rad_per_s;
        (TURN_GAIN * angle).clamp(-most, most)
    }
}

/// The runs of free offsets.
fn free_lanes(direction_rad: f64, taken: &[bool; LANES]) -> impl Iterator<Item = Lane> {
    let mut cell = 0;
    std::iter::from_fn(move || {
        while cell < LANES && taken[cell] {
            cell += 1;
        }
        let from = cell;
        while cell < LANES && !taken[cell] {
            cell += 1;
        }
        let offset = |cell: usize| (cell as f64 - OFFSETS as f64) * OFFSET_M;
        (from < cell).then(|| {
            let (low, high) = (offset(from), offset(cell - 1));
            let spare = SPARE_M.min(0.5 * (high - low));
            // What lies beyond the last offset is not known to be taken.
            let inner = |edge: bool| match edge {
                true => 0.0,
                false => spare,
            };
            let low_inner = low + inner(from == 0);
            let high_inner = high - inner(cell == LANES);
            Lane {
                direction_rad,
                offset_m: 0.0f64.clamp(low_inner, high_inner.max(low_inner)),
                beside_m: 0.0f64.clamp(low, high).abs(),
                room_m: high - low,
            }
        })
    })
}

pub(crate) fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::TAU;
    (angle + PI).rem_euclid(TAU) - PI
}
