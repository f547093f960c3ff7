//! A sequence of poses, with times or without.
//!
//! Times strictly increase: everything that reads a trajectory may rely on it. Files that break
//! this are put right on the way in ([`Trajectory::from_samples`]), and what was changed is
//! counted.

use hachi_hal::{Pose, Stamp};

/// Poses in the order in which they were passed through.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// One for each pose, strictly increasing; `None` where the source has no times (KITTI).
    stamps: Option<Vec<Stamp>>,
    poses: Vec<Pose>,
}

/// What had to be put right in a source of poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Repairs {
    /// Poses whose time was before the time of the pose ahead of them: sorted in.
    pub reordered: usize,
    /// Poses that were dropped because a later one has the same time.
    pub repeated: usize,
    /// Quaternions whose length was off by more than 1 %: normalised.
    pub normalised: usize,
}

impl Repairs {
    /// Whether the source was fine as it was.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// A pose was pushed whose time is not after the last one's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the pose at {got} s is not later than the one before it, at {last} s")]
pub struct NotLater {
    /// The time of the last pose.
    pub last: Stamp,
    /// The time of the refused pose.
    pub got: Stamp,
}

impl Trajectory {
    /// An empty trajectory with times.
    pub fn new() -> Self {
        Self {
            stamps: Some(Vec::new()),
            poses: Vec::new(),
        }
    }

    /// Poses without times, known by their index.
    pub fn untimed(poses: Vec<Pose>) -> Self {
        Self {
            stamps: None,
            poses,
        }
    }

    /// Poses with times in any order.
    ///
    /// They are sorted by time; of several with the same time the one given last stays (a later
    /// line of a file corrects an earlier one). Both are counted.
    pub fn from_samples(mut samples: Vec<(Stamp, Pose)>) -> (Self, Repairs) {
        let reordered = samples.windows(2).filter(|w| w[1].0 < w[0].0).count();
        samples.sort_by_key(|(stamp, _)| *stamp); // stable: equal times keep their order
        let given = samples.len();
        let mut trajectory = Self {
            stamps: Some(Vec::with_capacity(given)),
            poses: Vec::with_capacity(given),
        };
        for (index, (stamp, pose)) in samples.iter().enumerate() {
            if samples.get(index + 1).is_some_and(|next| next.0 == *stamp) {
                continue;
            }
            if let Some(stamps) = &mut trajectory.stamps {
                stamps.push(*stamp);
            }
            trajectory.poses.push(*pose);
        }
        let repairs = Repairs {
            reordered,
            repeated: given - trajectory.len(),
            normalised: 0,
        };
        (trajectory, repairs)
    }

    /// Adds a pose at the end.
    ///
    /// # Errors
    /// [`NotLater`] if `stamp` is not after the last one; nothing is added then. A trajectory
    /// without times takes the pose and forgets the time.
    pub fn push(&mut self, stamp: Stamp, pose: Pose) -> Result<(), NotLater> {
        if let Some(stamps) = &mut self.stamps {
            if let Some(&last) = stamps.last()
                && stamp <= last
            {
                return Err(NotLater { last, got: stamp });
            }
            stamps.push(stamp);
        }
        self.poses.push(pose);
        Ok(())
    }

    /// How many poses there are.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// The times, one for each pose, if the source had them. They strictly increase.
    pub fn stamps(&self) -> Option<&[Stamp]> {
        self.stamps.as_deref()
    }

    /// The poses.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Seconds from the first to the last pose; 0 without times.
    pub fn duration_s(&self) -> f64 {
        match self.stamps.as_deref() {
            Some([first, .., last]) => last.secs_since(*first),
            _ => 0.0,
        }
    }

    /// The sum of the distances between neighbouring positions, metres.
    pub fn path_length_m(&self) -> f64 {
        self.poses
            .windows(2)
            .map(|w| (w[1].translation.vector - w[0].translation.vector).norm())
            // Not `sum`, whose sum of nothing is -0.
            .fold(0.0, |length, step| length + step)
    }

    /// The same times with every pose passed through `change`.
    pub fn map_poses(&self, change: impl FnMut(&Pose) -> Pose) -> Self {
        Self {
            stamps: self.stamps.clone(),
            poses: self.poses.iter().map(change).collect(),
        }
    }

    /// The poses at `indices`, in that order.
    ///
    /// An index beyond the end is left out. The caller keeps the indices increasing; a repeated
    /// index repeats its pose, which association by time may ask for.
    pub(crate) fn select(&self, indices: impl Iterator<Item = usize> + Clone) -> Self {
        Self {
            stamps: self
                .stamps
                .as_ref()
                .map(|s| indices.clone().filter_map(|i| s.get(i).copied()).collect()),
            poses: indices.filter_map(|i| self.poses.get(i).copied()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(x: f64) -> Pose {
        Pose::translation(x, 0.0, 0.0)
    }

    #[test]
    fn unsorted_times_are_sorted_and_counted() {
        let samples = [(3, 3.0), (1, 1.0), (2, 2.0)].map(|(t, x)| (Stamp::from_nanos(t), at(x)));
        let (trajectory, repairs) = Trajectory::from_samples(samples.to_vec());
        let xs: Vec<f64> = trajectory.poses().iter().map(|p| p.translation.x).collect();
        assert_eq!(xs, [1.0, 2.0, 3.0]);
        assert_eq!(repairs.reordered, 1);
        assert_eq!(repairs.repeated, 0);
    }

    #[test]
    fn of_poses_with_one_time_the_last_given_stays() {
        let samples = [(1, 1.0), (2, 2.0), (1, 9.0)].map(|(t, x)| (Stamp::from_nanos(t), at(x)));
        let (trajectory, repairs) = Trajectory::from_samples(samples.to_vec());
        let xs: Vec<f64> = trajectory.poses().iter().map(|p| p.translation.x).collect();
        assert_eq!(xs, [9.0, 2.0]);
        assert_eq!(repairs.repeated, 1);
    }

    #[test]
    fn a_pose_that_is_not_later_is_refused_and_nothing_is_added() {
        let mut trajectory = Trajectory::new();
        trajectory.push(Stamp::from_nanos(5), at(0.0)).unwrap();
        let refused = trajectory.push(Stamp::from_nanos(5), at(1.0));
        assert!(refused.is_err());
        assert_eq!(trajectory.len(), 1);
    }

    proptest! {
        #[test]
        fn times_strictly_increase_whatever_came_in(times in prop::collection::vec(-50i64..50, 0..80)) {
            let samples = times.iter().map(|t| (Stamp::from_nanos(*t), at(0.0))).collect();
            let (trajectory, repairs) = Trajectory::from_samples(samples);
            let stamps = trajectory.stamps().unwrap();
            prop_assert!(stamps.windows(2).all(|w| w[0] < w[1]));
            prop_assert_eq!(stamps.len() + repairs.repeated, times.len());
        }
    }
}
