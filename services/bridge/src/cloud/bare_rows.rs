//! Scans without a header: rows of little-endian f32, nothing else.
//!
//! KITTI's odometry development kit lays out x, y, z, intensity; submaps and exported clouds often
//! come as x, y, z alone. Nothing in the file says which: its size and the fourth column do.

use hachi_hal::Point;

use super::layout::Layout;
use super::scalar::{Column, Scalar};
use super::{CloudDecoder, CloudInfo, MAX_POINTS};
use crate::error::CloudError;

/// Bytes of a row with an intensity, and of one without.
const WITH_INTENSITY: usize = 16;
const POSITION_ALONE: usize = 12;

/// Fewer rows than this do not tell an intensity from a coordinate.
const TELLING_ROWS: usize = 16;

/// The largest intensity any sensor gives (16 bits).
const MOST_INTENSE: f32 = 65_535.0;

/// Whether a file of this size can hold whole rows of either kind.
pub(crate) fn fits(size: u64) -> bool {
    size.is_multiple_of(WITH_INTENSITY as u64) || size.is_multiple_of(POSITION_ALONE as u64)
}

/// Appends the points of one file.
pub(super) fn read(
    bytes: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let layout = layout_of(bytes)?;
    let count = (bytes.len() / layout.stride) as u64;
    if count > MAX_POINTS {
        return Err(CloudError::TooLarge {
            what: "the number of points",
            seen: count,
            limit: MAX_POINTS,
        });
    }
    points.reserve(bytes.len() / layout.stride);
    Ok(decoder.decode(&layout, bytes.chunks_exact(layout.stride), points))
}

/// Which rows a file holds.
///
/// Where the size allows both, or only rows without intensity, the fourth column decides: read in
/// rows of four, a file of bare positions shows coordinates there, some of them negative. A file
/// whose fourth column reads like intensities but that ends inside a row was cut short.
fn layout_of(bytes: &[u8]) -> Result<Layout, CloudError> {
    let four = bytes.len().is_multiple_of(WITH_INTENSITY);
    let three = bytes.len().is_multiple_of(POSITION_ALONE);
    let cut = CloudError::Rows {
        got: bytes.len() as u64,
        row: WITH_INTENSITY,
    };
    match (four, three) {
        (true, false) => Ok(rows(WITH_INTENSITY)),
        (true, true) if fourth_column_is_intensity(bytes) => Ok(rows(WITH_INTENSITY)),
        (false, true)
            if bytes.len() >= TELLING_ROWS * WITH_INTENSITY
                && fourth_column_is_intensity(bytes) =>
        {
            Err(cut)
        }
        (_, true) => Ok(rows(POSITION_ALONE)),
        (false, false) => Err(cut),
    }
}

fn fourth_column_is_intensity(bytes: &[u8]) -> bool {
    bytes.chunks_exact(WITH_INTENSITY).all(|row| {
        let value = f32::from_le_bytes([row[12], row[13], row[14], row[15]]);
        // Not a number says nothing either way.
        value.is_nan() || (0.0..=MOST_INTENSE).contains(&value)
    })
}

const fn rows(stride: usize) -> Layout {
    Layout {
        stride,
        position: [float_at(0), float_at(4), float_at(8)],
        intensity: if stride == WITH_INTENSITY {
            Some(float_at(12))
        } else {
            None
        },
        ring: None,
        time: None,
        azimuth_deg: None,
        distance_m: None,
        return_type: None,
    }
}

const fn float_at(offset: usize) -> Column {
    Column {
        offset,
        scalar: Scalar::F32,
        big_endian: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes_of(rows: &[&[f32]]) -> Vec<u8> {
        rows.iter()
            .flat_map(|row| row.iter().flat_map(|v| v.to_le_bytes()))
            .collect()
    }

    fn read_all(bytes: &[u8]) -> Result<Vec<Point>, CloudError> {
        let mut points = Vec::new();
        read(bytes, &mut CloudDecoder::default(), &mut points)?;
        Ok(points)
    }

    #[test]
    fn twelve_rows_of_four_and_sixteen_of_three_are_told_apart() {
        let four: Vec<u8> = bytes_of(&[&[1.0, -2.0, 3.0, 0.5]]).repeat(12);
        let three: Vec<u8> = bytes_of(&[&[1.0, -2.0, 3.0]]).repeat(16);
        assert_eq!(four.len(), three.len());
        let (four, three) = (read_all(&four).unwrap(), read_all(&three).unwrap());
        assert_eq!((four.len(), three.len()), (12, 16));
        for point in four.iter().chain(&three) {
            assert_eq!(point.position(), [1.0, -2.0, 3.0]);
        }
    }

    #[test]
    fn a_scan_cut_inside_a_row_is_refused_even_if_its_size_would_fit_bare_positions() {
        let whole = bytes_of(&[&[1.0, -2.0, 3.0, 0.5]]).repeat(100);
        let cut = &whole[..12 * 101];
        assert!(!cut.len().is_multiple_of(16));
        assert!(matches!(read_all(cut), Err(CloudError::Rows { .. })));
        assert!(matches!(
            read_all(&whole[..17]),
            Err(CloudError::Rows { .. })
        ));
    }
}
