//! From place to place, round after round.
//!
//! In: places on the map, and where the robot is. Out: a wish for the gate, alive for a fifth of a
//! second. It knows nothing of obstacles: the gate stops it before them, and it goes on when the
//! way is free.

use hachi_hal::{BaseAction, BaseCommand, BodyVelocity, Pose, Stamp};
use serde::{Deserialize, Serialize};

/// How it goes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PatrolConfig {
    /// Places on the map, m; fewer than two are no patrol.
    pub places: Vec<[f64; 2]>,
    /// Whether it begins anew after the last place.
    pub repeat: bool,
    /// Speed along straight stretches, m/s.
    pub speed_m_per_s: f64,
    /// A place is reached when the robot is this near, m.
    pub reach_m: f64,
}

impl Default for PatrolConfig {
    fn default() -> Self {
        Self {
            places: Vec::new(),
            repeat: true,
            speed_m_per_s: 0.6,
            reach_m: 0.4,
        }
    }
}

/// Where the robot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceEstimate {
    /// When.
    pub stamp: Stamp,
    /// Where.
    pub map_from_base: Pose,
    /// Whether to be trusted.
    pub trusted: bool,
}

/// A wish lives this long, ns: two scans of a LiDAR.
const LIVES_NS: i64 = 200_000_000;

/// Turn per angle off the way, 1/s.
const TURN_GAIN: f64 = 1.8;

/// Farther off the way than this it turns on the spot, rad: 45 degrees.
const TURN_ON_THE_SPOT_RAD: f64 = 0.8;

/// The patrol.
#[derive(Debug, Clone)]
pub struct Patrol {
    config: PatrolConfig,
    next: usize,
    rounds: u32,
}

impl Patrol {
    /// Begins with the first place.
    pub fn new(config: PatrolConfig) -> Self {
        Self {
            config,
            next: 0,
            rounds: 0,
        }
    }

    /// The place it goes to; `None` when it is done.
    pub fn goal(&self) -> Option<[f64; 2]> {
        self.config.places.get(self.next).copied()
    }

    /// Rounds that are done.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// What it wishes for at `now`; nothing where the place is unknown or all places were reached.
    pub fn step(&mut self, now: Stamp, place: &PlaceEstimate) -> Option<BaseCommand> {
        if !place.trusted {
            return None;
        }
        let at = place.map_from_base.translation.vector;
        let mut goal = self.goal()?;
        if (goal[0] - at.x).hypot(goal[1] - at.y) < self.config.reach_m {
            self.reached();
            goal = self.goal()?;
        }
        let ahead = place.map_from_base.rotation * hachi_hal::Vector3::x();
        let way = (goal[1] - at.y).atan2(goal[0] - at.x);
        let off = wrapped(way - ahead.y.atan2(ahead.x));
        let forward = match off.abs() < TURN_ON_THE_SPOT_RAD {
            true => self.config.speed_m_per_s * off.cos().powi(2),
            false => 0.0,
        };
        Some(BaseCommand {
            stamp: now,
            time_to_live_ns: LIVES_NS,
            action: BaseAction::Move(BodyVelocity {
                forward,
                left: 0.0,
                yaw_rate: TURN_GAIN * off,
            }),
        })
    }

    fn reached(&mut self) {
        self.next += 1;
        if self.next >= self.config.places.len() {
            self.rounds += 1;
            if self.config.repeat && self.config.places.len() > 1 {
                self.next = 0;
            }
        }
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}
