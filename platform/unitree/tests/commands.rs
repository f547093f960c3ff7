//! What a robot is told: limits by gait, the ladder of modes, and commands that die of age, in
//! virtual time.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::conformance::check_base_drive;
use hachi_hal::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, BodyPosture, BodyVelocity, CommandFault, Stamp,
};
use hachi_unitree::command::{
    CommandRefused, Commander, CommanderConfig, GaitKind, Mode, Rung, Told,
};
use hachi_unitree::frame::Model;
use hachi_unitree::{Quadruped, Span};

const STAND_BY_ITSELF: u8 = 0;
const LYING: u8 = 5;

fn at(ms: i64) -> Stamp {
    Stamp::from_nanos(1_000_000_000_000 + ms * 1_000_000)
}

fn command(ms: i64, lives_ms: i64, action: BaseAction) -> BaseCommand {
    BaseCommand {
        stamp: at(ms),
        time_to_live_ns: lives_ms * 1_000_000,
        action,
    }
}

fn walk(forward: f64, left: f64, yaw_rate: f64) -> BaseAction {
    BaseAction::Move(BodyVelocity {
        forward,
        left,
        yaw_rate,
    })
}

fn commander(robot: &Quadruped, reports: u8) -> Commander {
    let mut commander = Commander::new(robot, CommanderConfig::default()).unwrap();
    commander.reported(reports, at(0));
    commander
}

/// A commander as a base, without a robot behind it.
struct Base(Commander);

impl BaseDrive for Base {
    type Error = CommandRefused;
    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), CommandRefused> {
        self.0.command(command, now)
    }
    fn service(&mut self, now: Stamp) -> Result<BaseStatus, CommandRefused> {
        Ok(self.0.told(now).status)
    }
}

#[test]
fn a_commander_keeps_the_promise_of_a_base() {
    for robot in [GO1, B1] {
        let base = commander(&robot, STAND_BY_ITSELF);
        check_base_drive(&mut Base(base), at(0)).unwrap();
    }
}

fn limits(robot: &Quadruped, gait: GaitKind) -> Option<[(f64, f64); 3]> {
    let pair = |span: Span| (span.least, span.most);
    robot
        .limits
        .of_gait(gait)
        .map(|l| [pair(l.forward), pair(l.left), pair(l.yaw_rate)])
}

#[test]
fn velocities_are_limited_by_robot_and_gait() {
    let expected = [
        (
            GO1,
            GaitKind::Trot,
            Some([(-1.1, 1.5), (-1.0, 1.0), (-4.0, 4.0)]),
        ),
        (
            GO1,
            GaitKind::Run,
            Some([(-2.5, 3.5), (-1.0, 1.0), (-4.0, 4.0)]),
        ),
        (
            GO1,
            GaitKind::Stairs,
            Some([(-0.2, 0.25), (-0.15, 0.15), (-0.7, 0.7)]),
        ),
        (
            B1,
            GaitKind::Trot,
            Some([(-0.8, 1.2), (-0.25, 0.25), (-0.75, 0.75)]),
        ),
        (B1, GaitKind::Run, None),
        (B1, GaitKind::Stairs, None),
        (B1, GaitKind::Idle, Some([(0.0, 0.0); 3])),
    ];
    for (robot, gait, spans) in expected {
        assert_eq!(limits(&robot, gait), spans, "{} {gait:?}", robot.name());
    }
    let config = CommanderConfig {
        gait: GaitKind::Run,
        ..CommanderConfig::default()
    };
    let refused = Commander::new(&B1, config).unwrap_err();
    assert_eq!(
        refused,
        CommandRefused::NoSuchGait {
            model: Model::B1,
            gait: GaitKind::Run
        }
    );
}

#[test]
fn what_is_too_fast_is_cut_to_the_limit_and_said() {
    let mut commander = commander(&B1, STAND_BY_ITSELF);
    commander
        .command(&command(0, 100, walk(3.0, -1.0, 0.2)), at(0))
        .unwrap();
    let Told {
        command, status, ..
    } = commander.told(at(1));
    assert_eq!((command.velocity, command.yaw_speed), ([1.2, -0.25], 0.2));
    assert!(status.saturated);
    assert_eq!((command.mode, command.gait), (2, 1));
}

/// The modes that are told, each with the first millisecond at which it is.
fn modes(commander: &mut Commander, from_ms: i64, to_ms: i64) -> Vec<(i64, u8)> {
    let mut seen: Vec<(i64, u8)> = Vec::new();
    for ms in (from_ms..to_ms).step_by(2) {
        let mode = commander.told(at(ms)).command.mode;
        if seen.last().is_none_or(|(_, last)| *last != mode) {
            seen.push((ms, mode));
        }
    }
    seen
}

#[test]
fn a_lying_robot_gets_up_in_the_maker_s_order_and_time() {
    let mut commander = commander(&GO1, LYING);
    let refused = commander.command(&command(0, 100, walk(0.3, 0.0, 0.0)), at(0));
    assert_eq!(refused, Err(CommandRefused::NotStanding(Rung::Lying)));
    assert!(refused.unwrap_err().to_string().contains("StandUp"));

    // Two seconds on the ground, since nobody knows for how long it has been there.
    commander
        .command(&command(2_000, 100, BaseAction::StandUp), at(2_000))
        .unwrap();
    assert_eq!(
        modes(&mut commander, 2_000, 6_000),
        [(2_000, 6), (4_000, 1)]
    );
    commander
        .command(&command(6_000, 200, walk(0.3, 0.0, 0.0)), at(6_000))
        .unwrap();
    assert_eq!(modes(&mut commander, 6_000, 6_100), [(6_000, 2)]);
}

#[test]
fn a_walking_robot_lies_down_by_way_of_standing() {
    let mut commander = commander(&GO1, STAND_BY_ITSELF);
    commander
        .command(&command(0, 100, walk(0.3, 0.0, 0.0)), at(0))
        .unwrap();
    assert_eq!(modes(&mut commander, 0, 50), [(0, 2)]);
    commander
        .command(&command(50, 100, BaseAction::LieDown), at(50))
        .unwrap();
    assert_eq!(
        modes(&mut commander, 50, 5_000),
        [(50, 2), (550, 1), (552, 6), (2_552, 5)]
    );
    // It came to rest first: from the new command on no velocity was told.
    // It never softens its motors unless it lies, and here nobody asked.
    let refused = commander.command(&command(5_000, 100, walk(0.1, 0.0, 0.0)), at(5_000));
    assert!(matches!(refused, Err(CommandRefused::NotStanding(_))));
}

#[test]
fn after_a_command_s_death_the_robot_stops_at_once_and_then_stands() {
    let mut commander = commander(&GO1, STAND_BY_ITSELF);
    commander
        .command(&command(0, 100, walk(0.5, 0.1, 1.0)), at(0))
        .unwrap();
    let alive = commander.told(at(99));
    assert_eq!(alive.command.velocity, [0.5, 0.1]);
    let dead = commander.told(at(100));
    assert_eq!(
        (dead.command.velocity, dead.command.yaw_speed),
        ([0.0; 2], 0.0)
    );
    assert!(dead.status.expired);
    assert_eq!(dead.command.mode, 2);
    assert_eq!(modes(&mut commander, 102, 1_000), [(102, 2), (600, 1)]);
}

#[test]
fn a_robot_that_never_reported_is_told_nothing_but_hello() {
    let mut commander = Commander::new(&GO1, CommanderConfig::default()).unwrap();
    assert_eq!(commander.told(at(0)).command.mode, 0);
    let refused = commander.command(&command(0, 100, walk(0.1, 0.0, 0.0)), at(0));
    assert_eq!(refused, Err(CommandRefused::Unheard));
    assert_eq!(commander.told(at(1)).command.velocity, [0.0; 2]);
}

#[test]
fn commands_that_are_not_in_order_change_nothing() {
    let mut commander = commander(&GO1, STAND_BY_ITSELF);
    commander
        .command(&command(0, 200, walk(0.3, 0.0, 0.0)), at(0))
        .unwrap();
    let nan = commander.command(&command(10, 200, walk(f64::NAN, 0.0, 0.0)), at(10));
    assert_eq!(nan, Err(CommandFault::NotFinite.into()));
    let posture = BodyPosture {
        pitch: f64::INFINITY,
        ..BodyPosture::default()
    };
    let infinite = commander.command(&command(10, 200, BaseAction::Pose(posture)), at(10));
    assert_eq!(infinite, Err(CommandFault::NotFinite.into()));
    let old = commander.command(&command(-500, 100, walk(0.9, 0.0, 0.0)), at(10));
    let late_ns = 410_000_000;
    assert_eq!(old, Err(CommandFault::Dead { late_ns }.into()));
    let early = commander.command(&command(100, 100, walk(0.9, 0.0, 0.0)), at(10));
    let ahead_ns = 90_000_000;
    assert_eq!(early, Err(CommandFault::FromTheFuture { ahead_ns }.into()));
    assert_eq!(commander.told(at(199)).command.velocity, [0.3, 0.0]);
    assert_eq!(commander.told(at(200)).command.velocity, [0.0, 0.0]);
}

#[test]
fn a_posture_is_held_within_the_robot_s_limits() {
    let mut commander = commander(&B1, STAND_BY_ITSELF);
    let posture = BodyPosture {
        roll: 0.1,
        pitch: -0.9,
        yaw: 0.2,
        height_change_m: -0.3,
    };
    commander
        .command(&command(0, 100, BaseAction::Pose(posture)), at(0))
        .unwrap();
    let told = commander.told(at(1));
    assert_eq!(told.command.mode, 1);
    assert_eq!(told.command.euler, [0.1, -0.3, 0.2]);
    assert_eq!(told.command.body_height, -0.16);
    assert!(told.status.saturated);
    // It does not spring back when the command dies: that would be a motion nobody asked for.
    let later = commander.told(at(5_000));
    assert_eq!(
        (later.command.mode, later.command.euler),
        (1, [0.1, -0.3, 0.2])
    );
}

#[test]
fn a_robot_damped_with_the_remote_control_must_be_told_to_get_up_anew() {
    let mut commander = commander(&GO1, STAND_BY_ITSELF);
    commander
        .command(&command(0, 100, walk(0.3, 0.0, 0.0)), at(0))
        .unwrap();
    commander.told(at(1));
    // Right after the change the robot may still report its old mode.
    commander.reported(7, at(500));
    commander
        .command(&command(600, 100, walk(0.3, 0.0, 0.0)), at(600))
        .unwrap();
    commander.told(at(601));
    commander.reported(7, at(1_700));
    let refused = commander.command(&command(1_700, 100, walk(0.3, 0.0, 0.0)), at(1_700));
    assert_eq!(refused, Err(CommandRefused::NotStanding(Rung::Damped)));
    assert_eq!(commander.told(at(1_701)).command.mode, 7);
}

#[test]
fn mode_bytes_are_the_header_s() {
    for model in [Model::Go1, Model::B1] {
        for byte in 0..=255 {
            assert_eq!(Mode::of_byte(model, byte).byte(model), byte);
        }
    }
    assert_eq!(Mode::of_byte(Model::Go1, 8), Mode::Recover);
    assert_eq!(Mode::of_byte(Model::B1, 9), Mode::Recover);
    assert_eq!(Mode::of_byte(Model::Go1, 9), Mode::Other(9));
    assert_eq!(Rung::Damped.mode().byte(Model::Go1), 7);
}
