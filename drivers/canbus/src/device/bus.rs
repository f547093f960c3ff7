//! A bus: the narrowest trait that lets the nodes above it be real.

use std::io;
use std::string::String;
use std::time::Duration;

use hachi_hal::{Clock, DeviceError, FaultKind, Stamp};

use crate::frame::CanFrame;

/// A frame that came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received {
    /// The frame.
    pub frame: CanFrame,
    /// How long before now the kernel took it in, ns: it may have waited while its reader was busy.
    pub age_ns: i64,
}

/// A CAN bus.
pub trait CanBus {
    /// Sends a frame.
    ///
    /// # Errors
    /// The bus does not take it.
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError>;

    /// The next frame, waiting for `limit`; `None` if none came.
    ///
    /// # Errors
    /// The bus is down or gone.
    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, BusError>;
}

impl<B: CanBus + ?Sized> CanBus for std::boxed::Box<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        (**self).send(frame)
    }

    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, BusError> {
        (**self).receive(limit)
    }
}

/// What is wrong with a bus, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BusError {
    /// This system has no CAN, or no such interface.
    #[error(
        "no CAN interface {interface}: {source}; `ip -details link show type can` lists what is there, `sudo ip link set {interface} up type can bitrate 250000` starts one"
    )]
    Open {
        /// Its name.
        interface: String,
        /// What the system said.
        source: io::Error,
    },
    /// It went down, or its adapter was unplugged.
    #[error("the CAN bus is down: {0}; is its adapter plugged in and the interface up?")]
    Down(io::Error),
    /// Nobody takes frames: the bus is not connected or not terminated.
    #[error("the CAN bus takes no frames: is another node on it, with the same bit rate?")]
    Full,
}

impl DeviceError for BusError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Open { .. } => FaultKind::FixConfig,
            Self::Down(_) => FaultKind::Reopen,
            Self::Full => FaultKind::ReadAgain,
        }
    }
}

/// The next frame until `deadline` and when it came.
pub(super) fn receive(
    bus: &mut impl CanBus,
    clock: &impl Clock,
    deadline: Stamp,
) -> Result<Option<(CanFrame, Stamp)>, BusError> {
    let received = bus.receive(clock.until(deadline))?;
    Ok(received.map(|Received { frame, age_ns }| (frame, clock.ago(age_ns))))
}
