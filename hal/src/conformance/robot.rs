//! The promises of legs, base, battery and emergency stop.

use core::fmt;

use super::{Tally, Violation, timed};
use crate::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, Battery, BatterySample, BodyVelocity, Clock,
    EmergencyStop, Leg, LegKinematics, LegState, LegStates, Stamp, Vector3,
};

/// A sample of a stream whose stamps strictly increase.
trait Stamped {
    fn stamp(&self) -> Stamp;
    fn is_sound(&self) -> bool;
}

impl Stamped for LegState {
    fn stamp(&self) -> Stamp {
        self.stamp
    }
    fn is_sound(&self) -> bool {
        self.is_finite()
    }
}

impl Stamped for BatterySample {
    fn stamp(&self) -> Stamp {
        self.stamp
    }
    fn is_sound(&self) -> bool {
        self.is_plausible()
    }
}

impl Stamped for crate::StopSample {
    fn stamp(&self) -> Stamp {
        self.stamp
    }
    fn is_sound(&self) -> bool {
        true
    }
}

fn check_stream<T: Stamped, E>(
    clock: &dyn Clock,
    calls: usize,
    wait_ns: i64,
    mut read: impl FnMut(Stamp) -> Result<Option<T>, E>,
) -> Result<Tally, Violation> {
    let (mut tally, mut previous) = (Tally::default(), None);
    for _ in 0..calls {
        match timed(clock, wait_ns, &mut read)? {
            Ok(Some(sample)) => {
                let stamp = sample.stamp();
                if !sample.is_sound() {
                    return Err(Violation::SampleNotFinite { stamp });
                }
                match previous.replace(stamp) {
                    Some(before) if stamp <= before => {
                        return Err(Violation::StampNotIncreasing { before, stamp });
                    }
                    _ => tally.items += 1,
                }
            }
            Ok(None) => tally.nothing += 1,
            Err(_) => tally.faults += 1,
        }
    }
    Ok(tally)
}

/// Reads `calls` times from legs, each with a deadline `wait_ns` from now on `clock`.
pub fn check_legs<L: LegStates>(
    legs: &mut L,
    clock: &dyn Clock,
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    check_stream(clock, calls, wait_ns, |deadline| legs.read_legs(deadline))
}

/// Reads `calls` times from a battery, each with a deadline `wait_ns` from now on `clock`.
pub fn check_battery<B: Battery>(
    battery: &mut B,
    clock: &dyn Clock,
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    check_stream(clock, calls, wait_ns, |deadline| {
        battery.read_battery(deadline)
    })
}

/// Reads `calls` times from an emergency stop, each with a deadline `wait_ns` from now on `clock`.
pub fn check_emergency_stop<E: EmergencyStop>(
    stop: &mut E,
    clock: &dyn Clock,
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    check_stream(clock, calls, wait_ns, |deadline| stop.read_stop(deadline))
}

/// How a base broke its promise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum BaseViolation {
    /// It refused a command that is in order.
    RefusedGood {
        /// The command.
        command: BaseCommand,
    },
    /// It took a command that must be refused.
    TookBad {
        /// The command.
        command: BaseCommand,
        /// When it arrived.
        now: Stamp,
    },
    /// Sending failed where nothing was wrong.
    ServiceFailed {
        /// When.
        now: Stamp,
    },
    /// What it gave the motors is not what is in force.
    WrongMove {
        /// What it should have been.
        expected: BodyVelocity,
        /// What it was.
        got: BaseStatus,
    },
    /// A dead command was not said to be dead, or a live one was.
    WrongExpiry {
        /// What it said.
        got: BaseStatus,
    },
    /// A cut velocity was not said to be cut.
    SilentCut {
        /// What it said.
        got: BaseStatus,
    },
}

impl fmt::Display for BaseViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

impl core::error::Error for BaseViolation {}

/// Takes a base that is ready to move through its promise, from `start` on for two seconds of its
/// clock. It walks at up to 0.1 m/s for a fraction of a second: give it room, or a simulator.
///
/// # Errors
/// The first broken promise.
pub fn check_base_drive<B: BaseDrive>(base: &mut B, start: Stamp) -> Result<(), BaseViolation> {
    const MS: i64 = 1_000_000;
    let slow = BodyVelocity {
        forward: 0.1,
        ..BodyVelocity::ZERO
    };
    let moving = |at: i64, lives_ms: i64, velocity| BaseCommand {
        stamp: start + at * MS,
        time_to_live_ns: lives_ms * MS,
        action: BaseAction::Move(velocity),
    };
    let mut check = BaseCheck { base, start };
    // A command moves the base until it dies, and not a moment longer.
    check.takes(moving(0, 100, slow), 0)?;
    check.moves(1, slow, false)?;
    check.moves(99, slow, false)?;
    check.moves(100, BodyVelocity::ZERO, true)?;
    check.moves(600, BodyVelocity::ZERO, true)?;
    // One that claims to live for ever does not.
    check.takes(moving(600, i64::MAX / MS, slow), 600)?;
    check.moves(601, slow, false)?;
    let longest_ms = BaseCommand::LONGEST_TIME_TO_LIVE_NS / MS;
    check.moves(600 + longest_ms, BodyVelocity::ZERO, true)?;
    // What must be refused changes nothing: the command before it goes on until its own death.
    check.takes(moving(1_200, 200, slow), 1_200)?;
    for bad in [f64::NAN, f64::INFINITY] {
        let velocity = BodyVelocity { left: bad, ..slow };
        check.refuses(moving(1_210, 200, velocity), 1_210)?;
    }
    check.refuses(moving(1_000, 200, slow), 1_210)?;
    check.refuses(moving(1_310, 200, slow), 1_210)?;
    check.moves(1_399, slow, false)?;
    check.moves(1_400, BodyVelocity::ZERO, true)?;
    // A newer command replaces an older one, also where it lives shorter.
    check.takes(moving(1_500, 400, slow), 1_500)?;
    check.takes(moving(1_510, 50, slow), 1_510)?;
    check.moves(1_570, BodyVelocity::ZERO, true)?;
    // A stop stops.
    check.takes(moving(1_600, 400, slow), 1_600)?;
    let stop = BaseCommand {
        action: BaseAction::Stop,
        ..moving(1_610, 400, slow)
    };
    check.takes(stop, 1_610)?;
    check.moves(1_611, BodyVelocity::ZERO, false)?;
    check.cuts_what_is_too_fast(moving(1_700, 100, slow), 1_700)?;
    check.moves(1_900, BodyVelocity::ZERO, true)
}

struct BaseCheck<'a, B> {
    base: &'a mut B,
    start: Stamp,
}

impl<B: BaseDrive> BaseCheck<'_, B> {
    fn at(&self, ms: i64) -> Stamp {
        self.start + ms * 1_000_000
    }

    fn takes(&mut self, command: BaseCommand, ms: i64) -> Result<(), BaseViolation> {
        let taken = self.base.command(&command, self.at(ms));
        taken.map_err(|_| BaseViolation::RefusedGood { command })
    }

    fn refuses(&mut self, command: BaseCommand, ms: i64) -> Result<(), BaseViolation> {
        let now = self.at(ms);
        match self.base.command(&command, now) {
            Err(_) => Ok(()),
            Ok(()) => Err(BaseViolation::TookBad { command, now }),
        }
    }

    fn service(&mut self, ms: i64) -> Result<BaseStatus, BaseViolation> {
        let now = self.at(ms);
        let status = self.base.service(now);
        status.map_err(|_| BaseViolation::ServiceFailed { now })
    }

    fn moves(
        &mut self,
        ms: i64,
        expected: BodyVelocity,
        expired: bool,
    ) -> Result<(), BaseViolation> {
        let got = self.service(ms)?;
        // Motors may be told in single precision.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        let same = near(got.velocity.forward, expected.forward)
            && near(got.velocity.left, expected.left)
            && near(got.velocity.yaw_rate, expected.yaw_rate);
        if !same {
            return Err(BaseViolation::WrongMove { expected, got });
        }
        if got.expired != expired {
            return Err(BaseViolation::WrongExpiry { got });
        }
        Ok(())
    }

    fn cuts_what_is_too_fast(
        &mut self,
        command: BaseCommand,
        ms: i64,
    ) -> Result<(), BaseViolation> {
        let asked = BodyVelocity {
            forward: 1e6,
            left: -1e6,
            yaw_rate: 1e6,
        };
        let action = BaseAction::Move(asked);
        self.takes(BaseCommand { action, ..command }, ms)?;
        let got = self.service(ms + 1)?;
        let v = got.velocity;
        let bounded = v.is_finite() && v.forward < 100.0 && v.left > -100.0 && v.yaw_rate < 100.0;
        if !bounded {
            let expected = BodyVelocity::ZERO;
            return Err(BaseViolation::WrongMove { expected, got });
        }
        if got.saturated {
            Ok(())
        } else {
            Err(BaseViolation::SilentCut { got })
        }
    }
}

/// How leg kinematics broke their promise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LegViolation {
    /// The Jacobian is not the derivative of the foot's place.
    Jacobian {
        /// The leg.
        leg: Leg,
        /// At these joint angles.
        angles: Vector3,
        /// Largest difference of an entry, metres per radian.
        off_by: f64,
    },
    /// Joints to foot to joints is not where it began.
    RoundTrip {
        /// The leg.
        leg: Leg,
        /// From these joint angles.
        angles: Vector3,
        /// To these.
        came_back: Vector3,
    },
    /// A foot's place is said to be out of reach although joints were there.
    SaidUnreachable {
        /// The leg.
        leg: Leg,
        /// At these joint angles.
        angles: Vector3,
    },
    /// A place ten kilometres away is said to be within reach.
    SaidReachable {
        /// The leg.
        leg: Leg,
    },
}

impl fmt::Display for LegViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

impl core::error::Error for LegViolation {}

/// Checks kinematics at one set of joint angles, for every leg.
///
/// # Errors
/// The first broken promise.
pub fn check_leg_kinematics(
    legs: &dyn LegKinematics,
    angles: &Vector3,
) -> Result<(), LegViolation> {
    const STEP: f64 = 1e-6;
    for leg in Leg::ALL {
        let jacobian = legs.jacobian(leg, angles);
        for joint in 0..3 {
            let mut step = Vector3::zeros();
            step[joint] = STEP;
            let ahead = legs.foot_in_base(leg, &(angles + step));
            let behind = legs.foot_in_base(leg, &(angles - step));
            let numeric = (ahead - behind) / (2.0 * STEP);
            let off_by = (numeric - jacobian.column(joint)).amax();
            // Written so that not-a-number fails.
            let fits = off_by < 1e-6;
            if !fits {
                let angles = *angles;
                return Err(LegViolation::Jacobian {
                    leg,
                    angles,
                    off_by,
                });
            }
        }
        let back = legs.joints_for(leg, &legs.foot_in_base(leg, angles));
        let (angles, came_back) = (*angles, back.angles);
        if !back.reachable {
            return Err(LegViolation::SaidUnreachable { leg, angles });
        }
        let fits = (came_back - angles).amax() < 1e-6;
        if !fits {
            return Err(LegViolation::RoundTrip {
                leg,
                angles,
                came_back,
            });
        }
        let far = legs.joints_for(leg, &Vector3::new(1e4, 0.0, 0.0));
        if far.reachable {
            return Err(LegViolation::SaidReachable { leg });
        }
    }
    Ok(())
}
