//! KITTI's scans: rows of x, y, z, intensity as little-endian f32, nothing else.
//!
//! The layout is the one of the KITTI odometry development kit. There is no header: that a file
//! holds whole rows is all that can be checked.

use hachi_hal::Point;

use super::layout::Layout;
use super::scalar::{Column, Scalar};
use super::{CloudDecoder, CloudInfo, MAX_POINTS};
use crate::error::CloudError;

/// Bytes of one row.
const ROW: usize = 16;

const LAYOUT: Layout = Layout {
    stride: ROW,
    position: [float_at(0), float_at(4), float_at(8)],
    intensity: Some(float_at(12)),
    ring: None,
    time: None,
    azimuth_deg: None,
    distance_m: None,
    return_type: None,
};

const fn float_at(offset: usize) -> Column {
    Column {
        offset,
        scalar: Scalar::F32,
        big_endian: false,
    }
}

/// Appends the points of one file.
pub(super) fn read(
    bytes: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    if !bytes.len().is_multiple_of(ROW) {
        return Err(CloudError::Rows {
            got: bytes.len() as u64,
            row: ROW,
        });
    }
    let count = (bytes.len() / ROW) as u64;
    if count > MAX_POINTS {
        return Err(CloudError::TooLarge {
            what: "the number of points",
            seen: count,
            limit: MAX_POINTS,
        });
    }
    points.reserve(bytes.len() / ROW);
    Ok(decoder.decode(&LAYOUT, bytes.chunks_exact(ROW), points))
}
