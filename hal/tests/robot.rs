//! The checks of legs, base, battery and emergency stop accept what keeps its promise and name how
//! the others break it.
#![cfg(all(feature = "mock", feature = "conformance"))]

use std::cell::Cell;

use hachi_hal::conformance::{
    BaseViolation, GripperViolation, Violation, check_base_drive, check_battery,
    check_emergency_stop, check_gripper, check_legs,
};
use hachi_hal::mock::{
    MockBase, MockBattery, MockEmergencyStop, MockGripper, MockGripperError, MockLegs,
    MockWatchdog, Step,
};
use hachi_hal::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, BatterySample, BodyVelocity, Clock, FaultKind,
    Gripper, GripperCommand, GripperSample, LegState, Stamp, StopSample, Vector3, Watchdog,
};

struct Ticking(Cell<i64>);

impl Clock for Ticking {
    fn now(&self) -> Stamp {
        self.0.set(self.0.get() + 1);
        Stamp::from_nanos(self.0.get())
    }
}

fn clock() -> Ticking {
    Ticking(Cell::new(0))
}

fn legs(at: i64, speed: f64) -> Step<LegState> {
    Step::Batch(LegState {
        stamp: Stamp::from_nanos(at),
        angles: [Vector3::new(0.0, 0.9, -1.8); 4],
        speeds: [Vector3::new(0.0, speed, 0.0); 4],
        torques: [Vector3::zeros(); 4],
        foot_forces: [100.0; 4],
    })
}

#[test]
fn legs_that_go_back_in_time_or_report_no_number_are_refused() {
    let run = |script: &[Step<LegState>]| check_legs(&mut MockLegs::script(script), &clock(), 3, 9);
    let fine = run(&[
        legs(1, 0.0),
        Step::Fault(FaultKind::ReadAgain),
        legs(2, 0.1),
    ])
    .unwrap();
    assert_eq!((fine.items, fine.faults), (2, 1));
    let back = Violation::StampNotIncreasing {
        before: Stamp::from_nanos(2),
        stamp: Stamp::from_nanos(1),
    };
    assert_eq!(run(&[legs(2, 0.0), legs(1, 0.0)]), Err(back));
    let stamp = Stamp::from_nanos(4);
    assert_eq!(
        run(&[legs(4, f64::NAN)]),
        Err(Violation::SampleNotFinite { stamp })
    );
}

#[test]
fn a_battery_with_more_than_all_its_charge_is_refused() {
    let sample = |at, charge| {
        Step::Batch(BatterySample {
            stamp: Stamp::from_nanos(at),
            charge,
            voltage: 25.0,
            current: -3.0,
            temperature_c: 31.0,
            lowest_cell: 4.1,
            cycles: 12,
        })
    };
    let run = |charge| {
        let script = [sample(1, 0.5), sample(2, charge)];
        check_battery(&mut MockBattery::script(script), &clock(), 2, 9)
    };
    assert_eq!(run(1.0).unwrap().items, 2);
    let stamp = Stamp::from_nanos(2);
    assert_eq!(run(1.01), Err(Violation::SampleNotFinite { stamp }));
}

#[test]
fn an_emergency_stop_is_read_in_order() {
    let sample = |at, pressed| {
        Step::Batch(StopSample {
            stamp: Stamp::from_nanos(at),
            pressed,
        })
    };
    let script = [sample(1, false), Step::Nothing, sample(3, true)];
    let mut stop = MockEmergencyStop::script(script);
    let tally = check_emergency_stop(&mut stop, &clock(), 3, 9).unwrap();
    assert_eq!((tally.items, tally.nothing), (2, 1));
    stop.assert_done();
}

#[test]
fn the_mock_base_keeps_the_promise_and_remembers_its_last_moves() {
    let mut base = MockBase::<4>::new();
    check_base_drive(&mut base, Stamp::from_nanos(7_000_000_000)).unwrap();
    assert_eq!(base.moves().count(), 4);
    assert!(base.moves().last().unwrap().velocity.is_zero());
    let asked = base.last_command().unwrap().action;
    assert!(matches!(asked, BaseAction::Move(v) if v.forward == 1e6));
}

/// A base that forgets what the promise is about.
struct Careless {
    inner: MockBase<1>,
    last: BodyVelocity,
}

impl BaseDrive for Careless {
    type Error = <MockBase<1> as BaseDrive>::Error;

    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), Self::Error> {
        if let BaseAction::Move(velocity) = command.action {
            self.last = velocity;
        }
        self.inner.command(command, now)
    }

    fn service(&mut self, now: Stamp) -> Result<BaseStatus, Self::Error> {
        let status = self.inner.service(now)?;
        Ok(BaseStatus {
            velocity: self.last,
            expired: false,
            ..status
        })
    }
}

#[test]
fn a_base_that_goes_on_after_its_command_died_is_found_out() {
    let mut base = Careless {
        inner: MockBase::new(),
        last: BodyVelocity::ZERO,
    };
    let result = check_base_drive(&mut base, Stamp::default());
    assert!(
        matches!(result, Err(BaseViolation::WrongMove { expected, .. }) if expected.is_zero()),
        "{result:?}"
    );
}

#[test]
fn a_watchdog_bites_only_after_its_time_without_food() {
    let mut dog = MockWatchdog::new(100);
    assert!(!dog.bites(Stamp::from_nanos(1_000)));
    dog.feed(Stamp::from_nanos(1_000)).unwrap();
    assert!(!dog.bites(Stamp::from_nanos(1_100)));
    assert!(dog.bites(Stamp::from_nanos(1_101)));
    assert_eq!(dog.timeout_ns(), 100);
}

#[test]
fn a_gripper_that_keeps_its_promise_passes() {
    check_gripper(&mut MockGripper::around(0.0), &clock(), 3, 1_000).unwrap();
}

/// A gripper that is at fault in one way.
struct Faulty {
    inner: MockGripper,
    takes_anything: bool,
    opening_m: Option<f64>,
}

impl Gripper for Faulty {
    type Error = MockGripperError;
    fn stroke_m(&self) -> f64 {
        self.inner.stroke_m()
    }
    fn activate(&mut self) -> Result<(), MockGripperError> {
        self.inner.activate()
    }
    fn command(&mut self, command: &GripperCommand) -> Result<(), MockGripperError> {
        match self.inner.command(command) {
            Err(MockGripperError::NotFinite) if self.takes_anything => Ok(()),
            answer => answer,
        }
    }
    fn stop(&mut self) -> Result<(), MockGripperError> {
        self.inner.stop()
    }
    fn read_gripper(&mut self, by: Stamp) -> Result<Option<GripperSample>, MockGripperError> {
        let sample = self.inner.read_gripper(by)?;
        Ok(sample.map(|sample| GripperSample {
            opening_m: self.opening_m.unwrap_or(sample.opening_m),
            ..sample
        }))
    }
}

#[test]
fn broken_promises_of_grippers_are_named() {
    let check = |takes_anything, opening_m, object_m| {
        let mut gripper = Faulty {
            inner: MockGripper::around(object_m),
            takes_anything,
            opening_m,
        };
        check_gripper(&mut gripper, &clock(), 3, 1_000).unwrap_err()
    };
    let took = check(true, None, 0.0);
    assert!(matches!(took, GripperViolation::TookBad(_)), "{took}");
    let outside = check(false, Some(0.1), 0.0);
    assert!(matches!(outside, GripperViolation::Opening(_)), "{outside}");
    let stuck = check(false, Some(0.04), 0.0);
    assert!(
        matches!(stuck, GripperViolation::Elsewhere { .. }),
        "{stuck}"
    );
    // It is not empty, as it must be for this check.
    let held = check(false, None, 0.02);
    assert!(matches!(held, GripperViolation::Elsewhere { .. }), "{held}");
}
