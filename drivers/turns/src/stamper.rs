//! Puts turns on the robot's clock and hands them to the caller.

use hachi_hal::{Point, PointSink, ScanHeader, Stamp};

use crate::Turn;

/// Most that a turn is compressed to catch up when the estimate of the clocks' offset falls: half a
/// percent, which is half a millisecond in a turn and nothing to a robot's speed.
const CATCH_UP: i64 = 200;

/// Stamps turn after turn such that they never overlap.
#[derive(Debug, Clone, Default)]
pub struct TurnStamper {
    sequence: u32,
    previous_end: Option<Stamp>,
}

impl TurnStamper {
    /// A stamper that begins with sequence number 0.
    pub fn new() -> Self {
        Self::default()
    }

    /// The header of a turn whose sensor times lie `offset_ns` behind the robot's clock.
    ///
    /// If the estimate fell since the last turn, this one would begin before that one ended. Then it
    /// begins where that one ended, and its points are drawn together by up to half a percent until
    /// the difference is made up.
    pub fn stamp(&mut self, turn: &Turn, points: &mut [Point], offset_ns: i64) -> ScanHeader {
        let duration_ns = (turn.end_ns - turn.start_ns).max(0);
        let wanted = Stamp::from_nanos(turn.start_ns) + offset_ns;
        let start = self.previous_end.map_or(wanted, |end| end.max(wanted));
        let late_ns = start.nanos_since(wanted);
        let recovered_ns = late_ns.min(duration_ns / CATCH_UP);
        let kept_ns = duration_ns - recovered_ns;
        if recovered_ns > 0 {
            for point in points {
                let scaled = i64::from(point.time_offset_ns) * kept_ns / duration_ns;
                point.time_offset_ns = scaled as u32;
            }
        }
        let header = ScanHeader {
            sequence: self.sequence,
            start,
            end: start + kept_ns,
            sensor_start_ns: u64::try_from(turn.start_ns).ok(),
            completeness: turn.completeness,
            has_point_times: true,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.previous_end = Some(header.end);
        header
    }
}

/// Puts the points of a turn into the caller's sink, which is empty. Returns how many did not fit;
/// the header then ends with the last one that did.
pub fn deliver(points: &[Point], header: &mut ScanHeader, sink: &mut dyn PointSink) -> u64 {
    if sink.extend(points).is_ok() {
        return 0;
    }
    /// Points tried at once, so that a full sink leaves at most this much of its room unused.
    const STEP: usize = 64;
    for part in points.chunks(STEP) {
        if sink.extend(part).is_err() {
            break;
        }
    }
    let kept = sink.points().len();
    if let Some(last) = sink.points().last() {
        header.end = header.start + i64::from(last.time_offset_ns);
    }
    points.len().saturating_sub(kept) as u64
}
