//! The last look before a robot that was lost says OK: does what it sees now lie on the map?
//!
//! In: a scan, and where the robot is said to be. Out: whether to believe it. A place is recognised by
//! submaps; since the last of them odometry alone has followed the robot, and what turns a robot that
//! is lost on the spot in a narrow corridor also upsets odometry.

use hachi_hal::{Point, Pose};
use hachi_registration::{Aligner, AlignerConfig, Kernel, Solver, SurfacePoint};

use crate::alignment::{OPEN_SHARE, judge};
use crate::closing::gather;
use crate::config::SlamConfig;
use crate::map::Map;
use crate::node::NodeId;
use crate::surfaces::Surfaces;
use crate::tangent::difference;

/// Points of a scan that are looked at.
const POINTS: usize = 800;

/// Nodes on each side of the nearest old one that they are laid on.
const NODES: u32 = 3;

/// An old node this close to the robot shows what it sees, metres.
const NEAR_M: f64 = 8.0;

/// Nodes that are too young to say anything: odometry put them there.
const RECENT: usize = 8;

/// Share of the points that have to lie on the map once they were aligned with it.
const LEAST_FIT: f64 = 0.7;

/// How far alignment may move them from where the robot is said to be, metres and radians. The share
/// alone says little: in a corridor most points lie on floor and ceiling, whichever way the robot faces.
const MOST_OFF_M: f64 = 0.1;
const MOST_OFF_RAD: f64 = 0.02;

/// Nodes after which it is believed all the same: the map is new here, or full of people, and every
/// one of them was laid on those before it.
const NODES_ENOUGH: usize = 8;

/// From as far off as odometry may be after a few bad scans.
const CONFIG: AlignerConfig = AlignerConfig {
    reach_m: 1.0,
    max_iterations: 8,
    translation_epsilon_m: 5e-3,
    rotation_epsilon_rad: 2e-3,
    kernel: Kernel::GemanMcClure { scale_m: 0.4 },
    solver: Solver::GaussNewton,
    degeneracy_threshold: OPEN_SHARE,
};

/// Whether a place that was just recognised is believed; keeps its buffers.
#[derive(Debug, Default)]
pub struct Confirmation {
    is_due: bool,
    fixed: usize,
    around: Option<NodeId>,
    target: Surfaces,
    points: Vec<SurfacePoint>,
    aligner: Aligner,
}

impl Confirmation {
    /// A place was recognised.
    pub fn demand(&mut self) {
        self.is_due = true;
        self.fixed = 0;
        self.around = None;
    }

    /// Whether the last look is still to be had.
    pub fn is_due(&self) -> bool {
        self.is_due
    }

    /// Nodes were fixed since.
    pub fn count(&mut self, fixed: usize) {
        self.fixed += fixed;
        if self.fixed >= NODES_ENOUGH {
            self.is_due = false;
        }
    }

    /// Looks: `points` in the base's frame, `session` the present one.
    pub fn look(
        &mut self,
        map: &mut Map,
        map_from_base: &Pose,
        session: u32,
        points: &[Point],
        config: &SlamConfig,
    ) {
        let here = map_from_base.translation.vector;
        let distance = |pose: &Pose| (pose.translation.vector - here).norm();
        let old = map
            .nodes()
            .iter()
            .filter(|n| n.session != session || n.id.index() + RECENT < map.nodes().len())
            .map(|n| (*n, distance(&n.map_from_node)))
            .filter(|(_, distance)| *distance < NEAR_M)
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((old, _)) = old else {
            return;
        };
        if self.around != Some(old.id) {
            if !gather(map, &old, NODES, NODES, config, &mut self.target) {
                return;
            }
            self.target.index();
            self.around = Some(old.id);
        }
        let stride = points.len().div_ceil(POINTS).max(1);
        self.points.clear();
        self.points
            .extend(points.iter().step_by(stride).map(|p| SurfacePoint {
                position: p.position(),
                normal: [0.0; 3],
            }));
        let target_from_base = old.map_from_node.inv_mul(map_from_base);
        let found =
            self.aligner
                .align(&self.points, &self.target, &target_from_base, None, &CONFIG);
        let off = difference(&target_from_base, &found.target_from_source);
        let fitness = judge(&self.points, &self.target, &found.target_from_source);
        let is_there = fitness.fit_share >= LEAST_FIT
            && off.fixed_rows::<3>(0).norm() <= MOST_OFF_M
            && off.fixed_rows::<3>(3).norm() <= MOST_OFF_RAD;
        self.is_due = !is_there;
    }
}
