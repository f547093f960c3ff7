//! The real driver over a pseudo-terminal, with a gripper at its other end that checks every
//! request's checksum and the silence before it, and that answers late, wrongly or not at all.
#![cfg(unix)]

mod simulated;

use std::time::{Duration, Instant};

use hachi_hal::conformance::check_gripper;
use hachi_hal::{
    Clock, DeviceError, FaultKind, Grip, Gripper, GripperCommand, GripperSample, Stamp,
};
use hachi_robotiq::device::{RobotiqConfig, SerialLine};
use hachi_robotiq::{GripperError, Robotiq};
use serialport::{SerialPort, TTYPort};
use simulated::{Behaviour, Simulated};

#[derive(Clone, Copy)]
struct Running(Instant);

impl Clock for Running {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.0.elapsed().as_nanos() as i64)
    }
}

struct Harness {
    gripper: Robotiq<SerialLine, Running>,
    clock: Running,
    simulated: Simulated,
}

impl Harness {
    fn new(behaviours: Vec<Behaviour>) -> Self {
        let (simulated, port) = Simulated::start(behaviours);
        let clock = Running(Instant::now());
        let line = SerialLine::from_port(Box::new(port));
        Self {
            gripper: Robotiq::new(line, clock, RobotiqConfig::default()),
            clock,
            simulated,
        }
    }

    fn read(&mut self) -> Result<Option<GripperSample>, GripperError> {
        let deadline = self.clock.now() + 2_000_000_000;
        self.gripper.read_gripper(deadline)
    }

    /// The first report for which `done` holds.
    fn until(&mut self, done: impl Fn(&GripperSample) -> bool) -> GripperSample {
        for _ in 0..200 {
            let sample = self.read().unwrap().unwrap();
            if done(&sample) {
                return sample;
            }
        }
        panic!("it never came to that");
    }

    fn activate(&mut self) {
        self.gripper.activate().unwrap();
        self.until(|sample| sample.grip != Grip::NotReady);
    }
}

fn to(opening_m: f64) -> GripperCommand {
    GripperCommand {
        opening_m,
        speed_m_s: 0.150,
        force_n: 235.0,
    }
}

#[test]
fn it_keeps_the_promise_of_grippers() {
    let Harness {
        mut gripper,
        clock,
        simulated,
    } = Harness::new(Vec::new());
    check_gripper(&mut gripper, &clock, 200, 500_000_000).unwrap();
    assert_eq!(gripper.counters().dropped().map(|(_, n)| n).sum::<u64>(), 0);
    let seen = simulated.end(gripper);
    assert!(seen.requests > 10);
    assert_eq!(seen.damaged, 0);
    assert!(
        seen.shortest_silence >= Duration::from_micros(1_750),
        "{seen:?}"
    );
}

#[test]
fn an_object_is_felt_and_its_loss_too() {
    let mut harness = Harness::new(Vec::new());
    harness.activate();
    harness.simulated.put_object(Some(0xBD));
    harness.gripper.command(&to(0.0)).unwrap();
    let held = harness.until(|sample| sample.grip != Grip::Moving);
    assert_eq!(held.grip, Grip::Holding);
    // Between 3 (85 mm) and 230 (0 mm), 189 is 15.4 mm.
    assert!((held.opening_m - 0.0154).abs() < 1e-4, "{held:?}");
    harness.simulated.put_object(None);
    let lost = harness.until(|sample| sample.grip == Grip::Free);
    assert!(lost.opening_m < 0.001, "{lost:?}");
}

#[test]
fn it_takes_no_command_before_it_is_active_and_none_that_is_no_number() {
    let mut harness = Harness::new(Vec::new());
    assert_eq!(harness.read().unwrap().unwrap().grip, Grip::NotReady);
    let refused = harness.gripper.command(&to(0.0)).unwrap_err();
    assert!(matches!(refused, GripperError::NotReady), "{refused}");
    let refused = harness.gripper.command(&to(f64::NAN)).unwrap_err();
    assert!(matches!(refused, GripperError::NotFinite), "{refused}");
}

#[test]
fn an_answer_that_never_comes_costs_that_request_alone() {
    let mut harness = Harness::new(vec![Behaviour::Silent, Behaviour::Answer]);
    let begun = Instant::now();
    let silent = harness.read().unwrap_err();
    assert!(matches!(silent, GripperError::Silent), "{silent}");
    assert_eq!(silent.kind(), FaultKind::ReadAgain);
    assert!(begun.elapsed() >= Duration::from_millis(200));
    assert!(harness.read().unwrap().is_some());
    assert_eq!(harness.gripper.counters().silent, 1);
}

#[test]
fn a_command_whose_answer_is_lost_or_damaged_is_given_again() {
    for trouble in [Behaviour::Silent, Behaviour::Damaged, Behaviour::Refuse] {
        let mut harness = Harness::new(Vec::new());
        harness.activate();
        harness.simulated.behave(vec![trouble]);
        harness.gripper.command(&to(0.0)).unwrap();
        let closed = harness.until(|sample| sample.grip == Grip::Free);
        assert!(closed.opening_m < 0.001, "{closed:?}");
        harness.simulated.behave(vec![trouble, trouble]);
        assert!(
            harness.gripper.command(&to(0.05)).is_err(),
            "twice is a failure"
        );
    }
}

#[test]
fn a_late_answer_is_not_taken_for_the_next_ones() {
    // The answer to the read comes 250 ms after it: after it was given up.
    let late = Behaviour::Late(Duration::from_millis(250));
    let mut harness = Harness::new(Vec::new());
    harness.activate();
    harness.simulated.behave(vec![late]);
    assert!(matches!(harness.read(), Err(GripperError::Silent)));
    harness.simulated.wait_for_late_answer();
    harness.gripper.command(&to(0.0)).unwrap();
    let counters = harness.gripper.counters();
    assert_eq!(counters.stray_bytes, 11, "{counters:?}");
    // One that comes while another is waited for is passed over.
    harness.simulated.behave(vec![Behaviour::AnotherFirst]);
    harness.gripper.command(&to(0.05)).unwrap();
    assert_eq!(harness.gripper.counters().bad_answers, 0);
    assert_eq!(harness.gripper.counters().stray_bytes, 22);
}

#[test]
fn a_deadline_before_the_answer_loses_nothing() {
    let late = Behaviour::Late(Duration::from_millis(60));
    let mut harness = Harness::new(vec![late]);
    // No time to wait at all: the question is asked, the answer left for later.
    let begun = harness.clock.now();
    let early = harness.gripper.read_gripper(begun).unwrap();
    assert!(early.is_none());
    let asked_by = harness.clock.now();
    let sample = harness.read().unwrap().unwrap();
    assert!(sample.stamp <= asked_by, "stamped when it was asked");
    assert_eq!(harness.gripper.counters().requests, 1);
}

#[test]
fn a_fault_is_named_and_only_activation_ends_it() {
    let mut harness = Harness::new(Vec::new());
    harness.activate();
    harness.simulated.fail(0x0E);
    let fault = harness.read().unwrap_err();
    assert_eq!(fault.kind(), FaultKind::Reopen);
    assert!(fault.to_string().contains("too much current"), "{fault}");
    harness.gripper.activate().unwrap();
    harness.until(|sample| sample.grip == Grip::Free);
}

/// What the computer remembers is of no matter: a gripper that holds something must not let go because
/// the program that drives it is another one now.
#[test]
fn a_stop_after_a_restart_of_the_program_keeps_the_gripper_active_and_holding() {
    let (simulated, port) = Simulated::start(Vec::new());
    let clock = Running(Instant::now());
    let line = |port: &TTYPort| SerialLine::from_port(port.try_clone().unwrap());
    let mut harness = Harness {
        gripper: Robotiq::new(line(&port), clock, RobotiqConfig::default()),
        clock,
        simulated,
    };
    harness.activate();
    harness.simulated.put_object(Some(0xBD));
    harness.gripper.command(&to(0.0)).unwrap();
    let held = harness.until(|sample| sample.grip != Grip::Moving);
    assert_eq!(held.grip, Grip::Holding);

    harness.gripper = Robotiq::new(line(&port), clock, RobotiqConfig::default());
    harness.gripper.stop().unwrap();
    let after = harness.read().unwrap().unwrap();
    assert_ne!(after.grip, Grip::NotReady, "{after:?}");
    assert_eq!(after.opening_m, held.opening_m);
}

#[test]
fn a_stop_after_a_power_cut_moves_no_finger() {
    let mut harness = Harness::new(Vec::new());
    harness.activate();
    harness.gripper.command(&to(0.04)).unwrap();
    harness.until(|sample| sample.grip == Grip::Free);
    harness.simulated.cut_power();
    harness.gripper.stop().unwrap();
    for _ in 0..10 {
        let sample = harness.read().unwrap().unwrap();
        assert_eq!(sample.grip, Grip::NotReady, "{sample:?}");
        assert!(!harness.gripper.state().activate);
    }
    // Nor does a command, now that it is known.
    let refused = harness.gripper.command(&to(0.0)).unwrap_err();
    assert!(matches!(refused, GripperError::NotReady), "{refused}");
}

#[test]
fn a_line_that_goes_away_is_said() {
    let Harness {
        mut gripper,
        clock,
        simulated,
    } = Harness::new(Vec::new());
    simulated.hang_up();
    let gone = gripper
        .read_gripper(clock.now() + 1_000_000_000)
        .unwrap_err();
    assert_eq!(gone.kind(), FaultKind::Reopen, "{gone}");
    let missing = SerialLine::open("/dev/ttyNOSUCH9").err().unwrap();
    assert_eq!(missing.kind(), FaultKind::FixConfig);
    assert!(missing.to_string().contains("/dev/ttyNOSUCH9"), "{missing}");
}
