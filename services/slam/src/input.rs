//! What SLAM is given for each scan, and what it answers.

use hachi_hal::{Point, Pose, Stamp};
use hachi_odometry::Condition;
use hachi_registration::Degeneracy;
use nalgebra::Matrix6;

use crate::condition::SlamCondition;
use crate::graph::GraphError;
use crate::ledger::LedgerEntry;
use crate::node::{NodeId, PieceId};
use crate::store::StoreError;

/// One scan as odometry placed it.
#[derive(Debug, Clone, Copy)]
pub struct ScanInput<'a> {
    /// The scan's end.
    pub stamp: Stamp,
    /// Where the base was then.
    pub odom_from_base: Pose,
    /// How far odometry trusts it.
    pub condition: Condition,
    /// Directions that the scan left open, base frame.
    pub open: Degeneracy,
    /// Where the sensor sits on the base, metres.
    pub base_from_sensor: [f64; 3],
    /// The points that filters left, base frame, deskewed to the scan's end. Looked at only where
    /// [`Slam::wants_points`](crate::Slam::wants_points) says so.
    pub points: &'a [Point],
}

/// Where the robot is on the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlamEstimate {
    /// The scan's end.
    pub stamp: Stamp,
    /// Takes points of the (smooth) odometry frame to the map. It jumps when a loop is closed.
    pub map_from_odom: Pose,
    /// Where the base is on the map.
    pub map_from_base: Pose,
    /// Covariance of `map_from_base`, translation first, of an update on its right.
    pub covariance: Matrix6<f64>,
    /// How far to trust it.
    pub condition: SlamCondition,
    /// The piece of map that `map_from_base` is on; `None` before the first node.
    pub piece: Option<PieceId>,
    /// The node that odometry hangs on, and where the base was seen from it by odometry: what is needed
    /// to place this scan again when the node has moved. `None` before the first node.
    pub anchor: Option<(NodeId, Pose)>,
}

/// A submap that existing nodes cover: it became no node, and the robot was here all the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visit {
    /// The end of its first scan.
    pub stamp: Stamp,
    /// Its frame, as odometry had it.
    pub odom_from_submap: Pose,
    /// The node that covers it.
    pub node: NodeId,
    /// Its frame as seen from the node.
    pub node_from_submap: Pose,
}

/// What a step brought besides the pose.
#[derive(Debug, Default)]
pub struct SlamEvents {
    /// Nodes that were fixed.
    pub fixed: Vec<NodeId>,
    /// Submaps that became no node.
    pub visits: Vec<Visit>,
    /// Ledger entries that are new, or were decided anew.
    pub ledger: Vec<LedgerEntry>,
    /// Whether old nodes moved.
    pub moved: bool,
    /// Pieces that were joined: the first is now part of the second.
    pub joined: Vec<(PieceId, PieceId)>,
    /// What the store could not do.
    pub store_errors: Vec<StoreError>,
    /// What the graph would not take.
    pub graph_errors: Vec<GraphError>,
}

impl SlamEvents {
    /// Empties it, keeping its memory.
    pub fn clear(&mut self) {
        self.fixed.clear();
        self.visits.clear();
        self.ledger.clear();
        self.moved = false;
        self.joined.clear();
        self.store_errors.clear();
        self.graph_errors.clear();
    }
}
