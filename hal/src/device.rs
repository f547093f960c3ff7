//! Traits that devices implement, and how they fail.
//!
//! Each trait is a promise; `conformance` (a feature) holds every implementation to it. A real
//! device, a recording and a mock all implement the same trait.

use core::fmt;

use crate::{ImuSample, PointSink, ScanHeader, Stamp};

/// Named for what the caller should do next; the detail stays in the driver's own type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FaultKind {
    /// Passing: call again.
    ReadAgain,
    /// The device went away: open it again.
    Reopen,
    /// The settings do not fit the device: a person must change them.
    FixConfig,
    /// It will not work again.
    GiveUp,
}

/// An error of a device.
pub trait DeviceError: fmt::Debug + fmt::Display {
    /// What the caller should do next.
    fn kind(&self) -> FaultKind;
}

impl DeviceError for core::convert::Infallible {
    fn kind(&self) -> FaultKind {
        match *self {}
    }
}

/// One datagram that arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received {
    /// How many bytes of the buffer it fills.
    pub len: usize,
    /// When the kernel (or the capture) saw it.
    pub stamp: Stamp,
    /// Destination UDP port, which tells a sensor's data packets from its position packets.
    pub port: u16,
}

/// Where a LiDAR's packets come from: a socket, a capture file, a simulator.
///
/// - `receive` writes at most one datagram and is back by `deadline`;
/// - nothing to report by then is `Ok(None)`; the end of a recording is too, with `at_end` true;
/// - a datagram longer than the buffer is an error, never a cut datagram;
/// - an error leaves the source usable.
pub trait PacketSource {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next datagram's payload into `buffer`.
    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline: Stamp,
    ) -> Result<Option<Received>, Self::Error>;
    /// Whether nothing will ever come again (a recording that ended). Live sources say `false`.
    fn at_end(&self) -> bool;
}

/// A ranging sensor, read one turn at a time by one thread.
///
/// - `read_scan` is back by `deadline`; nothing to report is `Ok(None)`, not an error;
/// - on `Some`, `points` holds exactly the scan's points, oldest first: time offsets never go
///   backwards and the last one is `end - start`;
/// - scans do not overlap: a scan's `start` is not before the previous one's `end`;
/// - an error leaves the device usable: `read_scan` may be called again.
pub trait LidarScans {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next scan into `points`, which is cleared first.
    fn read_scan(
        &mut self,
        points: &mut dyn PointSink,
        deadline: Stamp,
    ) -> Result<Option<ScanHeader>, Self::Error>;
    /// Whether nothing will ever come again (a recording that ended). Live sources say `false`.
    fn at_end(&self) -> bool;
}

/// An inertial measurement unit.
///
/// - `read` is back by `deadline`; nothing to report is `Ok(None)`;
/// - stamps strictly increase; values are finite; an error leaves the device usable.
pub trait Imu {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next sample.
    fn read(&mut self, deadline: Stamp) -> Result<Option<ImuSample>, Self::Error>;
}

/// The robot's clock. Only the outermost layer holds one; algorithms take stamps with their data.
pub trait Clock {
    /// Now. Never goes backwards.
    fn now(&self) -> Stamp;
}
