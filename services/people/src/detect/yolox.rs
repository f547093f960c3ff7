//! YOLOX: one output, [1, places, 5 + classes].
//!
//! Places are the cells of grids of stride 8, 16 and 32, row by row. A cell gives offset of the
//! middle and logarithm of the size in units of its stride, how likely it holds an object, and how
//! likely each class (Ge et al., *YOLOX*, 2021; `decode_in_inference` of the published code).

use hachi_inference::Tensor;

use super::candidate::{Candidate, DecodeError, best, output};
use crate::BoundingBox;

const STRIDES: [usize; 3] = [8, 16, 32];

/// Adds boxes with at least `least_score` to `candidates`.
///
/// # Errors
/// Another shape, or numbers that are none.
pub fn decode(
    outputs: &[Tensor],
    [width, height]: [usize; 2],
    classes: usize,
    least_score: f64,
    candidates: &mut Vec<Candidate>,
) -> Result<(), DecodeError> {
    let grids = STRIDES.map(|stride| (stride, width / stride, height / stride));
    let places = grids.iter().map(|(_, columns, rows)| columns * rows).sum();
    let row = 5 + classes;
    let expected = [Some(1), Some(places), Some(row)];
    let (_, numbers) = output(outputs, 0, expected)?;
    let cells = grids.iter().flat_map(|&(stride, columns, rows)| {
        (0..columns * rows).map(move |cell| (stride as f64, cell % columns, cell / columns))
    });
    for (place, ((stride, x, y), numbers)) in cells.zip(numbers.chunks_exact(row)).enumerate() {
        let (class, likely) = best(numbers[5..].iter().copied());
        let score = f64::from(numbers[4] * likely);
        if score < least_score {
            continue;
        }
        let [dx, dy, w, h] = [0, 1, 2, 3].map(|i| f64::from(numbers[i]));
        let middle = [(dx + x as f64) * stride, (dy + y as f64) * stride];
        candidates.push(Candidate {
            bounding_box: BoundingBox::around(middle, w.exp() * stride, h.exp() * stride),
            score: score.min(1.0),
            class,
            place,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_cell_of_the_second_grid_is_where_its_stride_says() {
        // 64 x 32: grids of 8x4, 4x2 and 2x1 cells. Cell (3, 1) of the second one.
        let place = 32 + 4 + 3;
        let mut output = Tensor::zeros(&[1, 42, 7]);
        output.values_mut()[7 * place..7 * place + 7].copy_from_slice(&[
            0.5,
            0.25,
            2.0_f32.ln(),
            3.0_f32.ln(),
            0.9,
            0.1,
            0.8,
        ]);
        let mut candidates = Vec::new();
        decode(&[output], [64, 32], 2, 0.3, &mut candidates).unwrap();
        let [found] = candidates[..] else {
            panic!("{candidates:?}")
        };
        assert_eq!((found.class, found.place), (1, place));
        assert!((found.score - 0.72).abs() < 1e-6);
        let expected = BoundingBox::around([3.5 * 16.0, 1.25 * 16.0], 32.0, 48.0);
        assert!((found.bounding_box.left - expected.left).abs() < 1e-4);
        assert!((found.bounding_box.bottom() - expected.bottom()).abs() < 1e-4);
    }

    #[test]
    fn wrong_shapes_and_numbers_that_are_none_are_refused() {
        let mut candidates = Vec::new();
        let mut decode = |output: Tensor| decode(&[output], [64, 32], 2, 0.3, &mut candidates);
        let error = decode(Tensor::zeros(&[1, 42, 8])).unwrap_err().to_string();
        assert!(error.contains("[1, 42, 8], expected [1, 42, 7]"), "{error}");
        let mut broken = Tensor::zeros(&[1, 42, 7]);
        broken.values_mut()[9] = f32::NAN;
        let expected = DecodeError::NotANumber { output: 0, at: 9 };
        assert_eq!(decode(broken), Err(expected));
    }
}
