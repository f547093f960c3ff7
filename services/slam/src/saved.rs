//! A map as it is read back: everything but the submaps, which are read one by one.
//!
//! In: rows of a file that may be damaged or hostile. Out: a [`SavedMap`] whose parts fit together,
//! or what does not.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::edge::{Edge, EdgeKind};
use crate::ledger::LedgerEntry;
use crate::node::{Ground, Node, NodeId, PieceId};

/// More nodes than any robot makes: a node every two metres for 8,000 km.
pub const MOST_NODES: usize = 1 << 22;

/// A map without its submaps.
#[derive(Debug, Clone, Default)]
pub struct SavedMap {
    /// Nodes, by number.
    pub nodes: Vec<Node>,
    /// Looks of nodes, as [`hachi_place::Descriptor::to_bytes`] writes them.
    pub descriptors: Vec<(NodeId, Vec<u8>)>,
    /// Edges that hold.
    pub edges: Vec<Edge>,
    /// The loop ledger, by number.
    pub ledger: Vec<LedgerEntry>,
}

/// What does not fit together.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SavedMapError {
    /// A row is missing, or there twice.
    #[error("{what} {expected} is missing: {got} is in its place")]
    Gap {
        /// Of which list.
        what: &'static str,
        /// The number that should come.
        expected: usize,
        /// The number that came.
        got: u64,
    },
    /// Something leads to a node that is not there.
    #[error("{what} {number} leads to node {node}, which is not there")]
    NoSuchNode {
        /// Of which list.
        what: &'static str,
        /// Its number.
        number: u32,
        /// The node.
        node: u32,
    },
    /// A number that is none, or no rotation.
    #[error("{what} {number} has a pose or a matrix that is none")]
    NotFinite {
        /// Of which list.
        what: &'static str,
        /// Its number.
        number: u32,
    },
    /// A piece that begins before the one with the number before it, or the first not with zero.
    #[error("node {node} is of piece {piece}, of which there is no beginning")]
    Piece {
        /// The node.
        node: u32,
        /// The piece.
        piece: u32,
    },
}

impl SavedMap {
    /// Whether its parts fit together.
    ///
    /// # Errors
    /// [`SavedMapError`], the first.
    pub fn check(&self) -> Result<(), SavedMapError> {
        let gap = |what, expected, got: u32| SavedMapError::Gap {
            what,
            expected,
            got: u64::from(got),
        };
        for (i, node) in self.nodes.iter().enumerate() {
            if node.id.index() != i || i >= MOST_NODES {
                return Err(gap("node", i, node.id.0));
            }
            if !is_pose(&node.map_from_node)
                || !is_pose(&node.odom_from_node)
                || !node.path_m.is_finite()
                || !is_ground(&node.ground)
            {
                return Err(not_finite("node", node.id.0));
            }
            // A piece has at least a node, and joined ones keep their number.
            if node.piece.0 as usize > i {
                return Err(SavedMapError::Piece {
                    node: node.id.0,
                    piece: node.piece.0,
                });
            }
        }
        let there = |what, number, node: NodeId| match self.nodes.get(node.index()) {
            Some(_) => Ok(()),
            None => Err(SavedMapError::NoSuchNode {
                what,
                number,
                node: node.0,
            }),
        };
        for edge in &self.edges {
            there("edge", edge.id, edge.first)?;
            there("edge", edge.id, edge.second)?;
            if !is_pose(&edge.first_from_second) || !is_information(&edge.information) {
                return Err(not_finite("edge", edge.id));
            }
            if let EdgeKind::Loop(id) = edge.kind
                && id.0 as usize >= self.ledger.len()
            {
                return Err(gap("ledger entry", self.ledger.len(), id.0));
            }
        }
        for (i, entry) in self.ledger.iter().enumerate() {
            if entry.id.0 as usize != i {
                return Err(gap("ledger entry", i, entry.id.0));
            }
            there("ledger entry", entry.id.0, entry.node)?;
            there("ledger entry", entry.id.0, entry.candidate)?;
            if !is_pose(&entry.candidate_from_node) {
                return Err(not_finite("ledger entry", entry.id.0));
            }
        }
        Ok(())
    }

    /// How many pieces there are or were.
    pub fn pieces(&self) -> u32 {
        let highest = self.nodes.iter().map(|n| n.piece).max();
        highest.map_or(0, |PieceId(p)| p + 1)
    }

    /// How many runs of the robot made it.
    pub fn sessions(&self) -> u32 {
        let highest = self.nodes.iter().map(|n| n.session).max();
        highest.map_or(0, |s| s.saturating_add(1))
    }
}

fn not_finite(what: &'static str, number: u32) -> SavedMapError {
    SavedMapError::NotFinite { what, number }
}

/// Farther out than any robot goes: a slip, or a trap for whoever divides space into cells.
const FARTHEST_M: f64 = 1e7;

fn is_pose(pose: &Pose) -> bool {
    let near = |c: &f64| c.abs() < FARTHEST_M;
    pose.translation.vector.iter().all(near) && (pose.rotation.as_ref().norm() - 1.0).abs() < 1e-6
}

fn is_ground(ground: &Ground) -> bool {
    let length: f32 = ground.up.iter().map(|c| c * c).sum();
    (length - 1.0).abs() < 1e-2 && ground.below_m.abs() < 1e3
}

fn is_information(information: &Matrix6<f64>) -> bool {
    information.iter().all(|v| v.is_finite())
        && information.diagonal().iter().all(|d| *d > 0.0)
        && information.cholesky().is_some()
}
