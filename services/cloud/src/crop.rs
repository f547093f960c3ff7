//! Labels what the sensor should not have seen at all: broken coordinates, the robot's own body,
//! and returns nearer or farther than it is trusted.
//!
//! In: points in the sensor frame, boxes in any frame with the transform to it. Out: labels
//! [`Reason::NonFinite`], [`Reason::SelfHit`], [`Reason::Range`].

use hachi_hal::{Point, Pose};

use crate::label::Reason;

/// A box that the robot's own body fills, edges along the axes of its frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct BodyBox {
    /// The corner with the smallest coordinates.
    pub min_m: [f32; 3],
    /// The corner with the largest coordinates.
    pub max_m: [f32; 3],
}

/// A rotation and translation in single precision, row by row: `rows[i] = [r0, r1, r2, t]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rows(pub(crate) [[f32; 4]; 3]);

impl Rows {
    pub(crate) fn from_pose(pose: &Pose) -> Self {
        let rotation = pose.rotation.to_rotation_matrix();
        let t = pose.translation.vector;
        Self(core::array::from_fn(|row| {
            [
                rotation[(row, 0)] as f32,
                rotation[(row, 1)] as f32,
                rotation[(row, 2)] as f32,
                t[row] as f32,
            ]
        }))
    }

    #[inline(always)]
    pub(crate) fn apply(&self, p: [f32; 3]) -> [f32; 3] {
        self.0
            .map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    /// The rotation alone.
    #[inline(always)]
    pub(crate) fn turn(&self, v: [f32; 3]) -> [f32; 3] {
        self.0.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2])
    }

    /// The inverse rotation.
    pub(crate) fn turn_back(&self, v: [f32; 3]) -> [f32; 3] {
        core::array::from_fn(|a| self.0[0][a] * v[0] + self.0[1][a] * v[1] + self.0[2][a] * v[2])
    }
}

/// Labels points with a NaN or infinite coordinate.
pub fn label_non_finite(points: &[Point], labels: &mut [Reason]) {
    for (point, label) in points.iter().zip(labels) {
        if label.is_kept() && !point.is_finite() {
            *label = Reason::NonFinite;
        }
    }
}

/// Labels points inside `body`, faces included; `body_from_lidar` takes points to the frame in
/// which the box is given.
pub fn label_self_hits(
    points: &[Point],
    body: &BodyBox,
    body_from_lidar: &Pose,
    labels: &mut [Reason],
) {
    let rows = Rows::from_pose(body_from_lidar);
    for (point, label) in points.iter().zip(labels) {
        let p = rows.apply(point.position());
        let inside = (0..3).all(|axis| p[axis] >= body.min_m[axis] && p[axis] <= body.max_m[axis]);
        if label.is_kept() && inside {
            *label = Reason::SelfHit;
        }
    }
}

/// Labels points nearer than `near_m` or farther than `far_m` from the sensor.
///
/// The distance comes from the coordinates: files of bare points have no other.
pub fn label_range(points: &[Point], near_m: f32, far_m: f32, labels: &mut [Reason]) {
    let (near_sq, far_sq) = (near_m * near_m, far_m * far_m);
    for (point, label) in points.iter().zip(labels) {
        let distance_sq = point.x * point.x + point.y * point.y + point.z * point.z;
        let outside = (distance_sq < near_sq) | (distance_sq > far_sq);
        *label = if outside & label.is_kept() {
            Reason::Range
        } else {
            *label
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use hachi_hal::{Rotation, Vector3};
    use nalgebra::Translation3;

    #[test]
    fn each_point_keeps_the_first_reason() {
        let points = [
            Point {
                x: f32::NAN,
                ..Point::at(1.0, 0.0, 0.0)
            },
            Point {
                z: f32::INFINITY,
                ..Point::at(1.0, 0.0, 0.0)
            },
            Point::at(0.1, 0.0, 0.0),
            Point::at(0.0, 3.0, 4.0),
            Point::at(0.0, 3.0, 4.1),
            Point::at(1e30, 1e30, 1e30),
        ];
        let mut labels = vec![Kept; points.len()];
        label_non_finite(&points, &mut labels);
        label_range(&points, 0.2, 5.0, &mut labels);
        use Reason::*;
        assert_eq!(labels, [NonFinite, NonFinite, Range, Kept, Range, Range]);
    }

    #[test]
    fn a_body_box_is_where_the_mount_puts_it() {
        // The LiDAR stands 0.5 m above the base, 0.3 m in front, turned left by a quarter: what
        // it sees on its right (-y) is ahead of the base (+x).
        let base_from_lidar = Pose::from_parts(
            Translation3::new(0.3, 0.0, 0.5),
            Rotation::from_axis_angle(&Vector3::z_axis(), core::f64::consts::FRAC_PI_2),
        );
        let body = BodyBox {
            min_m: [-0.6, -0.3, -0.2],
            max_m: [0.6, 0.3, 0.2],
        };
        let points = [
            Point::at(0.0, -0.2, -0.4), // base (0.5, 0, 0.1): on the head
            Point::at(0.0, 0.8, -0.4),  // base (-0.5, 0, 0.1): on the tail
            Point::at(0.0, -0.4, -0.4), // base (0.7, 0, 0.1): ahead of it
            Point::at(-0.4, 0.0, -0.4), // base (0.3, -0.4, 0.1): beside it
        ];
        let mut labels = vec![Kept; points.len()];
        label_self_hits(&points, &body, &base_from_lidar, &mut labels);
        use Reason::*;
        assert_eq!(labels, [SelfHit, SelfHit, Kept, Kept]);
    }
}
