//! Which pixels of a box belong to the person.
//!
//! A mask is a sum of prototypes, shared by the whole image, by the recipe of one box (YOLACT);
//! a pixel belongs to it where the sum is above zero, which is where its sigmoid is above a half.

use hachi_inference::Placement;

use crate::BoundingBox;

/// Prototypes of all masks of an image.
pub(super) struct Prototypes<'a> {
    pub(super) numbers: &'a [f32],
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// From one pixel of a prototype to the next.
    pub(super) pixel_step: usize,
    /// From one prototype to the next.
    pub(super) prototype_step: usize,
}

/// How much of each prototype, for every place of a network.
pub(super) struct RecipeTable<'a> {
    pub(super) numbers: &'a [f32],
    pub(super) coefficients: usize,
    pub(super) place_step: usize,
    pub(super) coefficient_step: usize,
}

/// The mask of one box, as coarse as the network's prototypes are.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// First column and row of the prototypes that it covers.
    first: [usize; 2],
    columns: usize,
    /// Above zero where the person is.
    sums: Vec<f32>,
    /// Cells of the prototypes for each pixel of the input, along x and y.
    cells_per_pixel: [f64; 2],
    placement: Placement,
}

impl Mask {
    /// Assembles the mask of a box given in pixels of an input of `input` pixels.
    pub(super) fn assemble(
        prototypes: &Prototypes<'_>,
        recipes: &RecipeTable<'_>,
        place: usize,
        bounding_box: &BoundingBox,
        input: [usize; 2],
        placement: Placement,
    ) -> Self {
        let cells_per_pixel = [
            prototypes.columns as f64 / input[0] as f64,
            prototypes.rows as f64 / input[1] as f64,
        ];
        let span = |from: f64, to: f64, scale: f64, cells: usize| {
            let first = (from * scale).floor().clamp(0.0, cells as f64) as usize;
            let end = (to * scale).ceil().clamp(first as f64, cells as f64) as usize;
            first..end
        };
        let b = bounding_box;
        let across = span(b.left, b.right(), cells_per_pixel[0], prototypes.columns);
        let down = span(b.top, b.bottom(), cells_per_pixel[1], prototypes.rows);
        let mut sums = Vec::with_capacity(across.len() * down.len());
        for row in down.clone() {
            for column in across.clone() {
                let pixel = (row * prototypes.columns + column) * prototypes.pixel_step;
                let part = |k: usize| {
                    let recipe = place * recipes.place_step + k * recipes.coefficient_step;
                    recipes.numbers[recipe]
                        * prototypes.numbers[pixel + k * prototypes.prototype_step]
                };
                sums.push((0..recipes.coefficients).map(part).sum());
            }
        }
        Self {
            first: [across.start, down.start],
            columns: across.len(),
            sums,
            cells_per_pixel,
            placement,
        }
    }

    /// Whether a place in the image, pixels, belongs to the person. Between cells, the sums are
    /// interpolated.
    pub fn covers(&self, at: [f64; 2]) -> bool {
        if self.sums.is_empty() {
            return false;
        }
        let rows = self.sums.len() / self.columns;
        let input = self.placement.to_input(at);
        let cell = |axis: usize, cells: usize| {
            let place = input[axis] * self.cells_per_pixel[axis] - 0.5 - self.first[axis] as f64;
            let place = place.clamp(0.0, (cells - 1) as f64);
            let low = place.floor() as usize;
            (low, (low + 1).min(cells - 1), (place - low as f64) as f32)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (cell(0, self.columns), cell(1, rows));
        let sum = |x: usize, y: usize| self.sums[y * self.columns + x];
        let upper = sum(x0, y0) * (1.0 - fx) + sum(x1, y0) * fx;
        let lower = sum(x0, y1) * (1.0 - fx) + sum(x1, y1) * fx;
        upper * (1.0 - fy) + lower * fy > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_where_its_recipe_says() {
        // Two prototypes of 4 x 4 cells over an input of 16 x 16: the left half, the upper half.
        let left: Vec<f32> = (0..16)
            .map(|i| if i % 4 < 2 { 1.0 } else { -1.0 })
            .collect();
        let upper: Vec<f32> = (0..16).map(|i| if i < 8 { 1.0 } else { -1.0 }).collect();
        let numbers = [left, upper].concat();
        let prototypes = Prototypes {
            numbers: &numbers,
            rows: 4,
            columns: 4,
            pixel_step: 1,
            prototype_step: 16,
        };
        let recipes = RecipeTable {
            numbers: &[1.0, 0.5],
            coefficients: 2,
            place_step: 2,
            coefficient_step: 1,
        };
        // The image is twice as large as the input.
        let placement = Placement {
            scale: [0.5, 0.5],
            offset: [0.0, 0.0],
        };
        let whole = BoundingBox::new(0.0, 0.0, 16.0, 16.0);
        let mask = Mask::assemble(&prototypes, &recipes, 0, &whole, [16, 16], placement);
        assert!(mask.covers([4.0, 4.0]) && mask.covers([4.0, 28.0]));
        assert!(!mask.covers([28.0, 4.0]) && !mask.covers([28.0, 28.0]));
    }

    #[test]
    fn a_box_outside_the_image_has_an_empty_mask() {
        let prototypes = Prototypes {
            numbers: &[1.0; 4],
            rows: 2,
            columns: 2,
            pixel_step: 1,
            prototype_step: 4,
        };
        let recipes = RecipeTable {
            numbers: &[1.0],
            coefficients: 1,
            place_step: 1,
            coefficient_step: 1,
        };
        let placement = Placement {
            scale: [1.0, 1.0],
            offset: [0.0, 0.0],
        };
        let outside = BoundingBox::new(100.0, -50.0, 10.0, 10.0);
        let mask = Mask::assemble(&prototypes, &recipes, 0, &outside, [8, 8], placement);
        assert!(!mask.covers([101.0, -45.0]));
    }
}
