//! `sensor_msgs/PointCloud2`: a table of fields and rows of bytes.

use hachi_hal::{Completeness, Point, ScanHeader, Stamp};

use super::wire::Wire;
use crate::cloud::layout::{Field, Layout};
use crate::cloud::scalar::Scalar;
use crate::cloud::{CloudDecoder, CloudInfo, MAX_POINTS, PointTimes};
use crate::error::{CloudError, DecodeError};

/// More fields than any driver sends; bounds the work of looking for names among them.
const FIELD_LIMIT: usize = 256;
/// Bytes of the smallest field: two lengths, an offset, a type and a count.
const SMALLEST_FIELD: usize = 13;

/// A cloud message, checked: every point and every field used lies inside its data.
#[derive(Debug, Clone)]
pub struct PointCloud2<'a> {
    stamp: Stamp,
    frame_id: &'a str,
    layout: Layout,
    width: usize,
    height: usize,
    row_step: usize,
    data: &'a [u8],
}

impl<'a> PointCloud2<'a> {
    /// The message's own stamp; zero where the driver set none.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// The frame its points are in, as the driver names it.
    pub fn frame_id(&self) -> &'a str {
        self.frame_id
    }

    /// How many points it has.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bytes of each point.
    fn rows(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let (width, height) = (self.width, self.height);
        let (stride, row_step) = (self.layout.stride, self.row_step);
        let data = self.data;
        (0..height).flat_map(move |row| {
            let from = row * row_step;
            data[from..from + width * stride].chunks_exact(stride)
        })
    }
}

/// Turns cloud messages into scans. One for each topic: what the first clouds settle (the
/// intensity's scale, the unit of the times) holds for those that follow.
#[derive(Debug, Default)]
pub struct CloudReader {
    decoder: CloudDecoder,
    sequence: u32,
}

impl CloudReader {
    /// Reads a cloud into `points`, which is cleared first; oldest point first where points carry
    /// times. `received` stamps a message that carries no stamp of its own.
    ///
    /// Times relative to the message count from its stamp, whichever end of the scan that is.
    /// UNIX times are the points' own; if they are from another clock (more than ten seconds off
    /// the message's stamp) the scan ends at the message's stamp and keeps their differences.
    pub fn read(
        &mut self,
        cloud: &PointCloud2<'_>,
        received: Stamp,
        points: &mut Vec<Point>,
    ) -> (ScanHeader, CloudInfo) {
        points.clear();
        points.reserve(cloud.len());
        let info = self.decoder.decode(&cloud.layout, cloud.rows(), points);
        let stamp = if cloud.stamp.as_nanos() == 0 {
            received
        } else {
            cloud.stamp
        };
        let header = header(self.sequence, stamp, info.times);
        self.sequence = self.sequence.wrapping_add(1);
        (header, info)
    }

    /// What intensities are multiplied by: 1 or 255, `None` before a cloud has settled it.
    pub fn intensity_scale(&self) -> Option<f32> {
        self.decoder.intensity_scale()
    }
}

fn header(sequence: u32, stamp: Stamp, times: PointTimes) -> ScanHeader {
    /// A clock that is set agrees with the recording's to better than this, ns.
    const SAME_CLOCK_NS: u64 = 10_000_000_000;
    let (start, end) = match times {
        PointTimes::None | PointTimes::Same(_) => (stamp, stamp),
        PointTimes::Relative(first, last) => (stamp.offset(first), stamp.offset(last)),
        PointTimes::Absolute(first, last) => {
            let end = Stamp::from_nanos(last);
            if end.nanos_since(stamp).unsigned_abs() <= SAME_CLOCK_NS {
                (Stamp::from_nanos(first), end)
            } else {
                (stamp.offset(first.saturating_sub(last)), stamp)
            }
        }
    };
    let absolute = match times {
        PointTimes::Absolute(first, _) => u64::try_from(first).ok(),
        _ => None,
    };
    ScanHeader {
        sequence,
        start,
        end,
        sensor_start_ns: absolute,
        completeness: Completeness::Complete,
        has_point_times: start != end,
    }
}

pub(super) fn parse(mut wire: Wire<'_>) -> Result<PointCloud2<'_>, DecodeError> {
    let header = wire.header()?;
    let height = u64::from(wire.u32()?);
    let width = u64::from(wire.u32()?);
    let field_count = wire.length(SMALLEST_FIELD)?;
    if field_count > FIELD_LIMIT {
        return Err(CloudError::TooLarge {
            what: "the number of fields",
            seen: field_count as u64,
            limit: FIELD_LIMIT as u64,
        }
        .into());
    }
    let mut fields = Vec::with_capacity(field_count);
    for _ in 0..field_count {
        let name = wire.string()?;
        let offset = u64::from(wire.u32()?);
        let datatype = wire.u8()?;
        // COUNT: of a field with several values the first counts.
        wire.u32()?;
        // A field of an unknown type is one that nobody here uses, unless it is missed below.
        if let Some(scalar) = scalar(datatype) {
            fields.push(Field {
                name,
                scalar,
                offset,
            });
        }
    }
    let data_is_big_endian = wire.u8()? != 0;
    let point_step = u64::from(wire.u32()?);
    let row_step = u64::from(wire.u32()?);
    let data = wire.byte_sequence()?;
    let layout = Layout::new(
        fields.iter().copied(),
        point_step as usize,
        data_is_big_endian,
    )?;
    let points = width * height;
    if points > MAX_POINTS {
        return Err(CloudError::TooLarge {
            what: "width times height",
            seen: points,
            limit: MAX_POINTS,
        }
        .into());
    }
    // One row needs no step from row to row, and drivers are careless about it.
    let row_step = if height <= 1 {
        width * point_step
    } else {
        row_step
    };
    let needed = match (width, height) {
        (0, _) | (_, 0) => 0,
        _ => (height - 1)
            .saturating_mul(row_step)
            .saturating_add(width * point_step),
    };
    if needed > data.len() as u64 || row_step < width * point_step {
        return Err(CloudError::Truncated {
            points,
            needed: needed.max(points.saturating_mul(point_step)),
            got: data.len() as u64,
        }
        .into());
    }
    Ok(PointCloud2 {
        stamp: header.stamp,
        frame_id: header.frame_id,
        layout,
        width: width as usize,
        height: if width == 0 { 0 } else { height as usize },
        row_step: row_step as usize,
        data,
    })
}

/// `sensor_msgs/PointField` datatypes.
fn scalar(datatype: u8) -> Option<Scalar> {
    Some(match datatype {
        1 => Scalar::I8,
        2 => Scalar::U8,
        3 => Scalar::I16,
        4 => Scalar::U16,
        5 => Scalar::I32,
        6 => Scalar::U32,
        7 => Scalar::F32,
        8 => Scalar::F64,
        _ => return None,
    })
}
