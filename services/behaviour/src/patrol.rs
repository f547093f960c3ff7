//! From place to place, round after round.
//!
//! In: places on the map, where the robot is, and what stands around. Out: a wish for the gate, alive
//! for a fifth of a second. The way past things is `passage`'s; a place that can't be reached is left
//! out after a while.

use hachi_hal::{BaseAction, BaseCommand, Pose, Stamp};
use serde::{Deserialize, Serialize};

use crate::config::SafetyConfig;
use crate::obstacles::Obstacles;
use crate::passage::{Passage, Step, Way, wrapped};

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
    /// After so long before something that stands in the way it goes on to the next place, s.
    pub blocked_s: f64,
}

impl Default for PatrolConfig {
    fn default() -> Self {
        Self {
            places: Vec::new(),
            repeat: true,
            speed_m_per_s: 0.6,
            reach_m: 0.4,
            blocked_s: 20.0,
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

/// So much nearer to a place is a step forward, m.
const NEARER_M: f64 = 0.1;

/// The longest time between two steps that counts as waited, s: a pause is none.
const LONGEST_STEP_S: f64 = 0.2;

/// The patrol.
#[derive(Debug, Clone)]
pub struct Patrol {
    config: PatrolConfig,
    passage: Passage,
    next: usize,
    rounds: u32,
    stepped: Option<Stamp>,
    /// The nearest that it came to the place it goes to, m.
    nearest_m: f64,
    /// How long it has been held up since, s.
    held_up_s: f64,
    blocked: Option<usize>,
}

impl Patrol {
    /// Begins with the first place.
    pub fn new(config: PatrolConfig, safety: SafetyConfig) -> Self {
        Self {
            config,
            passage: Passage::new(safety),
            next: 0,
            rounds: 0,
            stepped: None,
            nearest_m: f64::INFINITY,
            held_up_s: 0.0,
            blocked: None,
        }
    }

    /// The place it goes to; `None` when it is done.
    pub fn goal(&self) -> Option<[f64; 2]> {
        self.config.places.get(self.next).copied()
    }

    /// Which place that is, from 0.
    pub fn next(&self) -> usize {
        self.next
    }

    /// Rounds that are done.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// The last place, from 0, that it went on from because the way was blocked; nothing once it has
    /// reached one again.
    pub fn blocked(&self) -> Option<usize> {
        self.blocked
    }

    /// What it wishes for at `now`; nothing where the place is unknown or all places were reached.
    pub fn step(
        &mut self,
        now: Stamp,
        place: &PlaceEstimate,
        obstacles: &Obstacles,
    ) -> Option<BaseCommand> {
        let passed_s = self.stepped.map_or(0.0, |last| now.secs_since(last));
        self.stepped = Some(now);
        if !place.trusted {
            return None;
        }
        let mut way = self.way(place)?;
        if way.far_m < self.config.reach_m {
            self.blocked = None;
            self.go_on();
            way = self.way(place)?;
        }
        let step = self.passage.step(&way, obstacles);
        if self.is_held_up(&way, &step, passed_s.clamp(0.0, LONGEST_STEP_S)) {
            self.blocked = Some(self.next);
            self.go_on();
        }
        Some(BaseCommand {
            stamp: now,
            time_to_live_ns: LIVES_NS,
            action: BaseAction::Move(step.velocity),
        })
    }

    fn way(&self, place: &PlaceEstimate) -> Option<Way> {
        let goal = self.goal()?;
        let at = place.map_from_base.translation.vector;
        let ahead = place.map_from_base.rotation * hachi_hal::Vector3::x();
        let off = [goal[0] - at.x, goal[1] - at.y];
        Some(Way {
            bearing_rad: wrapped(off[1].atan2(off[0]) - ahead.y.atan2(ahead.x)),
            far_m: off[0].hypot(off[1]),
            speed_m_per_s: self.config.speed_m_per_s,
        })
    }

    /// Whether things have stood in the way for too long. Only time before them counts: a robot
    /// that stands for another reason is not held up.
    fn is_held_up(&mut self, way: &Way, step: &Step, passed_s: f64) -> bool {
        if way.far_m < self.nearest_m - NEARER_M {
            self.nearest_m = way.far_m;
            self.held_up_s = 0.0;
        }
        if step.hindered {
            self.held_up_s += passed_s;
        }
        self.held_up_s > self.config.blocked_s
    }

    fn go_on(&mut self) {
        (self.nearest_m, self.held_up_s) = (f64::INFINITY, 0.0);
        self.next += 1;
        if self.next >= self.config.places.len() {
            self.rounds += 1;
            if self.config.repeat && self.config.places.len() > 1 {
                self.next = 0;
            }
        }
    }
}
