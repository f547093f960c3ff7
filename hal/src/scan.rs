//! One turn of a LiDAR: what is true of all its points.

use crate::Stamp;

/// Whether a scan is a whole turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Completeness {
    /// From cut angle to cut angle (packets may still be missing inside: see the drop counts).
    #[default]
    Complete,
    /// The stream was joined in the middle of this turn: its beginning is missing.
    PartialFirst,
    /// The stream ended in the middle of this turn: its end is missing.
    PartialLast,
    /// The stream was joined and ended inside one turn.
    PartialBoth,
}

/// What is true of all points of one scan.
///
/// The scan's pose is, by convention, its pose at [`ScanHeader::end`], the time of the last point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ScanHeader {
    /// Counts scans from 0 in the order the source produced them.
    pub sequence: u32,
    /// Robot-clock time of the first point; `Point::time_offset_ns` counts from here.
    pub start: Stamp,
    /// Robot-clock time of the last point.
    pub end: Stamp,
    /// The sensor's own time of the first point, ns on the sensor's clock, where it has one.
    pub sensor_start_ns: Option<u64>,
    /// Whether this is a whole turn.
    pub completeness: Completeness,
    /// Whether the points carry real time offsets. If not, all are zero and the scan is taken as
    /// measured at `end`.
    pub has_point_times: bool,
}
