//! What stops a robot whatever else is asked: the emergency stop and the watchdog.

use crate::{DeviceError, Stamp};

/// The emergency stop at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopSample {
    /// When it was looked at.
    pub stamp: Stamp,
    /// Whether the robot must stand still.
    pub pressed: bool,
}

/// An emergency stop: a button, a key of a remote control, a node on a bus.
///
/// - `read_stop` is back by `deadline`; nothing new is `Ok(None)`;
/// - stamps strictly increase; an error leaves the device usable.
///
/// Whoever reads it takes silence longer than a limit, and any error, for *pressed*.
pub trait EmergencyStop {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next report.
    fn read_stop(&mut self, deadline: Stamp) -> Result<Option<StopSample>, Self::Error>;
}

/// Something that stops the robot, or restarts the program, unless it is fed in time.
///
/// - once fed, it bites if more than `timeout_ns` pass until it is fed again;
/// - feeding is back at once; an error leaves it as it was, and running.
pub trait Watchdog {
    /// What can go wrong.
    type Error: DeviceError;
    /// Says that all is well at `now`.
    fn feed(&mut self, now: Stamp) -> Result<(), Self::Error>;
    /// How long it waits for the next feeding, ns.
    fn timeout_ns(&self) -> i64;
}
