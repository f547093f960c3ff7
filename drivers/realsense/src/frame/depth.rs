//! Z16: sixteen bits a pixel, little-endian, times the depth unit; 0 is "nothing measured".

use super::{BYTES_PER_PIXEL, FrameError, Layout};

/// A depth image as it lies in a buffer.
#[derive(Debug, Clone, Copy)]
pub struct Z16Image<'a> {
    bytes: &'a [u8],
    layout: Layout,
}

impl<'a> Z16Image<'a> {
    /// A view of `bytes`.
    ///
    /// # Errors
    /// The buffer is too short for the layout, or the layout is none.
    pub fn new(bytes: &'a [u8], layout: Layout) -> Result<Self, FrameError> {
        layout.check(bytes)?;
        Ok(Self { bytes, layout })
    }

    /// The count at a pixel; `None` outside the picture.
    pub fn count(&self, column: u32, row: u32) -> Option<u16> {
        let inside = column < self.layout.width && row < self.layout.height;
        let at = row as usize * self.layout.stride as usize + column as usize * BYTES_PER_PIXEL;
        inside.then(|| crate::bytes::u16_at(self.bytes, at))
    }

    /// The depth at a pixel, metres; `None` outside the picture and where nothing was measured.
    pub fn metres(&self, column: u32, row: u32, depth_unit_m: f64) -> Option<f64> {
        let count = self.count(column, row).filter(|&count| count != 0)?;
        Some(f64::from(count) * depth_unit_m)
    }

    /// All counts, row by row, into `counts`.
    ///
    /// # Errors
    /// `counts` has less room than the picture has pixels.
    pub fn copy_to(&self, counts: &mut [u16]) -> Result<(), FrameError> {
        let (got, needed) = (counts.len(), self.layout.pixels());
        let Some(counts) = counts.get_mut(..needed) else {
            return Err(FrameError::Target { got, needed });
        };
        let rows = counts.chunks_exact_mut(self.layout.width as usize);
        for (target, row) in rows.zip(self.layout.rows(self.bytes)) {
            for (count, pixel) in target.iter_mut().zip(row.chunks_exact(2)) {
                *count = u16::from_le_bytes([pixel[0], pixel[1]]);
            }
        }
        Ok(())
    }
}
