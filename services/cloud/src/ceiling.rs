//! Ceiling removal: indoors, one corridor's ceiling looks like the next one's, and in a descriptor
//! of greatest heights it hides everything below.
//!
//! In: points and the transform to the footprint frame. Out: labels [`Reason::Ceiling`] and the
//! ceiling's height. A ceiling is a height at which points cover an *area* with nothing below it
//! and next to nothing above; walls cover lines and go on below, trees are thick. So the histogram
//! counts, for each 10 cm of height, not points but the squares they fall into that are empty for
//! a metre below. Outdoors no height passes and the cloud is left alone.

use alloc::vec::Vec;

use hachi_hal::{Point, Pose};

use crate::crop::Rows;
use crate::float::floor_i32;
use crate::label::Reason;

const LAYER_M: f32 = 0.1;
/// Up to 12 m: the highest halls whose ceiling a 15-degree beam meets within 40 m.
const LAYERS: usize = 120;
const SQUARE_M: f32 = 0.5;
/// Squares along one side of the area looked at, one bit each: 32 m to each side.
const SIDE: usize = 128;
/// Lower than a door's height nothing is a ceiling.
const LOWEST_M: f32 = 1.9;
/// Layers below a pair that have to be empty, the one just below (noise) left out.
const EMPTY_BELOW: core::ops::RangeInclusive<usize> = 2..=11;
/// Squares a ceiling covers: 5 m².
const MIN_SQUARES: u32 = 20;
/// And this many times what hangs free in the layers below: lamps, table tops, shelves.
const CONTRAST: u32 = 3;
/// Share of the cloud's points that may lie above the ceiling (mirror images in polished floors
/// and glass, skylights).
const MAX_ABOVE: f32 = 0.02;
/// Lamps, detectors and the ceiling's own unevenness.
const MARGIN_M: f32 = 0.15;

/// The squares of one layer, a row of them in each number.
type Layer = [u128; SIDE];

/// Finds and labels the ceiling. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct CeilingFilter {
    layers: Vec<Layer>,
}

impl CeilingFilter {
    /// Labels kept points at the ceiling or above it, and returns the ceiling's height over the
    /// footprint plane in metres; `None`, and no label, where there is no ceiling.
    pub fn label(
        &mut self,
        points: &[Point],
        footprint_from_lidar: &Pose,
        labels: &mut [Reason],
    ) -> Option<f32> {
        let rows = Rows::from_pose(footprint_from_lidar);
        let ceiling = self.find(points, &rows, labels)?;
        let lowest = ceiling - MARGIN_M;
        for (point, label) in points.iter().zip(labels) {
            if label.is_kept() && rows.apply(point.position())[2] >= lowest {
                *label = Reason::Ceiling;
            }
        }
        Some(ceiling)
    }

    fn find(&mut self, points: &[Point], rows: &Rows, labels: &[Reason]) -> Option<f32> {
        self.layers.clear();
        self.layers.resize(LAYERS, [0; SIDE]);
        let mut counts = [0u32; LAYERS + 1];
        let mut total = 0u32;
        for (point, _) in points.iter().zip(labels).filter(|(_, l)| l.is_kept()) {
            let [x, y, z] = rows.apply(point.position());
            total += 1;
            let Ok(layer) = usize::try_from(floor_i32(z / LAYER_M)) else {
                continue;
            };
            counts[layer.min(LAYERS)] += 1;
            if let (Some(column), Some(row)) = (square(x), square(y))
                && let Some(layer) = self.layers.get_mut(layer)
            {
                layer[row] |= 1 << column;
            }
        }
        let layer = self.highest_area(&counts, total)?;
        Some((layer as f32 + 0.5) * LAYER_M)
    }

    /// The highest layer that covers an area and has almost nothing above.
    fn highest_area(&self, counts: &[u32; LAYERS + 1], total: u32) -> Option<usize> {
        let lowest = (LOWEST_M / LAYER_M) as usize;
        let allowed = (total as f32 * MAX_ABOVE) as u32;
        let mut above = counts[LAYERS];
        // A ceiling may lie on the border between two layers: look at pairs.
        for layer in (lowest..LAYERS - 1).rev() {
            if above > allowed {
                return None;
            }
            let here = self.hanging(layer);
            if here >= MIN_SQUARES {
                let below = (2..=6).map(|k| self.hanging(layer - k)).sum::<u32>() / 5;
                if here >= CONTRAST * below {
                    let lower_has_more = counts[layer] > counts[layer + 1];
                    return Some(if lower_has_more { layer } else { layer + 1 });
                }
            }
            above += counts[layer + 1];
        }
        None
    }

    /// Squares of a layer and the one above it with nothing for a metre below.
    fn hanging(&self, layer: usize) -> u32 {
        let in_row = |row: usize| {
            let here = self.layers[layer][row] | self.layers[layer + 1][row];
            let below = EMPTY_BELOW
                .filter(|k| *k <= layer)
                .fold(0, |below, k| below | self.layers[layer - k][row]);
            (here & !below).count_ones()
        };
        (0..SIDE).map(in_row).sum()
    }
}

/// The square that holds a coordinate.
fn square(coordinate_m: f32) -> Option<usize> {
    let index = floor_i32(coordinate_m / SQUARE_M).saturating_add(SIDE as i32 / 2);
    usize::try_from(index).ok().filter(|i| *i < SIDE)
}
