//! Which pose of one trajectory belongs to which of another.
//!
//! With times on both sides: as evo 1.38 does it. From the trajectory with fewer poses, each takes
//! the pose of the other that is nearest in time, if it is near enough; a pose of the longer one
//! may be taken twice. Without times on either side: by index, and the counts must agree.

use hachi_hal::Stamp;

use crate::Trajectory;

/// Indices into both trajectories of one pair of poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pairing {
    /// Index into the reference.
    pub reference: usize,
    /// Index into the estimate.
    pub estimate: usize,
}

/// Why two trajectories can't be laid side by side.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssociationError {
    /// One of them has no poses.
    #[error("the {which} has no poses")]
    Empty {
        /// `reference` or `estimate`.
        which: &'static str,
    },
    /// No two poses are close enough in time.
    #[error(
        "no pose of the estimate ({estimate_start} to {estimate_end} s) is within {max_difference_s} s \
         of one of the reference ({reference_start} to {reference_end} s)"
    )]
    NoOverlap {
        /// First time of the reference.
        reference_start: Stamp,
        /// Last time of the reference.
        reference_end: Stamp,
        /// First time of the estimate.
        estimate_start: Stamp,
        /// Last time of the estimate.
        estimate_end: Stamp,
        /// How far apart in time two poses may be.
        max_difference_s: f64,
    },
    /// Without times the poses go by index, but there are not equally many.
    #[error(
        "without times poses are compared by index, but the reference has {reference} and the \
         estimate {estimate}"
    )]
    Counts {
        /// Poses in the reference.
        reference: usize,
        /// Poses in the estimate.
        estimate: usize,
    },
}

/// Pairs the poses of two trajectories, in the order of time.
///
/// `max_difference_s`: how far apart in time, seconds, two poses of a pair may be (inclusive).
///
/// # Errors
/// [`AssociationError`] when nothing can be paired.
pub fn associate(
    reference: &Trajectory,
    estimate: &Trajectory,
    max_difference_s: f64,
) -> Result<Vec<Pairing>, AssociationError> {
    for (trajectory, which) in [(reference, "reference"), (estimate, "estimate")] {
        if trajectory.is_empty() {
            return Err(AssociationError::Empty { which });
        }
    }
    let (Some(reference_stamps), Some(estimate_stamps)) = (reference.stamps(), estimate.stamps())
    else {
        return by_index(reference.len(), estimate.len());
    };

    let reference_s = in_seconds(reference_stamps);
    let estimate_s = in_seconds(estimate_stamps);
    let pairs: Vec<Pairing> = if estimate_s.len() > reference_s.len() {
        nearest_in_time(&reference_s, &estimate_s, max_difference_s)
            .map(|(reference, estimate)| Pairing {
                reference,
                estimate,
            })
            .collect()
    } else {
        nearest_in_time(&estimate_s, &reference_s, max_difference_s)
            .map(|(estimate, reference)| Pairing {
                reference,
                estimate,
            })
            .collect()
    };
    if pairs.is_empty() {
        return Err(AssociationError::NoOverlap {
            reference_start: reference_stamps[0],
            reference_end: reference_stamps[reference_stamps.len() - 1],
            estimate_start: estimate_stamps[0],
            estimate_end: estimate_stamps[estimate_stamps.len() - 1],
            max_difference_s,
        });
    }
    Ok(pairs)
}

fn by_index(reference: usize, estimate: usize) -> Result<Vec<Pairing>, AssociationError> {
    if reference != estimate {
        return Err(AssociationError::Counts {
            reference,
            estimate,
        });
    }
    let pair = |index| Pairing {
        reference: index,
        estimate: index,
    };
    Ok((0..reference).map(pair).collect())
}

/// The seconds a reader of doubles gets from the decimal text of these times.
///
/// evo compares doubles, so pairs that tie to the nanosecond fall by rounding there. The same
/// doubles here give the same pairs.
fn in_seconds(stamps: &[Stamp]) -> Vec<f64> {
    const NANOS: i64 = 1_000_000_000;
    let seconds = |stamp: &Stamp| {
        let nanos = stamp.as_nanos();
        (nanos / NANOS) as f64 + (nanos % NANOS) as f64 / NANOS as f64
    };
    stamps.iter().map(seconds).collect()
}

/// For each time in `short` the index of the nearest in `long`; of two equally near the earlier.
fn nearest_in_time(
    short: &[f64],
    long: &[f64],
    max_difference_s: f64,
) -> impl Iterator<Item = (usize, usize)> {
    short.iter().enumerate().filter_map(move |(index, &time)| {
        let above = long.partition_point(|&other| other <= time);
        let later = long.get(above).map_or(f64::INFINITY, |other| other - time);
        let earlier = match above.checked_sub(1) {
            Some(below) => time - long[below],
            None => f64::INFINITY,
        };
        if later < earlier && later <= max_difference_s {
            Some((index, above))
        } else if earlier <= max_difference_s && earlier <= later {
            Some((index, above - 1)) // a finite `earlier` means `above` is at least 1
        } else {
            None
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::Pose;

    fn timed(millis: &[i64]) -> Trajectory {
        let samples = millis
            .iter()
            .map(|ms| (Stamp::from_nanos(ms * 1_000_000), Pose::identity()))
            .collect();
        Trajectory::from_samples(samples).0
    }

    fn pairs(reference: &[i64], estimate: &[i64], max: f64) -> Vec<(usize, usize)> {
        associate(&timed(reference), &timed(estimate), max)
            .unwrap()
            .iter()
            .map(|p| (p.reference, p.estimate))
            .collect()
    }

    #[test]
    fn each_pose_takes_the_nearest_within_the_limit() {
        assert_eq!(
            pairs(&[0, 10, 20, 30, 40], &[4, 21, 33], 0.005),
            [(0, 0), (2, 1), (3, 2)]
        );
    }

    #[test]
    fn poses_beyond_the_limit_or_the_ends_are_left_out() {
        assert_eq!(pairs(&[0, 100, 200], &[-50, 104, 260], 0.01), [(1, 1)]);
    }

    #[test]
    fn the_shorter_side_asks_whichever_side_it_is() {
        let long: Vec<i64> = (0..50).collect();
        assert_eq!(pairs(&long, &[7, 9], 0.0), [(7, 0), (9, 1)]);
        assert_eq!(pairs(&[7, 9], &long, 0.0), [(0, 7), (1, 9)]);
    }

    #[test]
    fn trajectories_of_other_days_are_refused_with_both_spans() {
        let error = associate(&timed(&[0, 10]), &timed(&[90_000, 90_010]), 0.01).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("90.000000000") && text.contains("0.010000000"),
            "{text}"
        );
    }

    #[test]
    fn without_times_the_counts_must_agree() {
        let three = Trajectory::untimed(vec![Pose::identity(); 3]);
        let two = Trajectory::untimed(vec![Pose::identity(); 2]);
        assert_eq!(associate(&three, &three, 0.01).unwrap().len(), 3);
        assert_eq!(
            associate(&three, &two, 0.01),
            Err(AssociationError::Counts {
                reference: 3,
                estimate: 2
            })
        );
        assert_eq!(associate(&two, &timed(&[1, 2]), 0.01).unwrap().len(), 2);
    }
}
