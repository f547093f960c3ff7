//! Finding the way back: which place of the map a piece that hangs on nothing lies at.
//!
//! In: what alignment found at each place that looks like the present one, node after node. Out: where
//! the whole piece lies, once enough speaks for one place and little for any other. Places that were
//! refused count too, against: two corridors can look the same, and then both fit.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::ledger::{LedgerEntry, LoopId};
use crate::map::{Map, difference};
use crate::node::{NodeId, PieceId};

/// Votes that are kept; the oldest go.
const MOST_VOTES: usize = 64;

/// Two votes that place the robot this far apart, at most, say the same.
const SAME_M: f64 = 0.6;
const SAME_RAD: f64 = 0.06;

/// Nodes that have to be proven at the same place, and how much more has to speak for it than for the
/// next best.
const AGREEING: usize = 2;
const LEAD: f64 = 1.3;

/// One node is enough if so much of what it sees lies there, and so much less anywhere else.
const ALONE_FIT: f64 = 0.7;
const ALONE_LEAD: f64 = 1.8;

/// One node's word on where the piece lies.
#[derive(Debug, Clone, Copy)]
struct Vote {
    node: NodeId,
    target: PieceId,
    target_from_piece: Pose,
    /// Share of what the node sees that lies on the map there.
    fit: f64,
    /// The loop it would be, if the alignment proved it.
    proven: Option<(LoopId, Matrix6<f64>)>,
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

/// What speaks for one place.
#[derive(Debug, Clone, Copy, Default)]
struct Support {
    /// Nodes proven there.
    proven: usize,
    /// The best fits of all nodes, added up.
    score: f64,
}

impl Recognition {
    /// Starts anew, for another piece.
    pub fn clear(&mut self) {
        self.votes.clear();
        self.nodes = 0;
        self.leading = 0;
    }

    /// Nodes that were looked for.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Nodes that agree on the best place so far.
    pub fn leading(&self) -> usize {
        self.leading
    }

    /// Takes what was found for a candidate; `information` if it is proven.
    pub fn vote(&mut self, map: &Map, entry: &LedgerEntry, information: Option<Matrix6<f64>>) {
        let (Some(node), Some(old)) = (map.node(entry.node), map.node(entry.candidate)) else {
            return;
        };
        let fit = f64::from(entry.overlap * entry.inlier_share);
        // Not aligned at all: it says nothing.
        if !fit.is_finite() {
            return;
        }
        let target_from_node = old.map_from_node * entry.candidate_from_node;
        if self.votes.len() >= MOST_VOTES {
            self.votes.remove(0);
        }
        self.votes.push(Vote {
            node: node.id,
            target: old.piece,
            target_from_piece: target_from_node * node.map_from_node.inverse(),
            fit,
            proven: information.map(|i| (entry.id, i)),
        });
    }

    /// All candidates of a node were asked: where the piece lies, if that is decided now.
    pub fn conclude(&mut self, map: &Map, node: NodeId) -> Option<Found> {
        self.nodes += 1;
        let piece_from_here = map.node(node)?.map_from_node;
        let mut best: Option<(usize, Support)> = None;
        for (i, vote) in self.votes.iter().enumerate() {
            let support = self.support(vote, &piece_from_here);
            if vote.proven.is_some() && best.is_none_or(|(_, b)| support.score > b.score) {
                best = Some((i, support));
            }
        }
        let (index, support) = best?;
        let best = self.votes[index];
        let rival = self
            .votes
            .iter()
            .filter(|v| !same(v, &best, &piece_from_here))
            .map(|v| self.support(v, &piece_from_here).score)
            .fold(0.0, f64::max);
        self.leading = support.proven;
        let together = support.proven >= AGREEING && support.score >= LEAD * rival;
        let alone = best.fit >= ALONE_FIT && support.score >= ALONE_LEAD * rival;
        if !together && !alone {
            return None;
        }
        let mut loops: Vec<(LoopId, Matrix6<f64>)> = Vec::new();
        let mut nodes: Vec<NodeId> = Vec::new();
        for vote in self.votes.iter().rev() {
            if let Some(proven) = vote.proven
                && same(vote, &best, &piece_from_here)
                && !nodes.contains(&vote.node)
            {
                nodes.push(vote.node);
                loops.push(proven);
            }
        }
        Some(Found {
            target: best.target,
            target_from_piece: best.target_from_piece,
            loops,
        })
    }

    fn support(&self, of: &Vote, piece_from_here: &Pose) -> Support {
        let mut fits: Vec<(NodeId, f64, bool)> = self
            .votes
            .iter()
            .filter(|v| same(v, of, piece_from_here))
            .map(|v| (v.node, v.fit, v.proven.is_some()))
            .collect();
        // The best of each node.
        fits.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        fits.dedup_by_key(|f| f.0);
        Support {
            proven: fits.iter().filter(|f| f.2).count(),
            score: fits.iter().map(|f| f.1).sum(),
        }
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
