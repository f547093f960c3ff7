//! Settings.

use crate::uncertainty::OdometryNoise;

/// Settings of SLAM.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SlamConfig {
    /// A node is fixed when the robot has travelled this far since the last, the thesis's
    /// `delta_m`. Unset, it follows from how far one sees: 1.5 m in rooms, 5 m in streets.
    pub node_every_m: Option<f64>,
    /// Or has turned this far, `delta_theta`.
    pub node_every_rad: f64,
    /// But not before this many scans: what a node costs is spread over them.
    pub node_least_scans: usize,
    /// A scan joins the submap when the robot has moved this far since the last that did.
    pub scan_every_m: f64,
    /// Or has turned this far.
    pub scan_every_rad: f64,
    /// Points of one scan that join, evenly picked.
    pub scan_points: usize,
    /// Submaps that a new one is aligned with, `N_s`.
    pub chain_submaps: usize,
    /// Nodes on each side of a candidate that a loop is checked with, `v`.
    pub loop_submaps: usize,
    /// Whether loops are closed.
    pub close_loops: bool,
    /// Nodes whose way to the present one is shorter are no candidates.
    pub loop_least_way_m: f64,
    /// Least half axis of the search ellipsoid, metres; it grows by the standard deviation of the
    /// position between candidate and node.
    pub search_least_m: f64,
    /// Standard deviations that are added to it.
    pub search_sigmas: f64,
    /// Of the surfaces of a node, the share that has to overlap with a candidate's.
    pub loop_least_overlap: f64,
    /// Of these, the share that has to lie on the candidate's.
    pub loop_least_inliers: f64,
    /// See [`Degeneracy::of`](hachi_registration::Degeneracy::of).
    pub degeneracy_threshold: f64,
    /// Squared Mahalanobis distance to the graph beyond which a loop needs others that agree; for
    /// six degrees of freedom one in a thousand true ones is farther.
    pub loop_most_chi2: f64,
    /// Loops that have to agree where the graph does not.
    pub loop_agreeing: usize,
    /// How odometry errs.
    pub odometry_noise: OdometryNoise,
    /// Memory for submaps.
    pub submap_memory_mb: usize,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            node_every_m: None,
            node_every_rad: 1.2,
            node_least_scans: 10,
            scan_every_m: 0.2,
            scan_every_rad: 0.15,
            scan_points: 10_000,
            chain_submaps: 4,
            loop_submaps: 3,
            close_loops: true,
            loop_least_way_m: 15.0,
            search_least_m: 4.0,
            search_sigmas: 3.0,
            loop_least_overlap: 0.5,
            loop_least_inliers: 0.7,
            degeneracy_threshold: 0.003,
            loop_most_chi2: 22.46,
            loop_agreeing: 2,
            odometry_noise: OdometryNoise::default(),
            submap_memory_mb: 64,
        }
    }
}
