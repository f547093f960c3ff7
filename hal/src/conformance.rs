//! Each trait's promise as a callable check.
//!
//! In: a device, and where time matters the clock it lives on. Out: what was read, or the first
//! [`Violation`] with what was seen. Drivers, recordings and mocks are all held to these checks;
//! the checks themselves hold no memory but the caller's.
//!
//! The promises are those written beside the traits: sensors' here, in the order of
//! [`crate::device`], cameras' in `camera`, grippers' in `gripper`, a robot's body in `robot`. [`ScanPromise`] and
//! [`SamplePromise`] can also be fed by hand, next to other work on the same stream.

mod camera;
mod gripper;
mod robot;

use core::fmt;

pub use camera::{FramePromise, check_rgbd_camera};
pub use gripper::{GripperViolation, check_gripper};
pub use robot::{
    BaseViolation, LegViolation, check_base_drive, check_battery, check_emergency_stop,
    check_leg_kinematics, check_legs,
};

use crate::{Clock, Imu, ImuSample, LidarScans, PacketSource, Point, PointSink, ScanHeader, Stamp};

/// How much later than its deadline a call may return on a busy machine, ns.
///
/// Half a second: an order of magnitude above the scheduling delays of a loaded desktop, two below
/// the hang that the check is there to find.
pub const DEADLINE_SLACK_NS: i64 = 500_000_000;

/// How a device broke its promise, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Violation {
    /// A call came back after its deadline.
    Late {
        /// When it should have been back.
        deadline: Stamp,
        /// When it was.
        returned: Stamp,
    },
    /// A datagram was said to be longer than the buffer it was put in.
    BeyondBuffer {
        /// Said length, bytes.
        len: usize,
        /// Buffer length, bytes.
        capacity: usize,
    },
    /// A datagram longer than the buffer was delivered (cut) instead of refused.
    CutDatagram {
        /// Bytes delivered.
        len: usize,
        /// Bytes sent.
        sent: usize,
    },
    /// Something came after the device had said that nothing ever would.
    AfterEnd,
    /// A scan ends before it starts.
    EndBeforeStart {
        /// Its start.
        start: Stamp,
        /// Its end.
        end: Stamp,
    },
    /// A point is older than the one before it.
    PointBackwards {
        /// Index of the later point in the scan.
        index: usize,
        /// Offset of the point before it, ns.
        before_ns: u32,
        /// Its own offset, ns.
        offset_ns: u32,
    },
    /// The first point's offset is not zero.
    FirstOffset {
        /// Its offset, ns.
        offset_ns: u32,
    },
    /// The last point's offset is not the scan's duration.
    LastOffset {
        /// Its offset, ns.
        offset_ns: u32,
        /// `end - start`, ns.
        duration_ns: i64,
    },
    /// A scan without point times has an offset that is not zero.
    UnexpectedOffset {
        /// Index of the point in the scan.
        index: usize,
        /// Its offset, ns.
        offset_ns: u32,
    },
    /// A point has a coordinate that is not finite.
    NotFinite {
        /// Index of the point in the scan.
        index: usize,
    },
    /// A scan starts before the previous one ended.
    ScansOverlap {
        /// End of the previous scan.
        previous_end: Stamp,
        /// Start of this one.
        start: Stamp,
    },
    /// Sequence numbers do not count up by one.
    Sequence {
        /// What should have come.
        expected: u32,
        /// What came.
        got: u32,
    },
    /// A sample's stamp is not after the previous one's.
    StampNotIncreasing {
        /// Stamp of the previous sample.
        before: Stamp,
        /// Stamp of this one.
        stamp: Stamp,
    },
    /// A sample has a value that is not finite.
    SampleNotFinite {
        /// Stamp of the sample.
        stamp: Stamp,
    },
    /// A frame came without geometry, or with one that no camera can have.
    NoGeometry {
        /// The frame's sequence number.
        sequence: u32,
    },
    /// A frame was delivered into images that have no room for it.
    CutFrame {
        /// Depth counts and colour bytes that there was room for.
        room: [usize; 2],
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The variant names say what was broken and the fields what was seen.
        fmt::Debug::fmt(self, f)
    }
}

impl core::error::Error for Violation {}

/// What a checked device did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Datagrams, scans or samples delivered.
    pub items: u64,
    /// Points or bytes in them.
    pub contents: u64,
    /// Calls that had nothing to report.
    pub nothing: u64,
    /// Calls that failed; the device was used on afterwards.
    pub faults: u64,
}

/// The promise of [`LidarScans`] about what is delivered, fed one scan at a time.
#[derive(Debug, Clone, Default)]
pub struct ScanPromise {
    previous: Option<ScanHeader>,
}

impl ScanPromise {
    /// Checks the next scan of a stream.
    pub fn check(&mut self, header: &ScanHeader, points: &[Point]) -> Result<(), Violation> {
        if let Some(previous) = self.previous.replace(*header) {
            let expected = previous.sequence.wrapping_add(1);
            if header.sequence != expected {
                return Err(Violation::Sequence {
                    expected,
                    got: header.sequence,
                });
            }
            if header.start < previous.end {
                return Err(Violation::ScansOverlap {
                    previous_end: previous.end,
                    start: header.start,
                });
            }
        }
        if header.end < header.start {
            return Err(Violation::EndBeforeStart {
                start: header.start,
                end: header.end,
            });
        }
        check_offsets(header, points)
    }
}

fn check_offsets(header: &ScanHeader, points: &[Point]) -> Result<(), Violation> {
    let mut before_ns = 0;
    for (index, point) in points.iter().enumerate() {
        let offset_ns = point.time_offset_ns;
        if !point.is_finite() {
            return Err(Violation::NotFinite { index });
        }
        if !header.has_point_times && offset_ns != 0 {
            return Err(Violation::UnexpectedOffset { index, offset_ns });
        }
        if offset_ns < before_ns {
            return Err(Violation::PointBackwards {
                index,
                before_ns,
                offset_ns,
            });
        }
        before_ns = offset_ns;
    }
    let (Some(first), Some(last), true) = (points.first(), points.last(), header.has_point_times)
    else {
        return Ok(());
    };
    if first.time_offset_ns != 0 {
        return Err(Violation::FirstOffset {
            offset_ns: first.time_offset_ns,
        });
    }
    let duration_ns = header.end.nanos_since(header.start);
    if i64::from(last.time_offset_ns) != duration_ns {
        return Err(Violation::LastOffset {
            offset_ns: last.time_offset_ns,
            duration_ns,
        });
    }
    Ok(())
}

/// The promise of [`Imu`] about what is delivered, fed one sample at a time.
#[derive(Debug, Clone, Default)]
pub struct SamplePromise {
    previous: Option<Stamp>,
}

impl SamplePromise {
    /// Checks the next sample of a stream.
    pub fn check(&mut self, sample: &ImuSample) -> Result<(), Violation> {
        let stamp = sample.stamp;
        let finite = |v: &crate::Vector3| v.iter().all(|c| c.is_finite());
        if !finite(&sample.angular_velocity) || !finite(&sample.specific_force) {
            return Err(Violation::SampleNotFinite { stamp });
        }
        match self.previous.replace(stamp) {
            Some(before) if stamp <= before => Err(Violation::StampNotIncreasing { before, stamp }),
            _ => Ok(()),
        }
    }
}

/// Runs one call with a deadline `wait_ns` from now and checks that it is back by then.
fn timed<T>(
    clock: &dyn Clock,
    wait_ns: i64,
    call: impl FnOnce(Stamp) -> T,
) -> Result<T, Violation> {
    let deadline = clock.now() + wait_ns;
    let answer = call(deadline);
    let returned = clock.now();
    if returned > deadline + DEADLINE_SLACK_NS {
        return Err(Violation::Late { deadline, returned });
    }
    Ok(answer)
}

/// Reads `calls` times from a packet source, each with a deadline `wait_ns` from now on `clock`.
///
/// Checks that every call is back in time, that no length exceeds the buffer and that nothing
/// follows the end. Calls after a fault are part of the check: a fault must leave it usable.
pub fn check_packet_source<S: PacketSource>(
    source: &mut S,
    clock: &dyn Clock,
    buffer: &mut [u8],
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    let mut tally = Tally::default();
    for _ in 0..calls {
        let ended = source.at_end();
        match timed(clock, wait_ns, |deadline| source.receive(buffer, deadline))? {
            Ok(Some(_)) if ended => return Err(Violation::AfterEnd),
            Ok(Some(received)) if received.len > buffer.len() => {
                return Err(Violation::BeyondBuffer {
                    len: received.len,
                    capacity: buffer.len(),
                });
            }
            Ok(Some(received)) => {
                tally.items += 1;
                tally.contents += received.len as u64;
            }
            Ok(None) => tally.nothing += 1,
            Err(_) => tally.faults += 1,
        }
    }
    Ok(tally)
}

/// Checks that a source which holds a datagram of `sent` bytes next refuses a `buffer` that is
/// smaller, rather than cut the datagram. Returns the error, whose kind a test may look at.
pub fn check_refuses_to_cut<S: PacketSource>(
    source: &mut S,
    buffer: &mut [u8],
    sent: usize,
    deadline: Stamp,
) -> Result<Option<S::Error>, Violation> {
    debug_assert!(buffer.len() < sent, "the buffer must be too small");
    match source.receive(buffer, deadline) {
        Err(error) => Ok(Some(error)),
        Ok(None) => Ok(None),
        Ok(Some(received)) => Err(Violation::CutDatagram {
            len: received.len,
            sent,
        }),
    }
}

/// Reads up to `calls` times from a LiDAR, each with a deadline `wait_ns` from now on `clock`;
/// stops early at the end of a recording.
///
/// Checks the deadline, the points and headers ([`ScanPromise`]) and that nothing follows the end.
pub fn check_lidar_scans<L: LidarScans>(
    lidar: &mut L,
    clock: &dyn Clock,
    points: &mut dyn PointSink,
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    let (mut tally, mut promise) = (Tally::default(), ScanPromise::default());
    for _ in 0..calls {
        let ended = lidar.at_end();
        match timed(clock, wait_ns, |deadline| lidar.read_scan(points, deadline))? {
            Ok(Some(_)) if ended => return Err(Violation::AfterEnd),
            Ok(Some(header)) => {
                promise.check(&header, points.points())?;
                tally.items += 1;
                tally.contents += points.points().len() as u64;
            }
            Ok(None) => tally.nothing += 1,
            Err(_) => tally.faults += 1,
        }
        if ended {
            break;
        }
    }
    Ok(tally)
}

/// Reads `calls` times from an IMU, each with a deadline `wait_ns` from now on `clock`.
pub fn check_imu<I: Imu>(
    imu: &mut I,
    clock: &dyn Clock,
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    let (mut tally, mut promise) = (Tally::default(), SamplePromise::default());
    for _ in 0..calls {
        match timed(clock, wait_ns, |deadline| imu.read(deadline))? {
            Ok(Some(sample)) => {
                promise.check(&sample)?;
                tally.items += 1;
            }
            Ok(None) => tally.nothing += 1,
            Err(_) => tally.faults += 1,
        }
    }
    Ok(tally)
}
