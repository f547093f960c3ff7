//! What a camera streams: Z16 depth, YUYV colour, and the metadata beside each.
//!
//! In: the payload of one video buffer. Out: counts or colours, row by row. A payload that is
//! shorter than its format is refused whole; what follows the picture (padding) is not looked at.

mod color;
mod depth;
pub(crate) mod metadata;

pub use color::{YuyvImage, rgb_of_yuv};
pub use depth::Z16Image;
pub use metadata::{
    CaptureTiming, DepthState, FrameMetadata, METADATA_COLOR_LEN, METADATA_DEPTH_LEN, MetadataError,
};

/// Two bytes a pixel in both formats.
pub const BYTES_PER_PIXEL: usize = 2;

/// Size of a picture and how its rows lie in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Layout {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// From one row's first byte to the next row's, bytes; rows may be padded.
    pub stride: u32,
}

impl Layout {
    /// A picture whose rows follow each other without a gap.
    pub const fn packed(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            stride: width.saturating_mul(BYTES_PER_PIXEL as u32),
        }
    }

    /// How many pixels there are.
    pub const fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Bytes of one row without its padding.
    const fn row_len(&self) -> usize {
        self.width as usize * BYTES_PER_PIXEL
    }

    /// Bytes of a buffer that holds the picture: the last row may lack its padding.
    ///
    /// # Errors
    /// No picture lies like this: rows that overlap, no pixels, or more than any camera has.
    pub fn buffer_len(&self) -> Result<usize, FrameError> {
        /// Far more than the largest picture of these cameras (1920 x 1080).
        const MOST_SIDE: u32 = 8_192;
        let side = 1..=MOST_SIDE;
        let stride = self.stride as usize;
        let fits = side.contains(&self.width)
            && side.contains(&self.height)
            && (self.row_len()..=MOST_SIDE as usize * BYTES_PER_PIXEL).contains(&stride);
        if fits {
            Ok((self.height as usize - 1) * stride + self.row_len())
        } else {
            Err(FrameError::Layout { layout: *self })
        }
    }

    fn check(&self, bytes: &[u8]) -> Result<(), FrameError> {
        let (got, needed) = (bytes.len(), self.buffer_len()?);
        if got < needed {
            return Err(FrameError::Length { got, needed });
        }
        Ok(())
    }

    /// The rows of a buffer that was checked.
    fn rows<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let (row_len, stride) = (self.row_len(), self.stride as usize);
        (0..self.height as usize).map(move |row| &bytes[row * stride..][..row_len])
    }
}

/// Why a picture was refused, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The buffer ends before the picture does: the transfer was cut.
    #[error("{got} bytes of a picture that has {needed}")]
    Length {
        /// Bytes of the buffer.
        got: usize,
        /// Bytes of the picture.
        needed: usize,
    },
    /// No picture lies like this.
    #[error(
        "{} x {} pixels with {} bytes a row are no picture",
        layout.width, layout.height, layout.stride
    )]
    Layout {
        /// What was said.
        layout: Layout,
    },
    /// The target has another number of pixels.
    #[error("room for {got} values where the picture has {needed}")]
    Target {
        /// Values that there is room for.
        got: usize,
        /// Values of the picture.
        needed: usize,
    },
}
