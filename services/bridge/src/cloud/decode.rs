//! Rows of bytes to points, whatever the format around them.

use hachi_hal::{Point, ReturnKind};

use super::CloudInfo;
use super::layout::Layout;
use super::point_times::{PointTimes, TimeReader};

/// What a stream of clouds settles once, and the memory it reuses.
///
/// Intensities written as floats come in two scales. hal's is 0 to 255; a stream whose first
/// cloud with any intensity has none above 1 is taken to be in 0 to 1 and is multiplied by 255.
#[derive(Debug, Default)]
pub struct CloudDecoder {
    intensity_scale: Option<f32>,
    times: TimeReader,
    /// One point rebuilt from text or from a file with gaps.
    pub(super) row: Vec<u8>,
    /// A decompressed body.
    pub(super) body: Vec<u8>,
}

impl CloudDecoder {
    /// What intensities are multiplied by: 1 or 255, `None` before a cloud has settled it.
    pub fn intensity_scale(&self) -> Option<f32> {
        self.intensity_scale
    }

    /// Appends the points that `rows` hold, then orders them by time and states what they share.
    /// Each row holds at least `layout.stride` bytes.
    pub(crate) fn decode<'a>(
        &mut self,
        layout: &Layout,
        rows: impl Iterator<Item = &'a [u8]>,
        points: &mut Vec<Point>,
    ) -> CloudInfo {
        self.begin();
        for row in rows {
            self.push(layout, row, points);
        }
        self.finish(layout, points)
    }

    /// Starts a cloud.
    pub(super) fn begin(&mut self) {
        self.times.clear();
    }

    /// Appends one point.
    pub(super) fn push(&mut self, layout: &Layout, row: &[u8], points: &mut Vec<Point>) {
        let [x, y, z] = layout.position;
        let mut point = Point::at(x.f32(row), y.f32(row), z.f32(row));
        if let Some(column) = layout.intensity {
            point.intensity = column.f32(row);
        }
        if let Some(column) = layout.ring {
            point.ring = column.i64(row).clamp(0, i64::from(u16::MAX)) as u16;
        }
        if let Some(column) = layout.azimuth_deg {
            point.azimuth_deg = column.f32(row);
        }
        if let Some(column) = layout.distance_m {
            point.range_m = column.f32(row);
        }
        if let Some(column) = layout.return_type {
            point.returned = return_kind(column.i64(row));
        }
        if let Some(column) = layout.time {
            self.times.push(column, row);
        }
        points.push(point);
    }

    /// Ends a cloud whose points are all of `points`.
    pub(super) fn finish(&mut self, layout: &Layout, points: &mut [Point]) -> CloudInfo {
        if layout
            .intensity
            .is_some_and(|column| column.scalar.is_float())
        {
            self.scale_intensity(points);
        }
        let times = self
            .times
            .finish(|index, offset| points[index].time_offset_ns = offset);
        match times {
            PointTimes::Relative(..) | PointTimes::Absolute(..) => {
                if !points.is_sorted_by_key(|point| point.time_offset_ns) {
                    points.sort_by_key(|point| point.time_offset_ns);
                }
            }
            PointTimes::None | PointTimes::Same(_) => {
                for point in points.iter_mut() {
                    point.time_offset_ns = 0;
                }
            }
        }
        CloudInfo {
            points: points.len(),
            non_finite: points.iter().filter(|point| !point.is_finite()).count(),
            times,
        }
    }

    fn scale_intensity(&mut self, points: &mut [Point]) {
        if self.intensity_scale.is_none() {
            let strongest = points
                .iter()
                .map(|point| point.intensity)
                .fold(0.0, f32::max);
            self.intensity_scale = match strongest {
                s if s <= 0.0 => None,
                s if s <= 1.0 => Some(255.0),
                _ => Some(1.0),
            };
        }
        let scale = self.intensity_scale.unwrap_or(1.0);
        if scale != 1.0 {
            for point in points {
                point.intensity *= scale;
            }
        }
    }
}

/// The number that this program's own files give a return.
fn return_kind(number: i64) -> ReturnKind {
    match number {
        1 => ReturnKind::Strongest,
        2 => ReturnKind::Last,
        3 => ReturnKind::First,
        4 => ReturnKind::StrongestAndLast,
        5 => ReturnKind::SecondStrongest,
        _ => ReturnKind::Unknown,
    }
}
