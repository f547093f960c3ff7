//! Traits that devices implement, and how they fail.
//!
//! Each trait is a promise; `conformance` (a feature) holds every implementation to it. A real
//! device, a recording and a mock all implement the same trait.

use core::fmt;
use core::time::Duration;

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

    /// The moment that was `age_ns` ago on another clock of this computer, as a kernel tells of what
    /// it took in. Nothing waits in a queue for longer than 10 s and nothing comes from the future:
    /// such an age is that of a clock that was set in between, and now is all that is known.
    fn ago(&self, age_ns: i64) -> Stamp {
        let believed = (0..=MOST_AGE_NS).contains(&age_ns);
        self.now() + if believed { -age_ns } else { 0 }
    }

    /// How long until `deadline`; zero if it has passed.
    fn until(&self, deadline: Stamp) -> Duration {
        let left_ns = deadline.nanos_since(self.now());
        Duration::from_nanos(u64::try_from(left_ns).unwrap_or(0))
    }
}

/// Most that a kernel's stamp may lie in the past and still be believed, ns.
const MOST_AGE_NS: i64 = 10_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    struct Stopped(i64);

    impl Clock for Stopped {
        fn now(&self) -> Stamp {
            Stamp::from_nanos(self.0)
        }
    }

    const S: i64 = 1_000_000_000;

    #[test]
    fn an_age_is_believed_while_it_can_be_one() {
        let clock = Stopped(100 * S);
        for (age_ns, stamp_ns) in [
            (0, 100 * S),
            (5_000_000, 100 * S - 5_000_000),
            (10 * S, 90 * S),
            (10 * S + 1, 100 * S),
            (-1, 100 * S),
            (i64::MIN, 100 * S),
            (i64::MAX, 100 * S),
        ] {
            assert_eq!(clock.ago(age_ns).as_nanos(), stamp_ns, "{age_ns}");
        }
    }

    #[test]
    fn no_time_is_left_after_a_deadline() {
        let clock = Stopped(100 * S);
        for (deadline_ns, left) in [
            (103 * S + 1, Duration::new(3, 1)),
            (100 * S, Duration::ZERO),
            (99 * S, Duration::ZERO),
            (i64::MIN, Duration::ZERO),
        ] {
            assert_eq!(clock.until(Stamp::from_nanos(deadline_ns)), left);
        }
        let for_ever = Stopped(-S).until(Stamp::from_nanos(i64::MAX));
        assert_eq!(for_ever, Duration::from_nanos(i64::MAX as u64));
    }
}
