//! YUYV: two pixels in four bytes (luma, blue difference, luma, red difference).

use super::{FrameError, Layout};

/// A colour image as it lies in a buffer.
#[derive(Debug, Clone, Copy)]
pub struct YuyvImage<'a> {
    bytes: &'a [u8],
    layout: Layout,
}

/// Red, green, blue of a colour in ITU-R BT.601 studio range (luma 16 to 235, differences around
/// 128), which is what USB video is in unless it says otherwise (UVC 1.5, section 3.9.2.6).
///
/// In whole numbers: the coefficients are 255/219 and 255/224 times those of the standard, in
/// 256ths.
pub const fn rgb_of_yuv(y: u8, u: u8, v: u8) -> [u8; 3] {
    let luma = 298 * (y as i32 - 16) + 128;
    let (blue, red) = (u as i32 - 128, v as i32 - 128);
    [
        clamped((luma + 409 * red) >> 8),
        clamped((luma - 100 * blue - 208 * red) >> 8),
        clamped((luma + 516 * blue) >> 8),
    ]
}

const fn clamped(value: i32) -> u8 {
    if value < 0 {
        0
    } else if value > 255 {
        255
    } else {
        value as u8
    }
}

impl<'a> YuyvImage<'a> {
    /// A view of `bytes`.
    ///
    /// # Errors
    /// The buffer is too short for the layout, or the layout is none: rows have whole pairs.
    pub fn new(bytes: &'a [u8], layout: Layout) -> Result<Self, FrameError> {
        if !layout.width.is_multiple_of(2) {
            return Err(FrameError::Layout { layout });
        }
        layout.check(bytes)?;
        Ok(Self { bytes, layout })
    }

    /// All pixels, row by row, red, green, blue, into `rgb`.
    ///
    /// # Errors
    /// `rgb` has less room than three bytes a pixel.
    pub fn to_rgb(&self, rgb: &mut [u8]) -> Result<(), FrameError> {
        let (got, needed) = (rgb.len(), 3 * self.layout.pixels());
        let Some(rgb) = rgb.get_mut(..needed) else {
            return Err(FrameError::Target { got, needed });
        };
        let rows = rgb.chunks_exact_mut(3 * self.layout.width as usize);
        for (target, row) in rows.zip(self.layout.rows(self.bytes)) {
            for (pair, yuyv) in target.chunks_exact_mut(6).zip(row.chunks_exact(4)) {
                let [y0, u, y1, v] = [yuyv[0], yuyv[1], yuyv[2], yuyv[3]];
                pair[..3].copy_from_slice(&rgb_of_yuv(y0, u, v));
                pair[3..].copy_from_slice(&rgb_of_yuv(y1, u, v));
            }
        }
        Ok(())
    }
}
