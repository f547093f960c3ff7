//! Pixels to draw on. What lies outside is not drawn.

use hachi_inference::ImageView;
use hachi_people::BoundingBox;

use super::font;
use crate::images::Rgb;

/// Red, green, blue.
pub(super) type Color = [u8; 3];

/// How much of a tint covers what is below it.
const TINT: f32 = 0.45;
/// Pixels of a letter's dot.
const DOT: usize = 2;

pub(super) struct Canvas(Rgb);

impl Canvas {
    pub fn of(image: &ImageView<'_>) -> Self {
        Self(Rgb {
            width: image.width(),
            height: image.height(),
            pixels: image.rgb().to_vec(),
        })
    }

    pub fn blank([width, height]: [usize; 2], color: Color) -> Self {
        Self(Rgb {
            width,
            height,
            pixels: color.repeat(width * height),
        })
    }

    pub fn done(self) -> Rgb {
        self.0
    }

    fn pixel(&mut self, x: usize, y: usize) -> Option<&mut [u8]> {
        let Rgb { width, height, .. } = self.0;
        let at = 3 * (y * width + x);
        (x < width && y < height).then(|| &mut self.0.pixels[at..at + 3])
    }

    fn set(&mut self, x: usize, y: usize, color: Color) {
        if let Some(pixel) = self.pixel(x, y) {
            pixel.copy_from_slice(&color);
        }
    }

    /// Tints what a mask covers within a box.
    pub fn tint(&mut self, b: &BoundingBox, color: Color, covers: impl Fn([f64; 2]) -> bool) {
        let [columns, rows] = self.pixels_of(b);
        for y in rows {
            for x in columns.clone() {
                if !covers([x as f64 + 0.5, y as f64 + 0.5]) {
                    continue;
                }
                if let Some(pixel) = self.pixel(x, y) {
                    for (channel, tint) in pixel.iter_mut().zip(color) {
                        let mixed = f32::from(*channel) * (1.0 - TINT) + f32::from(tint) * TINT;
                        *channel = mixed as u8;
                    }
                }
            }
        }
    }

    /// The edge of a box, so many pixels wide, inside it.
    pub fn frame(&mut self, b: &BoundingBox, color: Color, wide: usize) {
        let [columns, rows] = self.pixels_of(b);
        for y in rows.clone() {
            for x in columns.clone() {
                let near = |at: usize, range: &std::ops::Range<usize>| {
                    at < range.start + wide || at + wide >= range.end
                };
                if near(x, &columns) || near(y, &rows) {
                    self.set(x, y, color);
                }
            }
        }
    }

    /// A word above a place, on dark ground.
    pub fn label(&mut self, [left, top]: [f64; 2], text: &str, color: Color) {
        if text.is_empty() {
            return;
        }
        let [columns, rows] = font::SIZE;
        let size = [
            (text.chars().count() * (columns + 1) + 1) * DOT,
            (rows + 2) * DOT,
        ];
        let room = [self.0.width, self.0.height];
        let x = (left.max(0.0) as usize).min(room[0].saturating_sub(size[0]));
        let y = (top.max(0.0) as usize).saturating_sub(size[1]);
        for row in 0..size[1] {
            for column in 0..size[0] {
                self.set(x + column, y + row, [20; 3]);
            }
        }
        for (index, letter) in text.chars().enumerate() {
            let dots = font::dots(letter);
            let begin = x + (index * (columns + 1) + 1) * DOT;
            for row in 0..rows * DOT {
                for column in 0..columns * DOT {
                    if font::is_set(dots, column / DOT, row / DOT) {
                        self.set(begin + column, y + DOT + row, color);
                    }
                }
            }
        }
    }

    /// Another picture, its upper left corner at a place.
    pub fn paste(&mut self, picture: &Rgb, [left, top]: [usize; 2]) {
        for y in 0..picture.height {
            for x in 0..picture.width {
                let at = 3 * (y * picture.width + x);
                let color = [0, 1, 2].map(|channel| picture.pixels[at + channel]);
                self.set(left + x, top + y, color);
            }
        }
    }

    /// The pixels of a box that lie in the picture.
    fn pixels_of(&self, b: &BoundingBox) -> [std::ops::Range<usize>; 2] {
        // The conversions saturate.
        let span = |from: f64, to: f64, most: usize| {
            let first = (from.round().max(0.0) as usize).min(most);
            first..(to.round().max(0.0) as usize).clamp(first, most)
        };
        [
            span(b.left, b.right(), self.0.width),
            span(b.top, b.bottom(), self.0.height),
        ]
    }
}
