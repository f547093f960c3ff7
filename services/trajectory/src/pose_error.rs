//! Absolute and relative pose errors, translation part.
//!
//! Absolute: the distance between the two positions of a pair. Relative: how far the motion over a
//! stretch of the path differs, seen from its beginning (J. Sturm et al., "A benchmark for the
//! evaluation of RGB-D SLAM systems", IROS 2012).

use std::num::NonZeroUsize;

use hachi_hal::Pose;

/// How long a stretch of path one relative error is taken over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RelativeDelta {
    /// So many poses.
    Frames(NonZeroUsize),
    /// So many metres of the estimate's own path; positive and finite.
    Metres(f64),
}

impl Default for RelativeDelta {
    /// From each pose to the next.
    fn default() -> Self {
        Self::Frames(NonZeroUsize::MIN)
    }
}

/// A stretch of no length can't be evaluated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("a stretch of {metres} m can't be compared; give a positive number of metres")]
pub struct DeltaError {
    /// What was asked for.
    pub metres: f64,
}

/// The distance between the positions of each pair, metres. Stops at the shorter list.
pub fn absolute_errors(reference: &[Pose], estimate: &[Pose]) -> Vec<f64> {
    let distance = |(r, e): (&Pose, &Pose)| (e.translation.vector - r.translation.vector).norm();
    reference.iter().zip(estimate).map(distance).collect()
}

/// The stretches `(from, to)` that relative errors are taken over: each begins where the one
/// before it ended (evo's consecutive pairs).
///
/// In metres, a stretch ends at the first pose at which the distances from pose to pose, summed
/// since its beginning, reach `delta`; stretches are therefore a little longer than asked for,
/// and the rest at the end is left out.
///
/// # Errors
/// [`DeltaError`] for metres that are not positive.
pub fn relative_pairs(
    estimate: &[Pose],
    delta: RelativeDelta,
) -> Result<Vec<(usize, usize)>, DeltaError> {
    let ends: Vec<usize> = match delta {
        RelativeDelta::Frames(frames) => (0..estimate.len()).step_by(frames.get()).collect(),
        RelativeDelta::Metres(metres) if metres.is_finite() && metres > 0.0 => {
            path_marks(estimate, metres)
        }
        RelativeDelta::Metres(metres) => return Err(DeltaError { metres }),
    };
    Ok(ends.windows(2).map(|w| (w[0], w[1])).collect())
}

/// Index 0 and every index at which another `metres` of path are full.
fn path_marks(poses: &[Pose], metres: f64) -> Vec<usize> {
    let mut marks = Vec::new();
    if !poses.is_empty() {
        marks.push(0);
    }
    let mut travelled = 0.0;
    for (index, step) in poses.windows(2).enumerate() {
        travelled += (step[1].translation.vector - step[0].translation.vector).norm();
        if travelled >= metres {
            marks.push(index + 1);
            travelled = 0.0;
        }
    }
    marks
}

/// How far the estimate's motion over each stretch is from the reference's, metres. Stretches
/// beyond the end of either list are left out.
pub fn relative_errors(
    reference: &[Pose],
    estimate: &[Pose],
    stretches: &[(usize, usize)],
) -> Vec<f64> {
    let error = |&(from, to): &(usize, usize)| {
        let reference_from_to = reference.get(from)?.inv_mul(reference.get(to)?);
        let estimate_from_to = estimate.get(from)?.inv_mul(estimate.get(to)?);
        let difference = reference_from_to.inv_mul(&estimate_from_to);
        Some(difference.translation.vector.norm())
    };
    stretches.iter().filter_map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(count: u32, step_m: f64) -> Vec<Pose> {
        (0..count)
            .map(|i| Pose::translation(f64::from(i) * step_m, 0.0, 0.0))
            .collect()
    }

    #[test]
    fn stretches_of_frames_follow_each_other_and_the_rest_is_left_out() {
        let delta = RelativeDelta::Frames(NonZeroUsize::new(4).unwrap());
        assert_eq!(
            relative_pairs(&line(11, 1.0), delta).unwrap(),
            [(0, 4), (4, 8)]
        );
    }

    #[test]
    fn stretches_of_metres_end_at_the_first_pose_that_fills_them() {
        let delta = RelativeDelta::Metres(1.0);
        assert_eq!(
            relative_pairs(&line(9, 0.375), delta).unwrap(),
            [(0, 3), (3, 6)]
        );
    }

    #[test]
    fn an_empty_path_has_no_stretches_and_no_length_is_refused() {
        assert_eq!(relative_pairs(&[], RelativeDelta::Metres(1.0)).unwrap(), []);
        for metres in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(relative_pairs(&line(3, 1.0), RelativeDelta::Metres(metres)).is_err());
        }
    }

    #[test]
    fn a_tenth_too_long_steps_err_by_a_tenth() {
        let (reference, estimate) = (line(5, 1.0), line(5, 1.1));
        let stretches = relative_pairs(&estimate, RelativeDelta::default()).unwrap();
        for error in relative_errors(&reference, &estimate, &stretches) {
            assert!((error - 0.1).abs() < 1e-12);
        }
    }
}
