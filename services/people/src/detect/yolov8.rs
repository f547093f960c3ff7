//! YOLOv8 and YOLO11: one output, [1, 4 + classes + coefficients, places].
//!
//! Every column is a place: middle and size in pixels of the input, likelihood of each class, and
//! the recipe of the mask where the model has masks: how much of each prototype in the second
//! output, [1, coefficients, height, width] (the published export of Ultralytics).

use hachi_inference::Tensor;

use super::candidate::{Candidate, DecodeError, best, output};
use super::mask::{Prototypes, RecipeTable};
use crate::BoundingBox;

/// Adds boxes with at least `least_score` to `candidates`.
///
/// # Errors
/// Another shape, or numbers that are none.
pub fn decode(
    outputs: &[Tensor],
    classes: usize,
    coefficients: usize,
    least_score: f64,
    candidates: &mut Vec<Candidate>,
) -> Result<(), DecodeError> {
    let expected = [Some(1), Some(4 + classes + coefficients), None];
    let ([_, _, places], numbers) = output(outputs, 0, expected)?;
    let number = |row: usize, place: usize| numbers[row * places + place];
    for place in 0..places {
        let (class, score) = best((0..classes).map(|class| number(4 + class, place)));
        if f64::from(score) < least_score {
            continue;
        }
        let [x, y, w, h] = [0, 1, 2, 3].map(|row| f64::from(number(row, place)));
        candidates.push(Candidate {
            bounding_box: BoundingBox::around([x, y], w, h),
            score: f64::from(score).min(1.0),
            class,
            place,
        });
    }
    Ok(())
}

/// The prototypes of masks, and the recipes in the first output, which [`decode`] has checked.
pub(super) fn masks(
    outputs: &[Tensor],
    classes: usize,
    coefficients: usize,
) -> Result<(Prototypes<'_>, RecipeTable<'_>), DecodeError> {
    let expected = [Some(1), Some(coefficients), None, None];
    let ([_, _, rows, columns], numbers) = output(outputs, 1, expected)?;
    let prototypes = Prototypes {
        numbers,
        rows,
        columns,
        pixel_step: 1,
        prototype_step: rows * columns,
    };
    let places = outputs[0].shape()[2];
    let recipes = RecipeTable {
        numbers: &outputs[0].values()[(4 + classes) * places..],
        coefficients,
        place_step: 1,
        coefficient_step: places,
    };
    Ok((prototypes, recipes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_a_box_with_its_likeliest_class() {
        // Two places, two classes: rows x, y, w, h, class 0, class 1.
        let rows = [
            [5.0, 50.0],
            [6.0, 60.0],
            [2.0, 20.0],
            [4.0, 30.0],
            [0.1, 0.2],
            [0.05, 0.7],
        ];
        let output = Tensor::from_values(&[1, 6, 2], rows.concat()).unwrap();
        let mut candidates = Vec::new();
        decode(&[output], 2, 0, 0.5, &mut candidates).unwrap();
        let [found] = candidates[..] else {
            panic!("{candidates:?}")
        };
        assert_eq!(found.bounding_box, BoundingBox::new(40.0, 45.0, 20.0, 30.0));
        assert_eq!((found.class, found.place), (1, 1));
    }

    #[test]
    fn a_missing_output_is_refused() {
        let error = decode(&[], 2, 0, 0.5, &mut Vec::new()).unwrap_err();
        assert!(matches!(error, DecodeError::Shape { output: 0, .. }));
        let first = Tensor::zeros(&[1, 8, 4]);
        assert!(masks(&[first], 2, 2).is_err());
    }
}
