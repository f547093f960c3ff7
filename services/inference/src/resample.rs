//! An image, or a part of it, at another size.
//!
//! In: RGB pixels and a region. Out: RGB in whole numbers, as networks saw them when they were
//! trained. Each output pixel is a sum of the pixels around it, weighted by a triangle: one pixel
//! wide on either side as in OpenCV's `INTER_LINEAR`, or, for images that shrink, as wide as a pixel
//! of the output, as in Pillow's `BILINEAR`. Columns and rows are summed one after the other, and
//! either sum is rounded to a whole number with halves up, as in Pillow; OpenCV rounds once, at the
//! end, which can differ from this by one.
//!
//! Libraries for this instantiate themselves for every type of pixel in the crate that calls them,
//! which took longer to build than everything else here.

use crate::preprocess::{ImageView, Region};

/// Which source pixels one output pixel is made of.
#[derive(Debug, Clone, Default)]
struct Taps {
    /// First source pixel, and where its weights begin, for each output pixel; one more at the end.
    begin: Vec<(usize, usize)>,
    weights: Vec<f32>,
}

impl Taps {
    /// `length` output pixels from `[from, from + extent)` of `source` pixels.
    fn plan(&mut self, source: usize, from: f64, extent: f64, length: usize, smooth: bool) {
        self.begin.clear();
        self.weights.clear();
        let step = extent / length as f64;
        let reach = if smooth { step.max(1.0) } else { 1.0 };
        // The region's own edge is where the picture ends: what lies beyond is not looked at.
        let first = from.floor() as usize;
        let last = ((from + extent).ceil() as usize).clamp(first + 1, source);
        for place in 0..length {
            let middle = from + (place as f64 + 0.5) * step - 0.5;
            let low = ((middle - reach).ceil().max(first as f64) as usize).min(last - 1);
            let high = ((middle + reach).floor().max(low as f64) as usize).min(last - 1);
            let begin = self.weights.len();
            self.begin.push((low, begin));
            for pixel in low..=high {
                let weight = (1.0 - (pixel as f64 - middle).abs() / reach).max(0.0);
                self.weights.push(weight as f32);
            }
            let sum: f32 = self.weights[begin..].iter().sum();
            match sum > 0.0 {
                true => self.weights[begin..].iter_mut().for_each(|w| *w /= sum),
                false => self.weights[begin] = 1.0, // beyond the edge: the edge itself
            }
        }
        self.begin.push((0, self.weights.len()));
    }

    /// First source pixel and weights of an output pixel.
    fn of(&self, place: usize) -> (usize, &[f32]) {
        let (first, begin) = self.begin[place];
        (first, &self.weights[begin..self.begin[place + 1].1])
    }
}

/// Resizes; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Resampler {
    across: Taps,
    down: Taps,
    /// Source rows at the output's width.
    rows: Vec<f32>,
    pixels: Vec<f32>,
}

impl Resampler {
    /// The region, which lies in the image, as `width` x `height` RGB pixels.
    pub(crate) fn resize(
        &mut self,
        image: &ImageView<'_>,
        region: &Region,
        [width, height]: [usize; 2],
        smooth: bool,
    ) -> &[f32] {
        self.across
            .plan(image.width(), region.left, region.width, width, smooth);
        self.down
            .plan(image.height(), region.top, region.height, height, smooth);
        let first_row = (0..height).map(|y| self.down.of(y).0).min().unwrap_or(0);
        let end_row = (0..height).map(|y| self.down.of(y).0 + self.down.of(y).1.len());
        let end_row = end_row.max().unwrap_or(0);
        self.rows.clear();
        self.rows.resize(3 * width * (end_row - first_row), 0.0);
        for (row, target) in (first_row..end_row).zip(self.rows.chunks_exact_mut(3 * width)) {
            let source = &image.rgb()[3 * row * image.width()..3 * (row + 1) * image.width()];
            for (x, target) in target.chunks_exact_mut(3).enumerate() {
                let (first, weights) = self.across.of(x);
                for (pixel, weight) in source[3 * first..].chunks_exact(3).zip(weights) {
                    for (sum, value) in target.iter_mut().zip(pixel) {
                        *sum += weight * f32::from(*value);
                    }
                }
                target.iter_mut().for_each(round);
            }
        }
        self.pixels.clear();
        self.pixels.resize(3 * width * height, 0.0);
        for (y, target) in self.pixels.chunks_exact_mut(3 * width).enumerate() {
            let (first, weights) = self.down.of(y);
            let rows = self.rows[3 * width * (first - first_row)..].chunks_exact(3 * width);
            for (row, weight) in rows.zip(weights) {
                for (sum, value) in target.iter_mut().zip(row) {
                    *sum += weight * value;
                }
            }
            target.iter_mut().for_each(round);
        }
        &self.pixels
    }
}

fn round(value: &mut f32) {
    *value = (*value + 0.5).floor();
}
