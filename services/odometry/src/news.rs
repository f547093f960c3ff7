//! Whether a scan shows the map anything new.
//!
//! In: where and when each scan was taken. Out: whether it becomes part of the local map. While the robot
//! stands scans only repeat each other; cells beside it are filled by one of them, and a map made of the
//! last few moves along with whatever pulls on it: a robot that stood in a doorway for half a minute
//! drifted by 10 cm.

use hachi_hal::{Pose, Stamp, Vector3};

/// A map's first scans are always news.
const FIRST_SCANS: u32 = 12;
/// Afterwards those that were taken so far from the last one that was, metres and radians,
const NEWS_M: f64 = 0.04;
const NEWS_RAD: f64 = 0.02;
/// or so long after it, ns: what has moved shows in seconds.
const NEWS_NS: i64 = 2_000_000_000;

/// Where and when the scan was taken that became part of the map last.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct News(Option<(Pose, Stamp)>);

impl News {
    /// Whether a scan that ended at `pose` is to become part of a map of so many scans.
    pub(crate) fn are_seen(&self, map_scans: u32, pose: &Pose, end: Stamp) -> bool {
        map_scans < FIRST_SCANS
            || self.0.is_none_or(|(last, stamp)| {
                let moved = last.inv_mul(pose);
                moved.translation.vector.norm() >= NEWS_M
                    || moved.rotation.angle() >= NEWS_RAD
                    || end.nanos_since(stamp) >= NEWS_NS
            })
    }

    /// A scan became part of the map.
    pub(crate) fn remember(&mut self, pose: Pose, end: Stamp) {
        self.0 = Some((pose, end));
    }

    /// Moves with the map's origin.
    pub(crate) fn translate(&mut self, by: &Vector3) {
        if let Some((pose, _)) = &mut self.0 {
            pose.translation.vector += by;
        }
    }
}
