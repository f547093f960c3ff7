//! Finding the way back: which place of the map a piece that hangs on nothing lies at.
//!
//! In: candidates of other pieces that alignment has proven, node after node. Out: where the whole
//! piece lies, once enough nodes say the same and no other place has as good a claim. One
//! recognition alone is never believed: two corridors can look the same, two corridors with the same
//! bend after the same distance seldom do.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::closing::Proven;
use crate::ledger::LoopId;
use crate::map::{Map, difference};
use crate::node::{NodeId, PieceId};

/// Votes that are kept; the oldest go.
const MOST_VOTES: usize = 48;

/// Two votes that place a node this far apart, at most, say the same.
const SAME_M: f64 = 0.5;
const SAME_RAD: f64 = 0.06;

/// Nodes that have to say the same.
const AGREEING: usize = 2;

/// And how many more there have to be than of any other place.
const LEAD: usize = 2;

/// One node's word on where the piece lies.
#[derive(Debug, Clone, Copy)]
struct Vote {
    id: LoopId,
    node: NodeId,
    target: PieceId,
    target_from_piece: Pose,
    information: Matrix6<f64>,
}

/// Where a piece lies.
#[derive(Debug, Clone)]
pub struct Found {
    /// The piece it lies on.
    pub target: PieceId,
    /// Takes its frame to the target's.
    pub target_from_piece: Pose,
    /// The loops that say so.
    pub loops: Vec<(LoopId, Matrix6<f64>)>,
}

/// The votes on where the present piece lies.
#[derive(Debug, Default)]
pub struct Recognition {
    votes: Vec<Vote>,
    nodes: usize,
    leading: usize,
}

impl Recognition {
    /// Starts anew, for another piece.
    pub fn clear(&mut self) {
        self.votes.clear();
        self.nodes = 0;
        self.leading = 0;
    }

    /// One more node was looked for.
    pub fn count_node(&mut self) {
        self.nodes += 1;
    }

    /// Nodes that were looked for.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Nodes that agree on the best place so far.
    pub fn leading(&self) -> usize {
        self.leading
    }

    /// Takes a proven candidate; the piece's place if it is decided now.
    pub fn vote(&mut self, map: &Map, proven: &Proven) -> Option<Found> {
        let entry = &proven.entry;
        let (node, old) = (map.node(entry.node)?, map.node(entry.candidate)?);
        let target_from_node = old.map_from_node * entry.candidate_from_node;
        let vote = Vote {
            id: entry.id,
            node: node.id,
            target: old.piece,
            target_from_piece: target_from_node * node.map_from_node.inverse(),
            information: proven.information,
        };
        if self.votes.len() >= MOST_VOTES {
            self.votes.remove(0);
        }
        self.votes.push(vote);
        let (agreeing, rivals) = self.support(&vote, &node.map_from_node);
        self.leading = self.leading.max(agreeing);
        if agreeing < AGREEING || agreeing < rivals + LEAD {
            return None;
        }
        let mut loops: Vec<(LoopId, Matrix6<f64>)> = Vec::new();
        let mut nodes: Vec<NodeId> = Vec::new();
        for v in self.votes.iter().rev() {
            if same(v, &vote, &node.map_from_node) && !nodes.contains(&v.node) {
                nodes.push(v.node);
                loops.push((v.id, v.information));
            }
        }
        Some(Found {
            target: vote.target,
            target_from_piece: vote.target_from_piece,
            loops,
        })
    }

    /// How many nodes agree with a vote, and how many with the best of the others.
    fn support(&self, vote: &Vote, piece_from_here: &Pose) -> (usize, usize) {
        let count = |of: &Vote| {
            let mut nodes: Vec<NodeId> = self
                .votes
                .iter()
                .filter(|v| same(v, of, piece_from_here))
                .map(|v| v.node)
                .collect();
            nodes.sort_unstable();
            nodes.dedup();
            nodes.len()
        };
        let others = self
            .votes
            .iter()
            .filter(|v| !same(v, vote, piece_from_here))
            .map(count)
            .max();
        (count(vote), others.unwrap_or(0))
    }
}

/// Whether two votes put the robot at the same place.
fn same(a: &Vote, b: &Vote, piece_from_here: &Pose) -> bool {
    let off = difference(
        &(a.target_from_piece * piece_from_here),
        &(b.target_from_piece * piece_from_here),
    );
    a.target == b.target
        && off.fixed_rows::<3>(0).norm() < SAME_M
        && off.fixed_rows::<3>(3).norm() < SAME_RAD
}
