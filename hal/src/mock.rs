//! Scripted devices for tests: what a device does is written down step by step, faults as readily
//! as data.
//!
//! In: a script, which is anything that can be seen as a slice of [`Step`]s (an array, a slice, a
//! `Vec`). Out: the device trait, one step per call. Nothing here allocates or reads a clock: a
//! mock answers at once, so deadlines are always kept.
//!
//! ```
//! use hachi_hal::mock::{MockPackets, Packet, Step};
//! use hachi_hal::{FaultKind, PacketSource, Stamp};
//!
//! let packet = Packet { payload: &[1, 2, 3], stamp: Stamp::from_nanos(5), port: 2368 };
//! let mut source = MockPackets::script([Step::Batch(packet), Step::Fault(FaultKind::ReadAgain)]);
//! let mut buffer = [0; 8];
//! let received = source.receive(&mut buffer, Stamp::default()).unwrap().unwrap();
//! assert_eq!((received.len, received.port), (3, 2368));
//! assert!(source.receive(&mut buffer, Stamp::default()).is_err());
//! source.assert_done();
//! ```

mod camera;
mod gripper;
mod robot;

use core::fmt;
use core::marker::PhantomData;

use crate::{
    DeviceError, FaultKind, Imu, ImuSample, LidarScans, PacketSource, Point, PointSink, Received,
    ScanHeader, Stamp,
};

pub use camera::{MockCamera, Shot};
pub use gripper::{MockGripper, MockGripperError};
pub use robot::{MockBase, MockBattery, MockEmergencyStop, MockLegs, MockWatchdog};

/// What a scripted device does on one call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step<T> {
    /// It delivers this.
    Batch(T),
    /// It fails.
    Fault(FaultKind),
    /// It has nothing to report by the deadline.
    Nothing,
}

/// The failure of a scripted device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MockError {
    /// The script said so.
    Scripted(FaultKind),
    /// The scripted datagram is longer than the caller's buffer.
    Oversize {
        /// Bytes of the datagram.
        len: usize,
        /// Bytes of the buffer.
        capacity: usize,
    },
    /// The caller's images have less room than the scripted frame.
    SmallImages {
        /// Depth counts and colour bytes of the frame.
        needed: [usize; 2],
        /// Room for them.
        given: [usize; 2],
    },
    /// The sink took fewer points than the scripted scan has.
    SinkFull {
        /// Points of the scan.
        points: usize,
    },
}

impl fmt::Display for MockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scripted(kind) => write!(f, "scripted fault: {kind:?}"),
            Self::Oversize { len, capacity } => {
                write!(f, "a datagram of {len} bytes does not fit in {capacity}")
            }
            Self::SmallImages { needed, given } => write!(
                f,
                "a frame of {} counts and {} bytes does not fit in {} and {}",
                needed[0], needed[1], given[0], given[1]
            ),
            Self::SinkFull { points } => write!(f, "the sink did not take {points} points"),
        }
    }
}

impl core::error::Error for MockError {}

impl DeviceError for MockError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Scripted(kind) => *kind,
            Self::Oversize { .. } => FaultKind::ReadAgain,
            Self::SinkFull { .. } | Self::SmallImages { .. } => FaultKind::FixConfig,
        }
    }
}

/// One scripted datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// What it carries.
    pub payload: &'a [u8],
    /// When it arrived.
    pub stamp: Stamp,
    /// The UDP port it was sent to.
    pub port: u16,
}

/// One scripted scan. The header is delivered as it stands, so that broken promises can be
/// scripted too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan<'a> {
    /// What is true of all its points.
    pub header: ScanHeader,
    /// Its points.
    pub points: &'a [Point],
}

/// A script and how far it was played.
#[derive(Debug, Clone)]
struct Player<T, S> {
    script: S,
    next: usize,
    item: PhantomData<T>,
}

impl<T: Copy, S: AsRef<[Step<T>]>> Player<T, S> {
    fn new(script: S) -> Self {
        Self {
            script,
            next: 0,
            item: PhantomData,
        }
    }

    fn play(&mut self) -> Result<Option<T>, MockError> {
        let step = self.script.as_ref().get(self.next).copied();
        self.next += usize::from(step.is_some());
        match step {
            Some(Step::Batch(item)) => Ok(Some(item)),
            Some(Step::Fault(kind)) => Err(MockError::Scripted(kind)),
            Some(Step::Nothing) | None => Ok(None),
        }
    }

    fn left(&self) -> usize {
        self.script.as_ref().len() - self.next
    }

    #[track_caller]
    fn assert_done(&self) {
        let (left, of) = (self.left(), self.script.as_ref().len());
        assert!(left == 0, "{left} of {of} scripted steps were not played");
    }
}

/// A packet source that plays a script. At its end it is a recording that ended.
#[derive(Debug, Clone)]
pub struct MockPackets<'a, S>(Player<Packet<'a>, S>);

impl<'a, S: AsRef<[Step<Packet<'a>>]>> MockPackets<'a, S> {
    /// A source that does `script`, one step per call.
    pub fn script(script: S) -> Self {
        Self(Player::new(script))
    }

    /// Panics unless every step was played: a script left unread means the loop stopped early.
    #[track_caller]
    pub fn assert_done(&self) {
        self.0.assert_done();
    }
}

impl<'a, S: AsRef<[Step<Packet<'a>>]>> PacketSource for MockPackets<'a, S> {
    type Error = MockError;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, MockError> {
        let Some(packet) = self.0.play()? else {
            return Ok(None);
        };
        let (len, capacity) = (packet.payload.len(), buffer.len());
        let Some(target) = buffer.get_mut(..len) else {
            return Err(MockError::Oversize { len, capacity });
        };
        target.copy_from_slice(packet.payload);
        Ok(Some(Received {
            len,
            stamp: packet.stamp,
            port: packet.port,
        }))
    }

    fn at_end(&self) -> bool {
        self.0.left() == 0
    }
}

/// A LiDAR that plays a script.
#[derive(Debug, Clone)]
pub struct MockLidar<'a, S>(Player<Scan<'a>, S>);

impl<'a, S: AsRef<[Step<Scan<'a>>]>> MockLidar<'a, S> {
    /// A LiDAR that does `script`, one step per call.
    pub fn script(script: S) -> Self {
        Self(Player::new(script))
    }

    /// Panics unless every step was played.
    #[track_caller]
    pub fn assert_done(&self) {
        self.0.assert_done();
    }
}

impl<'a, S: AsRef<[Step<Scan<'a>>]>> LidarScans for MockLidar<'a, S> {
    type Error = MockError;

    fn read_scan(
        &mut self,
        points: &mut dyn PointSink,
        _: Stamp,
    ) -> Result<Option<ScanHeader>, MockError> {
        points.clear();
        let Some(scan) = self.0.play()? else {
            return Ok(None);
        };
        points
            .extend(scan.points)
            .map_err(|_| MockError::SinkFull {
                points: scan.points.len(),
            })?;
        Ok(Some(scan.header))
    }

    fn at_end(&self) -> bool {
        self.0.left() == 0
    }
}

/// An IMU that plays a script.
#[derive(Debug, Clone)]
pub struct MockImu<S>(Player<ImuSample, S>);

impl<S: AsRef<[Step<ImuSample>]>> MockImu<S> {
    /// An IMU that does `script`, one step per call.
    pub fn script(script: S) -> Self {
        Self(Player::new(script))
    }

    /// Panics unless every step was played.
    #[track_caller]
    pub fn assert_done(&self) {
        self.0.assert_done();
    }
}

impl<S: AsRef<[Step<ImuSample>]>> Imu for MockImu<S> {
    type Error = MockError;

    fn read(&mut self, _: Stamp) -> Result<Option<ImuSample>, MockError> {
        self.0.play()
    }
}
