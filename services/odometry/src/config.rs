//! Settings of the odometry.

use hachi_hal::{Pose, Rotation};
use hachi_registration::Agility;

/// Settings of the odometry. The defaults suit a walking robot indoors and a car outdoors alike:
/// lengths follow from the scene unless they are set here.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OdometryConfig {
    /// Points a scan is reduced to; the voxel size follows from it. More is slower and, past three
    /// thousand, hardly more accurate.
    pub target_points: usize,
    /// Edge of a map cell. Unset, it is twice the voxel size the scene asks for.
    pub cell_m: Option<f32>,
    /// Surfaces farther from the robot than this are dropped from the map.
    pub map_range_m: f32,
    /// Surfaces not seen for so much of the way are dropped too: odometry drifts, and a place come
    /// back to would contradict itself. Loops are SLAM's to close.
    pub map_memory_m: f64,
    /// Time between two poses within a scan: short against the gait, long enough for the points
    /// in it to fix a pose.
    pub knot_interval_s: f64,
    /// Accelerations that are ordinary for the robot at its liveliest; a calmer way is learnt from the
    /// scans.
    pub agility: Agility,
    /// Information about a direction, as a share of that about the best-known one, below which
    /// the scan is not asked about it. A narrow corridor with doors leaves half a percent, a
    /// bare one a tenth of that.
    pub degeneracy_threshold: f64,
    /// Scans in a row that fit nothing before the condition is `LOST`.
    pub lost_after: usize,
    #[cfg_attr(feature = "serde", serde(skip))]
    /// Rotation from the IMU's frame to the LiDAR's, as a unit quaternion.
    pub lidar_from_imu: Rotation,
    /// Noise of a gyroscope's reading, rad/s (white, one standard deviation).
    pub gyro_noise_rad_per_s: f64,
    #[cfg_attr(feature = "serde", serde(skip))]
    /// Where the LiDAR sits in the frame that external odometry reports.
    pub base_from_lidar: Pose,
    /// Error of external odometry as a share of the distance and of the turn.
    pub odometry_error_share: f64,
}

impl Default for OdometryConfig {
    fn default() -> Self {
        Self {
            target_points: 3_000,
            cell_m: None,
            map_range_m: 100.0,
            map_memory_m: 100.0,
            knot_interval_s: 0.025,
            agility: Agility::default(),
            degeneracy_threshold: 0.003,
            lost_after: 10,
            lidar_from_imu: Rotation::identity(),
            gyro_noise_rad_per_s: 0.02,
            base_from_lidar: Pose::identity(),
            odometry_error_share: 0.05,
        }
    }
}
