//! How the sensor moved while it measured one scan, and undoing that.
//!
//! In: the pose of the scan's end seen from any moment of the scan. Out: points as they would have
//! been measured from there. The motion is tabulated once a scan and blended between entries.

use hachi_hal::Pose;

/// Entries of the table. A scan of a tenth of a second at 5 rad/s turns by 8 mrad between two, so
/// that blending errs by 8 µrad.
const KNOTS: usize = 64;

/// A motion over one scan, tabulated.
#[derive(Debug, Clone)]
pub struct ScanMotion {
    /// `end_from_moment`: rotation row by row, then translation.
    knots: [[f32; 12]; KNOTS + 1],
}

impl Default for ScanMotion {
    fn default() -> Self {
        let mut still = Self {
            knots: [[0.0; 12]; KNOTS + 1],
        };
        still.tabulate(|_| Pose::identity());
        still
    }
}

impl ScanMotion {
    /// Sets the motion from `end_from_moment` at shares 0 to 1 of the scan.
    pub fn tabulate(&mut self, end_from_moment: impl Fn(f64) -> Pose) {
        for (i, knot) in self.knots.iter_mut().enumerate() {
            let pose = end_from_moment(i as f64 / KNOTS as f64);
            let m = pose.rotation.to_rotation_matrix();
            let t = pose.translation.vector;
            *knot = std::array::from_fn(|k| match k {
                0..9 => m[(k / 3, k % 3)] as f32,
                _ => t[k - 9] as f32,
            });
        }
    }

    /// Sets the motion along evenly spaced `poses` (`target_from_sensor`), the scan beginning at
    /// share `from` of the way along them and ending at the last.
    pub fn follow(&mut self, poses: &[Pose], from: f64) {
        let intervals = poses.len().saturating_sub(1);
        let Some(end) = poses.last().filter(|_| intervals > 0) else {
            return;
        };
        self.tabulate(|share| {
            let along = (from + share * (1.0 - from)).clamp(0.0, 1.0) * intervals as f64;
            let i = (along as usize).min(intervals - 1);
            let rest = along - i as f64;
            let pose = poses[i]
                .try_lerp_slerp(&poses[i + 1], rest, 1e-9)
                .unwrap_or(poses[i]);
            end.inv_mul(&pose)
        });
    }

    /// Takes a point measured at `share` (0 first, 1 last point) to the frame of the scan's end.
    #[inline]
    pub fn to_end(&self, point: [f32; 3], share: f32) -> [f32; 3] {
        let m = self.at(share);
        std::array::from_fn(|r| {
            m[3 * r] * point[0] + m[3 * r + 1] * point[1] + m[3 * r + 2] * point[2] + m[9 + r]
        })
    }

    /// The inverse of [`ScanMotion::to_end`].
    #[inline]
    pub fn from_end(&self, point: [f32; 3], share: f32) -> [f32; 3] {
        let m = self.at(share);
        turned_back(&m, std::array::from_fn(|r| point[r] - m[9 + r]))
    }

    /// Turns a direction from the frame of the scan's end back to that of the moment.
    #[inline]
    pub fn direction_from_end(&self, direction: [f32; 3], share: f32) -> [f32; 3] {
        turned_back(&self.at(share), direction)
    }

    #[inline]
    fn at(&self, share: f32) -> [f32; 12] {
        // A share that is not a number passes the clamp and lands, as zero, at the first entry.
        let scaled = share.clamp(0.0, 1.0) * KNOTS as f32;
        let i = (scaled as usize).min(KNOTS - 1);
        let w = if scaled.is_finite() {
            scaled - i as f32
        } else {
            0.0
        };
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        std::array::from_fn(|k| a[k] + w * (b[k] - a[k]))
    }
}

#[inline]
fn turned_back(m: &[f32; 12], d: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| m[c] * d[0] + m[3 + c] * d[1] + m[6 + c] * d[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::Vector3;

    #[test]
    fn the_first_point_moves_back_by_the_whole_motion_and_the_last_stays() {
        let step = Pose::new(Vector3::new(0.2, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.1));
        let mut motion = ScanMotion::default();
        motion.follow(&[Pose::identity(), step], 0.0);
        let first = motion.to_end([3.0, 1.0, 0.5], 0.0);
        let expected = step.inverse() * nalgebra::Point3::new(3.0, 1.0, 0.5);
        for a in 0..3 {
            assert!(
                (f64::from(first[a]) - expected[a]).abs() < 1e-6,
                "{first:?} {expected}"
            );
        }
        let last = motion.to_end([3.0, 1.0, 0.5], 1.0);
        for (a, b) in last.into_iter().zip([3.0, 1.0, 0.5]) {
            assert!((a - b).abs() < 1e-6, "{last:?}");
        }
    }

    #[test]
    fn undoing_is_the_inverse() {
        let poses = [
            Pose::identity(),
            Pose::new(Vector3::new(0.1, 0.02, 0.0), Vector3::new(0.1, 0.0, -0.2)),
            Pose::new(
                Vector3::new(0.15, -0.02, 0.03),
                Vector3::new(0.0, 0.1, -0.3),
            ),
        ];
        let mut motion = ScanMotion::default();
        motion.follow(&poses, 0.05);
        for share in [0.0, 0.013, 0.4, 0.77, 1.0] {
            let back = motion.from_end(motion.to_end([4.0, -7.0, 1.0], share), share);
            for (a, b) in back.into_iter().zip([4.0, -7.0, 1.0]) {
                assert!((a - b).abs() < 1e-3, "{back:?}");
            }
        }
        assert!(
            motion
                .to_end([1.0, 1.0, 1.0], f32::NAN)
                .iter()
                .all(|c| c.is_finite())
        );
    }
}
