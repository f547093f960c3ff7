//! The ground under a submap, and what it says of how two submaps lie to each other.
//!
//! In: submaps in their levelled frames. Out: the ground's plane; and for two neighbours the pose that
//! odometry gave with height and tilt such that their grounds are one. A LiDAR with few beams can
//! lose its height in a narrow bend and find the ceiling where the floor was; the ground under the
//! robot's feet is not lost that way.

use hachi_cloud::{GroundFinder, Reason};
use hachi_hal::{Point, Pose, Rotation, Vector3};

use crate::node::Ground;
use crate::submap::Submap;

/// Grounds that differ by less than this are one: the rest is the alignment's.
const SAME_M: f64 = 0.2;
const SAME_RAD: f64 = 0.05;

/// Finds the ground of submaps; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct GroundSeeker {
    finder: GroundFinder,
    points: Vec<Point>,
    labels: Vec<Reason>,
}

impl GroundSeeker {
    /// The ground under a submap's origin; `None` if there is none to be believed.
    pub fn find(&mut self, submap: &Submap) -> Option<Ground> {
        self.points.clear();
        self.points.extend(
            submap
                .points
                .iter()
                .map(|p| Point::at(p.position[0], p.position[1], p.position[2])),
        );
        self.labels.clear();
        self.labels.resize(self.points.len(), Reason::Kept);
        let plane = self.finder.find(&self.points, &self.labels, None).ok()?;
        Some(Ground {
            up: plane.height.up,
            below_m: plane.height.sensor_height_m,
        })
    }
}

/// `first_from_second` with the height and the tilt that lay the two grounds on each other; heading
/// and place on the ground stay. `None` if they lie on each other as it is.
pub fn laid_on(first: &Ground, second: &Ground, first_from_second: &Pose) -> Option<Pose> {
    let up_first = Vector3::from(first.up.map(f64::from));
    let up_second = first_from_second.rotation * Vector3::from(second.up.map(f64::from));
    let height = |pose: &Pose| up_first.dot(&pose.translation.vector) + f64::from(first.below_m);
    let rise = f64::from(second.below_m) - height(first_from_second);
    let tilt = Rotation::rotation_between(&up_second, &up_first)?;
    if rise.abs() < SAME_M && tilt.angle() < SAME_RAD {
        return None;
    }
    let shift = first_from_second.translation.vector + up_first * rise;
    Some(Pose::from_parts(
        shift.into(),
        tilt * first_from_second.rotation,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_up_and_a_tilt_that_the_ground_does_not_have_are_taken_out() {
        let level = Ground {
            up: [0.0, 0.0, 1.0],
            below_m: 0.6,
        };
        let way = Pose::from_parts(
            Vector3::new(1.5, 0.2, 2.7).into(),
            Rotation::from_euler_angles(0.0, -0.2, 0.4),
        );
        // The second sees its ground tilted, because it is itself.
        let tilted = Rotation::from_euler_angles(0.0, -0.2, 0.4).inverse() * Vector3::z();
        let second = Ground {
            up: tilted.map(|c| c as f32).into(),
            below_m: 0.6,
        };
        let laid = laid_on(&level, &second, &way).unwrap();
        let t = laid.translation.vector;
        assert!((t - Vector3::new(1.5, 0.2, 0.0)).norm() < 1e-6, "{t}");
        // Seen from the first, the second's ground is what it sees: nothing left to mend.
        assert!(laid_on(&level, &second, &laid).is_none());
        assert!(laid_on(&level, &level, &Pose::translation(1.0, 0.0, 0.05)).is_none());
    }
}
