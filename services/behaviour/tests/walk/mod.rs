//! A robot that walks behind the gate, the faults that stop it, and what `docs/safety.md` states of
//! them: for the tests, and for the example that prints what they measure.
#![allow(dead_code, reason = "each user has its own part of this")]

pub mod faults;
pub mod page;

use hachi_behaviour::{Cause, Obstacles, SafetyConfig, SafetyGate, Sight, Verdict};
use hachi_hal::{BaseAction, BaseCommand, BodyVelocity, Stamp, StopSample};

pub const MS: i64 = 1_000_000;
pub const STEP_MS: i64 = 10;

/// A robot that walks at full speed, all sensors in order; a test breaks something.
pub struct Walk {
    pub gate: SafetyGate,
    pub now: Stamp,
    pub sight: Sight,
    pub obstacles: Obstacles,
    pub wish: Option<BaseCommand>,
    /// What it is wished to do while a fault is measured.
    pub action: BaseAction,
    /// Where a person is seen at each step, base frame.
    pub person: Option<[f64; 2]>,
    /// What is refreshed with each step.
    pub live: Live,
    /// Metres gone.
    pub gone: f64,
}

#[derive(Clone, Copy)]
pub struct Live {
    pub localisation: bool,
    pub lidar: bool,
    pub camera: bool,
    pub event_loop: bool,
    pub robot: bool,
    pub stop: bool,
    pub wish: bool,
}

const ALL: Live = Live {
    localisation: true,
    lidar: true,
    camera: true,
    event_loop: true,
    robot: true,
    stop: true,
    wish: true,
};

pub fn forward(speed: f64) -> BaseAction {
    BaseAction::Move(BodyVelocity {
        forward: speed,
        ..BodyVelocity::ZERO
    })
}

impl Walk {
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            gate: SafetyGate::new(config),
            now: Stamp::from_nanos(1_000_000 * MS),
            sight: Sight::default(),
            obstacles: Obstacles::none(Stamp::default()),
            wish: None,
            action: forward(config.forward_m_per_s),
            person: None,
            live: ALL,
            gone: 0.0,
        }
    }

    /// Two seconds at the wish for full speed.
    pub fn at_full_speed(config: SafetyConfig) -> Self {
        let mut walk = Self::new(config);
        for _ in 0..200 {
            walk.step(forward(config.forward_m_per_s));
        }
        assert_eq!(walk.speed(), config.forward_m_per_s);
        walk
    }

    pub fn step(&mut self, action: BaseAction) -> Verdict {
        self.now = self.now + STEP_MS * MS;
        let now = Some(self.now);
        let (sight, live) = (&mut self.sight, self.live);
        if live.localisation {
            sight.localisation = now.map(|at| (at, true));
        }
        if live.lidar {
            self.obstacles.stamp = self.now;
        }
        sight.camera = if live.camera { now } else { sight.camera };
        sight.event_loop = if live.event_loop {
            now
        } else {
            sight.event_loop
        };
        sight.robot = if live.robot { now } else { sight.robot };
        if live.stop {
            let pressed = sight.emergency_stop.is_some_and(|s| s.pressed);
            sight.emergency_stop = now.map(|stamp| StopSample { stamp, pressed });
        }
        if live.wish {
            self.wish = Some(BaseCommand {
                stamp: self.now,
                time_to_live_ns: 200 * MS,
                action,
            });
        }
        if let Some(place) = self.person {
            sight.person = now.map(|at| (at, place));
        }
        let verdict = self.gate.step(
            self.now,
            self.wish.as_ref(),
            &self.sight,
            Some(&self.obstacles),
        );
        self.gone += verdict.velocity().forward * STEP_MS as f64 * 1e-3;
        verdict
    }

    pub fn speed(&mut self) -> f64 {
        let last = match self.wish {
            Some(wish) => wish.action,
            None => BaseAction::Stop,
        };
        self.step(last).velocity().forward
    }

    /// Milliseconds until the velocity is zero for `cause`; it stays so.
    #[track_caller]
    pub fn stops_after_ms(&mut self, cause: Cause) -> i64 {
        let mut stopped_after = None;
        for ms in (STEP_MS..=2_000).step_by(STEP_MS as usize) {
            let verdict = self.step(self.action);
            if verdict.velocity().is_zero() && stopped_after.is_none() {
                assert!(verdict.causes.has(cause), "stands for {}", verdict.causes);
                stopped_after = Some(ms);
            }
            if stopped_after.is_some() {
                assert!(verdict.velocity().is_zero(), "and stays so");
            }
        }
        stopped_after.expect("it stops")
    }
}
