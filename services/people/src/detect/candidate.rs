//! What a decoder makes of a network's numbers, and what it refuses.

use hachi_inference::Tensor;
use hachi_inference::model::shape_text;

use crate::BoundingBox;

/// A box that a network proposes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Where, pixels of the network's input.
    pub bounding_box: BoundingBox,
    /// How sure, 0 to 1.
    pub score: f64,
    /// What, by the network's own numbers.
    pub class: usize,
    /// Which of the network's places says so: the recipe of its mask lies there.
    pub place: usize,
}

/// Why outputs can't be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// An output is missing, or of another shape.
    #[error("output {output} has shape {found:?}, expected {expected}")]
    Shape {
        /// Which.
        output: usize,
        /// What it should be.
        expected: String,
        /// What it is; empty if it is missing.
        found: Vec<usize>,
    },
    /// A network that has come apart.
    #[error("output {output} holds a number that is none, at place {at}")]
    NotANumber {
        /// Which output.
        output: usize,
        /// Where in it.
        at: usize,
    },
}

/// An output of `N` dimensions, all numbers finite; `expected` is `None` where any size will do.
pub(super) fn output<const N: usize>(
    outputs: &[Tensor],
    index: usize,
    expected: [Option<usize>; N],
) -> Result<([usize; N], &[f32]), DecodeError> {
    let found = outputs.get(index).map_or(&[][..], Tensor::shape);
    let fits = |(e, f): (&Option<usize>, &usize)| e.is_none_or(|e| e == *f);
    let shape: Option<[usize; N]> = found.try_into().ok();
    let shape = shape.filter(|found| expected.iter().zip(found).all(fits));
    let shape = shape.ok_or_else(|| DecodeError::Shape {
        output: index,
        expected: shape_text(&expected),
        found: found.to_vec(),
    })?;
    let values = outputs[index].values();
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(DecodeError::NotANumber { output: index, at }),
        None => Ok((shape, values)),
    }
}

/// The largest of some scores, and where it stands. The first of equals.
pub(super) fn best(scores: impl Iterator<Item = f32>) -> (usize, f32) {
    let better = |best: (usize, f32), next: (usize, f32)| if next.1 > best.1 { next } else { best };
    scores.enumerate().fold((0, f32::NEG_INFINITY), better)
}
