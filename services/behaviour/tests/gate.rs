//! The gate: each row of `docs/safety.md` that it answers for, by injecting the fault.

mod walk;

use hachi_behaviour::{Cause, GuardedBase, Obstacles, SafetyConfig, SafetyGate, Sight};
use hachi_hal::{BaseAction, BaseCommand, BaseDrive, BodyPosture, BodyVelocity, Stamp, StopSample};
use walk::faults::measure_ms;
use walk::page::{STATED, millis, row};
use walk::{MS, STEP_MS, Walk, forward};

/// Each fault of a row stops a robot at full speed within the time that the page states.
#[track_caller]
fn stops_as_stated(cause: &str) {
    let (after_ms, most_ms) = (measure_ms(cause), millis(row(cause)[STATED]));
    assert!(
        after_ms <= most_ms,
        "stopped after {after_ms} ms, not {most_ms}"
    );
}

#[test]
fn the_emergency_stop_wins_over_everything_at_once() {
    stops_as_stated("emergency stop pressed (remote control)");
    let mut walk = Walk::at_full_speed(SafetyConfig::default());
    walk.sight.emergency_stop = Some(StopSample {
        stamp: walk.now,
        pressed: true,
    });
    // Not even standing up.
    assert_eq!(
        walk.step(BaseAction::StandUp).command.action,
        BaseAction::Stop
    );
}

#[test]
fn a_silent_emergency_stop_is_taken_for_pressed() {
    stops_as_stated("emergency stop or its link silent");
}

#[test]
fn a_silent_robot_is_told_to_stand() {
    stops_as_stated("the robot sends nothing new");
}

#[test]
fn a_behaviour_that_dies_takes_its_command_with_it() {
    stops_as_stated("a behaviour or remote link dies");
}

#[test]
fn stale_localisation_stops_the_robot() {
    stops_as_stated("localisation stale");
}

#[test]
fn lost_localisation_stops_the_robot() {
    stops_as_stated("localisation lost");
}

#[test]
fn a_stale_lidar_stops_the_robot() {
    stops_as_stated("LiDAR stale");
}

#[test]
fn a_frozen_camera_stops_a_robot_that_needs_it_and_no_other() {
    stops_as_stated("camera frozen");
    let mut walk = Walk::at_full_speed(SafetyConfig::default());
    walk.live.camera = false;
    (0..200).for_each(|_| assert!(walk.speed() > 0.0));
}

#[test]
fn a_hanging_event_loop_stops_the_robot() {
    stops_as_stated("event loop hangs");
}

#[test]
fn a_task_that_breaks_its_promise_holds_the_robot() {
    stops_as_stated("a task with the policy `stop`");
}

#[test]
fn not_a_number_moves_nothing() {
    stops_as_stated("a number that is not finite");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut walk = Walk::at_full_speed(SafetyConfig::default());
        let turning = BodyVelocity {
            forward: 0.5,
            left: 0.0,
            yaw_rate: bad,
        };
        let verdict = walk.step(BaseAction::Move(turning));
        assert!(verdict.velocity().is_zero() && verdict.causes.has(Cause::NotFinite));
        let posture = BodyPosture {
            roll: bad,
            ..BodyPosture::default()
        };
        let verdict = walk.step(BaseAction::Pose(posture));
        assert_eq!(verdict.command.action, BaseAction::Stop);
    }
}

#[test]
fn a_clock_that_jumps_stops_the_robot_both_ways() {
    stops_as_stated("a clock jumps ahead: a behaviour's");
    // Ahead, what the sensors say is not believed; back, the wish is old.
    stops_as_stated("a clock jumps: a sensor's, or back");
}

#[test]
fn it_stands_before_a_wall_that_comes_into_sight_with_the_margin_left() {
    let config = SafetyConfig::default();
    let mut walk = Walk::at_full_speed(config);
    walk.gone = 0.0;
    let wall_m = 3.0;
    for _ in 0..800 {
        let left = wall_m - walk.gone;
        walk.obstacles = Obstacles::none(walk.now);
        for side in [-0.2f32, 0.0, 0.2] {
            assert!(walk.obstacles.add([left as f32, side]));
        }
        walk.step(forward(0.8));
    }
    let room = wall_m - walk.gone - config.half_length_m;
    assert!(room >= config.margin_m - 0.02, "{room} m left");
    assert!(
        room < config.margin_m + 0.35,
        "and comes near: {room} m left"
    );
    assert!(walk.step(forward(0.8)).causes.has(Cause::Obstacle));
    // A person with a joystick meets the same gate; away from the wall it goes.
    assert!(walk.step(forward(-0.3)).causes.is_empty());
}

#[test]
fn a_followed_person_inside_the_safety_circle_stops_the_robot() {
    stops_as_stated("the followed person is inside");
    let config = SafetyConfig::default();
    // 1.4 x 0.8 m/s x 1 s.
    assert!((config.safety_circle_m() - 1.12).abs() < 1e-12);
    let mut walk = Walk::at_full_speed(config);
    walk.sight.person = Some((walk.now, [1.2, 0.0]));
    assert!(walk.step(forward(0.8)).causes.is_empty());
    for _ in 0..60 {
        walk.sight.person = Some((walk.now, [0.9, 0.6]));
        walk.step(forward(0.8));
    }
    let verdict = walk.step(forward(0.8));
    assert!(verdict.velocity().is_zero() && verdict.causes.has(Cause::PersonNear));
    // A sighting expires.
    for _ in 0..110 {
        walk.step(forward(0.8));
    }
    assert!(walk.step(forward(0.8)).causes.is_empty());
}

#[test]
fn speed_and_its_change_keep_to_the_limits() {
    let config = SafetyConfig::default();
    let mut walk = Walk::new(config);
    let mut before = BodyVelocity::ZERO;
    let dt_s = STEP_MS as f64 * 1e-3;
    let wild = [
        (9.0, 9.0, 9.0),
        (-9.0, -9.0, -9.0),
        (0.4, 0.0, -0.2),
        (9.0, -9.0, 0.0),
    ];
    for i in 0..800 {
        let (x, y, turn) = wild[i / 100 % wild.len()];
        let verdict = walk.step(BaseAction::Move(BodyVelocity {
            forward: x,
            left: y,
            yaw_rate: turn,
        }));
        let v = verdict.velocity();
        assert_eq!(verdict.limited, x.abs() > 1.0);
        assert!((-config.backward_m_per_s..=config.forward_m_per_s).contains(&v.forward));
        assert!(v.left.abs() <= config.sideways_m_per_s);
        assert!(v.yaw_rate.abs() <= config.turn_rad_per_s);
        let braking = config.braking_m_per_s2 * dt_s + 1e-9;
        let faster = config.acceleration_m_per_s2 * dt_s + 1e-9;
        for (was, is) in [(before.forward, v.forward), (before.left, v.left)] {
            assert!((is - was).abs() <= braking);
            assert!(is.abs() - was.abs() <= faster);
        }
        let turning = config.turn_acceleration_rad_per_s2 * dt_s + 1e-9;
        assert!((v.yaw_rate - before.yaw_rate).abs() <= turning);
        before = v;
    }
    // After a pause it does not leap.
    let mut walk = Walk::new(config);
    walk.step(BaseAction::Stop);
    walk.now = walk.now + 30_000 * MS;
    assert!(
        walk.step(forward(0.8)).velocity().forward <= 0.1 * config.acceleration_m_per_s2 + 1e-9
    );
}

#[test]
fn nothing_known_moves_nothing() {
    let mut gate = SafetyGate::new(SafetyConfig::default());
    let now = Stamp::from_nanos(5_000 * MS);
    let wish = BaseCommand {
        stamp: now,
        time_to_live_ns: 200 * MS,
        action: forward(0.5),
    };
    let verdict = gate.step(now, Some(&wish), &Sight::default(), None);
    assert_eq!(verdict.command.action, BaseAction::Stop);
    for cause in [
        Cause::EmergencyStopSilent,
        Cause::RobotSilent,
        Cause::LocalisationStale,
        Cause::LidarStale,
        Cause::EventLoopStale,
    ] {
        assert!(verdict.causes.has(cause), "{cause:?}");
    }
}

/// A base that keeps what it was told.
#[derive(Default)]
struct Told(Vec<BaseCommand>);

impl BaseDrive for Told {
    type Error = std::convert::Infallible;
    fn command(&mut self, command: &BaseCommand, _: Stamp) -> Result<(), Self::Error> {
        self.0.push(*command);
        Ok(())
    }
    fn service(&mut self, now: Stamp) -> Result<hachi_hal::BaseStatus, Self::Error> {
        let last = self.0.last().filter(|c| c.is_alive(now));
        let velocity = match last.map(|c| c.action) {
            Some(BaseAction::Move(velocity)) => velocity,
            _ => BodyVelocity::ZERO,
        };
        Ok(hachi_hal::BaseStatus {
            stamp: now,
            velocity,
            expired: last.is_none(),
            saturated: false,
        })
    }
}

#[test]
fn what_a_behaviour_wishes_reaches_the_base_only_as_the_gate_lets_it() {
    let mut base = GuardedBase::new(SafetyGate::new(SafetyConfig::default()), Told::default());
    let now = Stamp::from_nanos(5_000 * MS);
    let wish = BaseCommand {
        stamp: now,
        time_to_live_ns: i64::MAX,
        action: forward(100.0),
    };
    let moved = base
        .step(now, Some(&wish), &Sight::default(), None)
        .unwrap();
    assert!(moved.status.velocity.is_zero());
    assert_eq!(moved.verdict.command.time_to_live_ns, 200 * MS);
}

#[test]
fn limits_that_cannot_work_are_refused_by_name() {
    assert_eq!(SafetyConfig::default().check(), Ok(()));
    let wrong = [
        SafetyConfig {
            forward_m_per_s: f64::NAN,
            ..SafetyConfig::default()
        },
        SafetyConfig {
            lidar_stale_s: 350.0,
            ..SafetyConfig::default()
        },
        SafetyConfig {
            half_length_m: 650.0,
            ..SafetyConfig::default()
        },
        SafetyConfig {
            turn_rad_per_s: 40.0,
            ..SafetyConfig::default()
        },
        // Eight seconds from 0.8 m/s: longer than is looked ahead.
        SafetyConfig {
            braking_m_per_s2: 0.1,
            ..SafetyConfig::default()
        },
        // Stands within a second, but farther away than obstacles are seen.
        SafetyConfig {
            forward_m_per_s: 5.0,
            braking_m_per_s2: 5.0,
            reaction_s: 0.5,
            ..SafetyConfig::default()
        },
    ];
    let keys = wrong.map(|config| config.check().unwrap_err().key);
    assert_eq!(
        keys,
        [
            "forward_m_per_s",
            "lidar_stale_s",
            "half_length_m",
            "turn_rad_per_s",
            "braking_m_per_s2",
            "braking_m_per_s2"
        ]
    );
}
