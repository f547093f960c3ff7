//! One trajectory measured against another, top to bottom.

use hachi_hal::Vector3;

use crate::align::{Alignment, AlignmentError, Observed, Similarity, align};
use crate::associate::{AssociationError, associate};
use crate::pose_error::{
    DeltaError, RelativeDelta, absolute_errors, relative_errors, relative_pairs,
};
use crate::{Statistics, Trajectory};

/// What to compare and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvaluationOptions {
    /// How the estimate is laid over the reference.
    pub alignment: Alignment,
    /// How far apart in time, seconds, two poses of a pair may be. 0.01 as evo has it.
    pub max_difference_s: f64,
    /// Over which stretches relative errors are taken.
    pub relative_delta: RelativeDelta,
}

impl Default for EvaluationOptions {
    fn default() -> Self {
        Self {
            alignment: Alignment::None,
            max_difference_s: 0.01,
            relative_delta: RelativeDelta::default(),
        }
    }
}

/// The result of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Absolute pose error, metres.
    pub ape: Statistics,
    /// Relative pose error, metres; `None` if the path holds no stretch of the length asked for.
    ///
    /// Over metres, the stretch that begins at the first pose is not in it: evo up to 1.36 begins
    /// at the first full `delta`, and published figures are its.
    pub rpe: Option<Statistics>,
    /// The same with the stretch that begins at the first pose, as evo 1.38 counts it. Over frames
    /// it is the same as `rpe`.
    pub rpe_from_first_pose: Option<Statistics>,
    /// Takes the estimate to the reference.
    pub reference_from_estimate: Similarity,
    /// How much of the rotation of that transform the positions determine.
    pub observed: Observed,
    /// The poses of the reference that found a partner, in the order of time; one that is the
    /// nearest of two of the other side stands there twice.
    pub reference: Trajectory,
    /// Their partners, aligned: as many.
    pub estimate: Trajectory,
    /// The absolute error of each pair, metres: as many.
    pub errors_m: Vec<f64>,
}

/// Why two trajectories can't be compared.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// They can't be laid side by side.
    #[error(transparent)]
    Association(#[from] AssociationError),
    /// They can't be laid over each other.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The stretch for relative errors has no length.
    #[error(transparent)]
    Delta(#[from] DeltaError),
}

/// Measures `estimate` against `reference`.
///
/// The stretches of the relative error are chosen along the estimate after scaling, as evo does;
/// rotating and shifting changes neither them nor the relative errors.
///
/// # Errors
/// [`EvaluationError`] when they have no pairs of poses, or these can't be aligned.
pub fn evaluate(
    reference: &Trajectory,
    estimate: &Trajectory,
    options: &EvaluationOptions,
) -> Result<Evaluation, EvaluationError> {
    let pairs = associate(reference, estimate, options.max_difference_s)?;
    let reference = reference.select(pairs.iter().map(|p| p.reference));
    let estimate = estimate.select(pairs.iter().map(|p| p.estimate));

    let positions: Vec<(Vector3, Vector3)> = reference
        .poses()
        .iter()
        .zip(estimate.poses())
        .map(|(r, e)| (r.translation.vector, e.translation.vector))
        .collect();
    let (reference_from_estimate, observed) = align(&positions, options.alignment)?;

    let scaled = Similarity {
        scale: reference_from_estimate.scale,
        ..Similarity::identity()
    };
    let scaled = estimate.map_poses(|pose| scaled.apply(pose));
    let stretches = relative_pairs(scaled.poses(), options.relative_delta)?;
    let relative = relative_errors(reference.poses(), scaled.poses(), &stretches);
    let beginning = match options.relative_delta {
        RelativeDelta::Frames(_) => 0,
        RelativeDelta::Metres(_) => relative.len().min(1),
    };

    let aligned = estimate.map_poses(|pose| reference_from_estimate.apply(pose));
    let errors_m = absolute_errors(reference.poses(), aligned.poses());
    Ok(Evaluation {
        ape: Statistics::of(&errors_m).ok_or(AlignmentError::Empty)?,
        rpe: Statistics::of(&relative[beginning..]),
        rpe_from_first_pose: Statistics::of(&relative),
        reference_from_estimate,
        observed,
        reference,
        estimate: aligned,
        errors_m,
    })
}
