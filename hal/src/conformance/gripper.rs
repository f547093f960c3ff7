//! The promise of grippers.

use core::fmt;

use super::{Violation, timed};
use crate::{Clock, Grip, Gripper, GripperCommand, GripperSample, Stamp};

/// How a gripper broke its promise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum GripperViolation {
    /// One of those that every stream can break.
    Stream(Violation),
    /// It took a command that must be refused.
    TookBad(GripperCommand),
    /// It refused a command that is in order.
    RefusedGood(GripperCommand),
    /// It failed where nothing was wrong.
    Failed,
    /// The opening lies outside the stroke, or is no number.
    Opening(GripperSample),
    /// It did not become ready, or did not stop moving, in as many reports as it was given.
    NeverDone(Option<GripperSample>),
    /// It stopped somewhere else than where it was sent, without anything in its way.
    Elsewhere {
        /// Where it was sent.
        wanted_m: f64,
        /// Where it is.
        got: GripperSample,
    },
}

impl fmt::Display for GripperViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

impl core::error::Error for GripperViolation {}

/// Takes an empty gripper that is not ready yet through its promise: activates it, opens and closes it, at most
/// `reports` reports for each, each with a deadline `wait_ns` from now on `clock`. Its fingers move:
/// keep away.
///
/// # Errors
/// The first broken promise.
pub fn check_gripper<G: Gripper>(
    gripper: &mut G,
    clock: &dyn Clock,
    reports: usize,
    wait_ns: i64,
) -> Result<(), GripperViolation> {
    let stroke_m = gripper.stroke_m();
    let to = |opening_m| GripperCommand {
        opening_m,
        speed_m_s: 0.05,
        force_n: 20.0,
    };
    let mut check = Check {
        gripper,
        clock,
        reports,
        wait_ns,
        previous: None,
    };
    let half = to(stroke_m / 2.0);
    if check.gripper.command(&half).is_ok() {
        return Err(GripperViolation::TookBad(half));
    }
    check
        .gripper
        .activate()
        .map_err(|_| GripperViolation::Failed)?;
    check.until(|sample| sample.grip != Grip::NotReady)?;
    // What is beyond the limits is cut to them.
    for (asked_m, wanted_m) in [
        (stroke_m / 2.0, stroke_m / 2.0),
        (1e9, stroke_m),
        (-1.0, 0.0),
    ] {
        check.goes(&to(asked_m), wanted_m)?;
    }
    for bad in [f64::NAN, f64::INFINITY] {
        for command in [
            to(bad),
            GripperCommand {
                force_n: bad,
                ..half
            },
        ] {
            if check.gripper.command(&command).is_ok() {
                return Err(GripperViolation::TookBad(command));
            }
        }
    }
    // The refused ones changed nothing.
    check.stays(0.0)?;
    check.gripper.stop().map_err(|_| GripperViolation::Failed)?;
    check.stays(0.0)
}

struct Check<'a, G> {
    gripper: &'a mut G,
    clock: &'a dyn Clock,
    reports: usize,
    wait_ns: i64,
    previous: Option<Stamp>,
}

impl<G: Gripper> Check<'_, G> {
    fn read(&mut self) -> Result<Option<GripperSample>, GripperViolation> {
        let answer = timed(self.clock, self.wait_ns, |deadline| {
            self.gripper.read_gripper(deadline)
        });
        let answer = answer.map_err(GripperViolation::Stream)?;
        let Some(sample) = answer.map_err(|_| GripperViolation::Failed)? else {
            return Ok(None);
        };
        // A count of the gripper's may lie beyond its nominal stroke.
        let within = -1e-9..=self.gripper.stroke_m() + 1e-9;
        if !within.contains(&sample.opening_m) {
            return Err(GripperViolation::Opening(sample));
        }
        let stamp = sample.stamp;
        match self.previous.replace(stamp) {
            Some(before) if stamp <= before => {
                Err(GripperViolation::Stream(Violation::StampNotIncreasing {
                    before,
                    stamp,
                }))
            }
            _ => Ok(Some(sample)),
        }
    }

    fn until(
        &mut self,
        done: impl Fn(&GripperSample) -> bool,
    ) -> Result<GripperSample, GripperViolation> {
        let mut last = None;
        for _ in 0..self.reports {
            if let Some(sample) = self.read()? {
                if done(&sample) {
                    return Ok(sample);
                }
                last = Some(sample);
            }
        }
        Err(GripperViolation::NeverDone(last))
    }

    fn goes(&mut self, command: &GripperCommand, wanted_m: f64) -> Result<(), GripperViolation> {
        let taken = self.gripper.command(command);
        taken.map_err(|_| GripperViolation::RefusedGood(*command))?;
        self.stays(wanted_m)
    }

    /// Ends where it was sent, with nothing felt. A thirtieth of the stroke is what counts and
    /// fingers are good for.
    fn stays(&mut self, wanted_m: f64) -> Result<(), GripperViolation> {
        let got = self.until(|sample| sample.grip != Grip::Moving)?;
        let near = (got.opening_m - wanted_m).abs() < self.gripper.stroke_m() / 30.0;
        if near && got.grip == Grip::Free {
            Ok(())
        } else {
            Err(GripperViolation::Elsewhere { wanted_m, got })
        }
    }
}
