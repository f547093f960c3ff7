//! How a scan lies in time, and where its poses are.
//!
//! In: a scan's header and when the one before ended. Out: the moments of the chain's poses.

use hachi_hal::{Pose, ScanHeader, Stamp};
use hachi_registration::chain::MAX_INTERVALS;

/// Without a scan for longer than this share of a scan's time, scans are missing. What passes
/// between two scans of a sensor that does not see all around is less.
const LEAD_SHARE: f64 = 0.5;

/// How a scan lies in time between the end of the one before and its own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Timing {
    pub start: Stamp,
    pub span_s: f64,
    /// How long no scan was taken before this one, where that is an interval of its own; or 0.
    pub lead_s: f64,
    pub intervals: usize,
    /// Share of the intervals' time before the scan's first point.
    pub from: f64,
    /// Share of the scan in a nanosecond.
    pub per_ns: f32,
    pub has_point_times: bool,
}

impl Timing {
    /// When `header`'s scan was taken, after one that ended at `last_end`, with a pose every
    /// `knot_interval_s` seconds.
    pub fn of(header: &ScanHeader, last_end: Option<Stamp>, knot_interval_s: f64) -> Self {
        let duration_s = header.end.secs_since(header.start).max(1e-3);
        let span_s = match last_end {
            Some(last) if header.end > last => header.end.secs_since(last),
            _ => duration_s,
        };
        let start = last_end.filter(|last| header.end > *last);
        let start = start.unwrap_or(header.end + -((span_s * 1e9) as i64));
        let (has_point_times, per_ns) = (header.has_point_times, (1e-9 / duration_s) as f32);
        let without_s = (span_s - duration_s).max(0.0);
        let knots_in =
            |time_s: f64, most: usize| ((time_s / knot_interval_s).round() as usize).clamp(1, most);
        let most = MAX_INTERVALS;
        let (lead_s, intervals) = match has_point_times {
            false => (0.0, 1),
            // Scans are missing: what the sensor did meanwhile is one interval, and the scan's own
            // motion is cut as finely as ever.
            true if without_s > LEAD_SHARE * duration_s => {
                (without_s, 1 + knots_in(duration_s, most - 1))
            }
            true => (0.0, knots_in(span_s, most)),
        };
        Self {
            start,
            span_s,
            lead_s,
            intervals,
            from: if lead_s > 0.0 {
                0.0
            } else {
                without_s / span_s
            },
            per_ns,
            has_point_times,
        }
    }

    /// How many intervals lie before the scan.
    pub fn leads(&self) -> usize {
        usize::from(self.lead_s > 0.0)
    }

    /// Of the chain's poses those of the scan itself.
    pub fn own<'a>(&self, poses: &'a [Pose]) -> &'a [Pose] {
        &poses[self.leads().min(poses.len() - 1)..]
    }

    /// When the chain's `i`-th knot is.
    pub fn knot(&self, i: usize) -> Stamp {
        let lead = self.leads();
        let after = match i.checked_sub(lead) {
            None => 0.0,
            Some(i) => {
                let share = i as f64 / (self.intervals - lead) as f64;
                self.lead_s + (self.span_s - self.lead_s) * share
            }
        };
        self.start + (after * 1e9).round() as i64
    }
}
