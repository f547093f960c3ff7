//! YOLACT and YOLACT++: boxes relative to anchors, scores, recipes of masks, prototypes.
//!
//! Boxes are decoded as in SSD with variances 0.1 and 0.2; anchors stand at the middles of the
//! cells of five levels (Bolya et al., ICCV 2019; `make_priors` and `decode` of the published
//! code). Scores are likelihoods with the background first; recipes have been through tanh.

use hachi_inference::Tensor;
use hachi_inference::manifest::yolact_grid;

use super::candidate::{Candidate, DecodeError, best, output};
use super::mask::{Prototypes, RecipeTable};
use crate::BoundingBox;

const MIDDLE_VARIANCE: f64 = 0.1;
const SIZE_VARIANCE: f64 = 0.2;

/// Boxes that a network's boxes are relative to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Anchors(Vec<BoundingBox>);

impl Anchors {
    /// Anchors for an input of this size, pixels. `scales` are sides for each level; `square` ones
    /// are as high as they are wide.
    pub fn new(
        [width, height]: [usize; 2],
        scales: &[Vec<f64>],
        aspect_ratios: &[f64],
        square: bool,
    ) -> Self {
        let mut anchors = Vec::new();
        for (level, scales) in scales.iter().enumerate() {
            let [columns, rows] = yolact_grid([width, height], level);
            for cell in 0..columns * rows {
                let share = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
                let middle = [
                    share(cell % columns, columns) * width as f64,
                    share(cell / columns, rows) * height as f64,
                ];
                for scale in scales {
                    for ratio in aspect_ratios {
                        let w = scale * ratio.sqrt();
                        let h = if square { w } else { scale / ratio.sqrt() };
                        anchors.push(BoundingBox::around(middle, w, h));
                    }
                }
            }
        }
        Self(anchors)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Adds boxes with at least `least_score` to `candidates`.
///
/// # Errors
/// Another shape, or numbers that are none.
pub fn decode(
    outputs: &[Tensor],
    anchors: &Anchors,
    classes: usize,
    least_score: f64,
    candidates: &mut Vec<Candidate>,
) -> Result<(), DecodeError> {
    let places = Some(anchors.len());
    let (_, boxes) = output(outputs, 0, [Some(1), places, Some(4)])?;
    let (_, scores) = output(outputs, 1, [Some(1), places, Some(1 + classes)])?;
    for (place, anchor) in anchors.0.iter().enumerate() {
        let scores = &scores[place * (1 + classes)..(place + 1) * (1 + classes)];
        let (class, score) = best(scores[1..].iter().copied());
        if f64::from(score) < least_score {
            continue;
        }
        let [dx, dy, dw, dh] = [0, 1, 2, 3].map(|i| f64::from(boxes[4 * place + i]));
        let [x, y] = anchor.middle();
        let middle = [
            x + dx * MIDDLE_VARIANCE * anchor.width,
            y + dy * MIDDLE_VARIANCE * anchor.height,
        ];
        let width = anchor.width * (dw * SIZE_VARIANCE).exp();
        let height = anchor.height * (dh * SIZE_VARIANCE).exp();
        candidates.push(Candidate {
            bounding_box: BoundingBox::around(middle, width, height),
            score: f64::from(score).min(1.0),
            class,
            place,
        });
    }
    Ok(())
}

/// The prototypes of masks and their recipes.
pub(super) fn masks<'a>(
    outputs: &'a [Tensor],
    anchors: &Anchors,
    coefficients: usize,
) -> Result<(Prototypes<'a>, RecipeTable<'a>), DecodeError> {
    let expected = [Some(1), Some(anchors.len()), Some(coefficients)];
    let (_, recipes) = output(outputs, 2, expected)?;
    let expected = [Some(1), None, None, Some(coefficients)];
    let ([_, rows, columns, _], numbers) = output(outputs, 3, expected)?;
    let prototypes = Prototypes {
        numbers,
        rows,
        columns,
        pixel_step: coefficients,
        prototype_step: 1,
    };
    let recipes = RecipeTable {
        numbers: recipes,
        coefficients,
        place_step: coefficients,
        coefficient_step: 1,
    };
    Ok((prototypes, recipes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_of_550_pixels_has_as_many_anchors_as_published() {
        let scales = [24.0, 48.0, 96.0, 192.0, 384.0].map(|s| vec![s]);
        let anchors = Anchors::new([550, 550], &scales, &[1.0, 0.5, 2.0], true);
        assert_eq!(anchors.len(), 19248);
    }

    #[test]
    fn a_box_is_moved_and_scaled_from_its_anchor() {
        // One cell of 8 x 8 pixels with one anchor of 10 x 10 in its middle.
        let anchors = Anchors::new([8, 8], &[vec![10.0]], &[1.0], false);
        let boxes = Tensor::from_values(&[1, 1, 4], vec![2.0, 0.0, 0.0, 5.0 * 2.0_f32.ln()]);
        let scores = Tensor::from_values(&[1, 1, 3], vec![0.1, 0.2, 0.7]);
        let outputs = [boxes.unwrap(), scores.unwrap()];
        let mut candidates = Vec::new();
        decode(&outputs, &anchors, 2, 0.5, &mut candidates).unwrap();
        let [found] = candidates[..] else {
            panic!("{candidates:?}")
        };
        assert_eq!(found.class, 1);
        let expected = BoundingBox::around([4.0 + 2.0, 4.0], 10.0, 20.0);
        assert!((found.bounding_box.left - expected.left).abs() < 1e-5);
        assert!((found.bounding_box.top - expected.top).abs() < 1e-5);
        assert!((found.bounding_box.height - 20.0).abs() < 1e-5);
    }
}
