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
    /// Submaps that a new one is aligned with, `N_s`.
    pub chain_submaps: usize,
    /// Nodes on each side of a candidate that a loop is checked with, `v`.
    pub loop_submaps: usize,
    /// Whether loops are closed.
    pub close_loops: bool,
    /// Nodes whose way to the present one is shorter are no candidates.
    pub loop_least_way_m: f64,
    /// Of the surfaces of a node, the share that has to overlap with a candidate's.
    pub loop_least_overlap: f64,
    /// Of these, the share that has to lie on the candidate's.
    pub loop_least_inliers: f64,
    /// Whether a submap that existing nodes cover becomes no node: the map then grows with the space,
    /// not with time.
    pub reuse_nodes: bool,
    /// Memory for submaps; the others are read from where the map is kept.
    pub submap_memory_mb: usize,
    /// How odometry errs.
    pub odometry_noise: OdometryNoise,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            node_every_m: None,
            node_every_rad: 1.2,
            chain_submaps: 4,
            loop_submaps: 3,
            close_loops: true,
            loop_least_way_m: 15.0,
            loop_least_overlap: 0.5,
            loop_least_inliers: 0.7,
            reuse_nodes: true,
            submap_memory_mb: 64,
            odometry_noise: OdometryNoise::default(),
        }
    }
}

impl SlamConfig {
    /// The way after which a node is fixed where submaps have cubes of this edge, metres.
    pub fn node_every_m(&self, voxel_m: f32) -> f64 {
        // Cubes grow with the distances seen; ten of them are a step that shows something new.
        let by_scene = (10.0 * f64::from(voxel_m)).clamp(1.5, 5.0);
        self.node_every_m.unwrap_or(by_scene)
    }
}
