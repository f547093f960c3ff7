//! An image, or a part of it, as a model's input.
//!
//! In: RGB pixels, and the manifest's [`InputLayout`]. Out: numbers in a slot of the input tensor,
//! and where each pixel went ([`Placement`]), so that what the model answers finds its way back.

use crate::manifest::{Channels, Fit, InputLayout, Layout, Resample};
use crate::resample::Resampler;

/// RGB pixels, 8 bits each, row by row.
#[derive(Debug, Clone, Copy)]
pub struct ImageView<'a> {
    width: usize,
    height: usize,
    rgb: &'a [u8],
}

/// Why pixels are no image, or give no input.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// Not as many bytes as pixels.
    #[error("an image of {width}x{height} takes {expected} bytes, got {got}")]
    Size {
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
        /// Three for each pixel.
        expected: u128,
        /// How many there are.
        got: usize,
    },
    /// Nothing to look at.
    #[error("nothing of the image is left")]
    Empty,
    /// The slot is of another size than the input.
    #[error("the input takes {expected} numbers, the slot has {got}")]
    Slot {
        /// How many it takes.
        expected: usize,
        /// How many there are.
        got: usize,
    },
}

impl<'a> ImageView<'a> {
    /// An image of this size.
    ///
    /// # Errors
    /// Another number of bytes, or no pixel.
    pub fn new(width: usize, height: usize, rgb: &'a [u8]) -> Result<Self, ImageError> {
        let expected = 3 * width as u128 * height as u128;
        if expected != rgb.len() as u128 {
            return Err(ImageError::Size {
                width,
                height,
                expected,
                got: rgb.len(),
            });
        }
        match rgb.is_empty() {
            true => Err(ImageError::Empty),
            false => Ok(Self { width, height, rgb }),
        }
    }

    /// Pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Red, green and blue of each pixel.
    pub fn rgb(&self) -> &'a [u8] {
        self.rgb
    }
}

/// A part of an image, pixels: may stick out of it, and begin and end within a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Region {
    /// The part of it that lies in the image; `None` if that is less than a pixel.
    pub fn within(&self, image: &ImageView<'_>) -> Option<Self> {
        let left = self.left.max(0.0);
        let top = self.top.max(0.0);
        let width = (self.left + self.width).min(image.width as f64) - left;
        let height = (self.top + self.height).min(image.height as f64) - top;
        (width >= 1.0 && height >= 1.0).then_some(Self {
            left,
            top,
            width,
            height,
        })
    }
}

/// Where pixels of the image lie in the input: `input = image * scale + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Along x and y.
    pub scale: [f64; 2],
    /// Along x and y, pixels of the input.
    pub offset: [f64; 2],
}

impl Placement {
    /// A place in the input, as a place in the image.
    pub fn to_image(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            (x - self.offset[0]) / self.scale[0],
            (y - self.offset[1]) / self.scale[1],
        ]
    }

    /// A place in the image, as a place in the input.
    pub fn to_input(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            x * self.scale[0] + self.offset[0],
            y * self.scale[1] + self.offset[1],
        ]
    }
}

/// Resizes and normalises; keeps its buffers.
#[derive(Debug, Default)]
pub struct Preprocessor {
    resampler: Resampler,
}

impl Preprocessor {
    /// Puts a region of the image, or all of it, into the slot of one image of a model's input.
    ///
    /// # Errors
    /// [`ImageError`]: nothing of the region lies in the image, or the slot is of another size.
    pub fn fill(
        &mut self,
        layout: &InputLayout,
        image: &ImageView<'_>,
        region: Option<Region>,
        slot: &mut [f32],
    ) -> Result<Placement, ImageError> {
        let expected = 3 * layout.width * layout.height;
        if slot.len() != expected {
            return Err(ImageError::Slot {
                expected,
                got: slot.len(),
            });
        }
        let whole = Region {
            left: 0.0,
            top: 0.0,
            width: image.width as f64,
            height: image.height as f64,
        };
        let region = region
            .unwrap_or(whole)
            .within(image)
            .ok_or(ImageError::Empty)?;
        let fitted = Fitted::new(layout, &region);
        let smooth = layout.resample == Resample::Smooth;
        let size = [fitted.width, fitted.height];
        let pixels = self.resampler.resize(image, &region, size, smooth);
        normalise(layout, pixels, &fitted, slot);
        Ok(fitted.placement(&region))
    }
}

/// Where the resized image lies in the input.
struct Fitted {
    width: usize,
    height: usize,
    left: usize,
    top: usize,
}

impl Fitted {
    fn new(layout: &InputLayout, region: &Region) -> Self {
        let (width, height) = (layout.width as f64, layout.height as f64);
        let (mut fitted_width, mut fitted_height) = (layout.width, layout.height);
        if layout.fit != Fit::Stretch {
            let scale = (width / region.width).min(height / region.height);
            let side =
                |length: f64, most: usize| ((length * scale).round() as usize).clamp(1, most);
            fitted_width = side(region.width, layout.width);
            fitted_height = side(region.height, layout.height);
        }
        let (mut left, mut top) = (0, 0);
        if layout.fit == Fit::LetterboxCentre {
            left = (layout.width - fitted_width) / 2;
            top = (layout.height - fitted_height) / 2;
        }
        Self {
            width: fitted_width,
            height: fitted_height,
            left,
            top,
        }
    }

    fn placement(&self, region: &Region) -> Placement {
        let scale = [
            self.width as f64 / region.width,
            self.height as f64 / region.height,
        ];
        let offset = [
            self.left as f64 - region.left * scale[0],
            self.top as f64 - region.top * scale[1],
        ];
        Placement { scale, offset }
    }
}

/// Writes pixels as numbers: `(pixel / divide_by - mean) / deviation`.
fn normalise(layout: &InputLayout, pixels: &[f32], fitted: &Fitted, slot: &mut [f32]) {
    let (places, row) = (layout.width * layout.height, layout.width);
    // Where a channel of the input stands from one pixel to the next, and from channel to channel.
    let (pixel_step, channel_step) = match layout.layout {
        Layout::Nchw => (1, places),
        Layout::Nhwc => (3, 1),
    };
    for channel in 0..3 {
        let scale = 1.0 / (layout.divide_by * layout.deviation[channel]);
        let offset = layout.mean[channel] / layout.deviation[channel];
        let number = |pixel: f32| pixel * scale - offset;
        let colour = match layout.channels {
            Channels::Rgb => channel,
            Channels::Bgr => 2 - channel,
        };
        if (fitted.width, fitted.height) != (layout.width, layout.height) {
            let fill = number(f32::from(layout.fill));
            for place in 0..places {
                slot[place * pixel_step + channel * channel_step] = fill;
            }
        }
        for (y, source) in pixels.chunks_exact(3 * fitted.width).enumerate() {
            let begin = (fitted.top + y) * row + fitted.left;
            for (x, pixel) in source.chunks_exact(3).enumerate() {
                let place = (begin + x) * pixel_step + channel * channel_step;
                slot[place] = number(pixel[colour]);
            }
        }
    }
}
