//! The ground-aware intensity filter: weak returns go, unless they are the ground.
//!
//! In: points, the plane of the ground in the sensor frame, the reject range. Out: labels
//! [`Reason::Suspect`]. Glass, mirrors and black objects return little light and their points are
//! often not where they seem; the floor returns little too, at grazing incidence, but holds the
//! robot's height, roll and pitch in registration and must stay.
//!
//! Points are read in place, 32 bytes each: four of the eight words are used, yet arrays of their
//! own (structure of arrays) gain only where the cloud already lies in them; see the
//! `intensity_speed` example for the figures.

use hachi_hal::{Point, Pose};

use crate::adaptive::IntensityModel;
use crate::label::Reason;

/// Which intensity filter runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum IntensityMode {
    /// None: all intensities stay.
    None,
    /// Every point in the reject range goes, the ground's too.
    Intensity,
    /// Ground is what lies low in the footprint frame. One pass.
    #[default]
    Naive,
    /// Ground is what has a normal along the footprint's z axis.
    Normal,
}

/// Intensities that are not trusted, ends included, in the sensor's 0 to 255.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct RejectRange {
    /// Weakest intensity rejected.
    pub low: f32,
    /// Strongest intensity rejected.
    pub high: f32,
}

/// `[0, 15]`, the range of Rollo's thesis (2026).
impl Default for RejectRange {
    fn default() -> Self {
        Self {
            low: 0.0,
            high: 15.0,
        }
    }
}

impl RejectRange {
    /// Whether an intensity lies in the range. NaN does not.
    #[inline(always)]
    pub fn contains(self, intensity: f32) -> bool {
        (intensity >= self.low) & (intensity <= self.high)
    }
}

/// Height above the footprint plane as a function of a point in the sensor frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Height {
    /// The footprint's z axis in the sensor frame, unit.
    pub up: [f32; 3],
    /// Height of the sensor above the plane, metres.
    pub sensor_height_m: f32,
}

impl Height {
    /// The third row of a transform: heights need no more of it. `None` if it is not finite.
    pub fn from_pose(footprint_from_lidar: &Pose) -> Option<Self> {
        let rotation = footprint_from_lidar.rotation.to_rotation_matrix();
        let row = [0, 1, 2].map(|column| rotation[(2, column)] as f32);
        let height = footprint_from_lidar.translation.z as f32;
        (row.iter().all(|r| r.is_finite()) && height.is_finite()).then_some(Self {
            up: row,
            sensor_height_m: height,
        })
    }

    /// Height of a position above the plane, metres.
    #[inline(always)]
    pub fn of(&self, position: [f32; 3]) -> f32 {
        self.up[0] * position[0]
            + self.up[1] * position[1]
            + self.up[2] * position[2]
            + self.sensor_height_m
    }
}

/// Labels every kept point in the reject range.
pub fn label_weak(points: &[Point], reject: RejectRange, labels: &mut [Reason]) {
    for (point, label) in points.iter().zip(labels) {
        let goes = reject.contains(point.intensity) & label.is_kept();
        *label = if goes { Reason::Suspect } else { *label };
    }
}

/// Labels kept points in the reject range whose height is not below `ground_margin_m`. One pass,
/// no branches.
pub fn label_weak_above_ground(
    points: &[Point],
    reject: RejectRange,
    height: Height,
    ground_margin_m: f32,
    labels: &mut [Reason],
) {
    for (point, label) in points.iter().zip(labels) {
        let above = height.of(point.position()) >= ground_margin_m;
        let goes = reject.contains(point.intensity) & above & label.is_kept();
        *label = if goes { Reason::Suspect } else { *label };
    }
}

/// As [`label_weak_above_ground`], with the reject range a model has learnt for each distance.
/// With no height every point counts as above ground.
pub fn label_weak_by_model(
    points: &[Point],
    model: &IntensityModel,
    height: Option<Height>,
    ground_margin_m: f32,
    labels: &mut [Reason],
) {
    for (point, label) in points.iter().zip(labels) {
        let above = height.is_none_or(|h| h.of(point.position()) >= ground_margin_m);
        let weak = model.reject_at(point.position()).contains(point.intensity);
        if weak && above && label.is_kept() {
            *label = Reason::Suspect;
        }
    }
}

/// Whether some kept point is brighter than the reject range.
///
/// If none is, the source has no intensities (all zero) or another scale (0 to 1): a filter would
/// remove the whole scene, and learns nothing from it.
pub fn has_signal(points: &[Point], reject: RejectRange, labels: &[Reason]) -> bool {
    points
        .iter()
        .zip(labels)
        .any(|(point, label)| label.is_kept() && point.intensity > reject.high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use hachi_hal::{Rotation, Vector3};
    use nalgebra::Translation3;

    fn with_intensity(p: Vector3, intensity: f32) -> Point {
        Point {
            intensity,
            ..Point::at(p.x as f32, p.y as f32, p.z as f32)
        }
    }

    #[test]
    fn the_ends_of_the_reject_range_are_rejected_and_nan_is_not() {
        let range = RejectRange::default();
        let seen = [0.0, 15.0, 15.01, 255.0, -0.1, f32::NAN].map(|i| range.contains(i));
        assert_eq!(seen, [true, true, false, false, false, false]);
    }

    #[test]
    fn a_dark_floor_stays_and_a_dark_box_goes_on_a_body_tilted_fifteen_degrees() {
        // Sensor 0.6 m above the floor, rolled and pitched by 15 degrees: in the sensor frame the
        // floor 4 m ahead lies at about -1.7 m and 4 m behind above +0.4 m, so no limit on the
        // sensor's own z tells it from the box.
        let tilt = 15f64.to_radians();
        let footprint_from_lidar = Pose::from_parts(
            Translation3::new(0.1, 0.0, 0.6),
            Rotation::from_euler_angles(tilt, tilt, 0.3),
        );
        let lidar_from_footprint = footprint_from_lidar.inverse();
        let place = |x, y, z| (lidar_from_footprint * nalgebra::Point3::new(x, y, z)).coords;
        let (mut points, mut truth) = (vec![], vec![]);
        for step in 0..400 {
            let angle = f64::from(step) * 0.05;
            let (x, y) = (angle.cos(), angle.sin());
            let distance = 1.0 + f64::from(step) * 0.02;
            points.push(with_intensity(place(x * distance, y * distance, 0.0), 3.0));
            truth.push(Reason::Kept); // grazing floor
            points.push(with_intensity(place(x * 4.0, y * 4.0, 0.3), 3.0));
            truth.push(Reason::Suspect); // black box
            points.push(with_intensity(place(x * 4.0, y * 4.0, 0.3), 80.0));
            truth.push(Reason::Kept); // painted box
        }
        let lowest_box = points
            .iter()
            .skip(1)
            .step_by(3)
            .map(|p| p.z)
            .fold(f32::MAX, f32::min);
        let highest_floor = points
            .iter()
            .step_by(3)
            .map(|p| p.z)
            .fold(f32::MIN, f32::max);
        assert!(
            highest_floor > lowest_box + 1.0,
            "a limit on z would do here"
        );
        let height = Height::from_pose(&footprint_from_lidar).expect("finite");
        let mut labels = vec![Reason::Kept; points.len()];
        label_weak_above_ground(&points, RejectRange::default(), height, 0.05, &mut labels);
        assert_eq!(labels, truth);
        let mut plain = vec![Reason::Kept; points.len()];
        label_weak(&points, RejectRange::default(), &mut plain);
        assert!(plain.iter().step_by(3).all(|l| *l == Reason::Suspect));
    }

    #[test]
    fn ground_is_strictly_below_the_margin() {
        let height = Height {
            up: [0.0, 0.0, 1.0],
            sensor_height_m: 1.0,
        };
        let points = [-1.0, -0.75, -0.5].map(|z| with_intensity(Vector3::new(2.0, 0.0, z), 5.0));
        let mut labels = vec![Reason::Kept; 3];
        label_weak_above_ground(&points, RejectRange::default(), height, 0.25, &mut labels);
        assert_eq!(labels, [Reason::Kept, Reason::Suspect, Reason::Suspect]);
    }

    #[test]
    fn a_cloud_without_intensities_or_scaled_to_one_has_no_signal() {
        let labels = [Reason::Kept; 2];
        let at = |i| with_intensity(Vector3::new(2.0, 0.0, 0.0), i);
        let reject = RejectRange::default();
        assert!(!has_signal(&[at(0.0), at(0.0)], reject, &labels));
        assert!(!has_signal(&[at(0.2), at(0.99)], reject, &labels));
        assert!(has_signal(&[at(0.2), at(16.0)], reject, &labels));
    }
}
