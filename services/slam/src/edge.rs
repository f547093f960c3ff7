//! Edges of the graph of nodes: where one node lies as seen from another, and how surely.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::ledger::LoopId;
use crate::node::NodeId;

/// What an edge was made by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeKind {
    /// Two nodes that follow each other: odometry, and the alignment of the later to those before.
    Chain,
    /// A place that was recognised.
    Loop(LoopId),
}

/// An edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Counts from 0 over the life of a map.
    pub id: u32,
    /// What made it.
    pub kind: EdgeKind,
    /// The node it is measured from.
    pub first: NodeId,
    /// The node it leads to.
    pub second: NodeId,
    /// Takes points of the second's frame to the first's.
    pub first_from_second: Pose,
    /// Inverse covariance of an update on the right of `first_from_second`: translation first (1/m²),
    /// then rotation (1/rad²).
    pub information: Matrix6<f64>,
}
