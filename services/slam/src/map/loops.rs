//! Loops of the map: opened, closed, weighed against each other, taken out by hand; and the joining of
//! pieces by them.
//!
//! In: ledger entries with what alignment found. Out: edges, verdicts. The graph decides what each
//! loop is worth: one that the rest contradicts is outvoted, and named so in the ledger.

use hachi_hal::{Pose, Stamp};
use nalgebra::Matrix6;

use super::Map;
use crate::edge::{Edge, EdgeKind};
use crate::graph::GraphError;
use crate::ledger::{FoundBy, LedgerEntry, LoopId, Verdict};
use crate::node::{NodeId, PieceId};

/// A loop farther than this from where the graph has its nodes, in squared standard deviations of its
/// own, is outvoted: the rest of the graph does not believe it. Twice what one in a thousand true ones
/// exceeds.
const OUTVOTED_CHI2: f64 = 45.0;

impl Map {
    /// Opens a ledger entry.
    pub fn open_entry(
        &mut self,
        stamp: Stamp,
        node: NodeId,
        candidate: NodeId,
        found_by: FoundBy,
    ) -> LedgerEntry {
        let id = LoopId(self.ledger.len() as u32);
        let entry = LedgerEntry::new(id, stamp, node, candidate, found_by);
        self.ledger.push(entry);
        entry
    }

    /// Writes an entry back as it was decided.
    pub fn close_entry(&mut self, entry: LedgerEntry) {
        if let Some(old) = self.ledger.get_mut(entry.id.0 as usize) {
            *old = entry;
            self.pending.ledger.push(entry.id);
        }
    }

    /// Adds loops between nodes of one piece; the entries they belong to become accepted.
    ///
    /// # Errors
    /// The graph refuses them; the map is as it was.
    pub fn add_loops(
        &mut self,
        loops: &[(LoopId, Matrix6<f64>)],
    ) -> Result<Vec<LedgerEntry>, GraphError> {
        let edges = self.loop_edges(loops);
        let last = edges.last().and_then(|edge| self.node(edge.second));
        let Some(piece) = last.map(|node| node.piece) else {
            return Ok(Vec::new());
        };
        if let Some(graph) = &mut self.pieces[piece.0 as usize].graph {
            graph.update(&[], &edges, &[])?;
            graph.settle()?;
        }
        self.next_edge += edges.len() as u32;
        self.edges.extend_from_slice(&edges);
        self.pending.edges.extend_from_slice(&edges);
        self.take_poses(piece);
        let mut decided = self.accept(loops);
        decided.extend(self.weigh_loops(piece));
        Ok(decided)
    }

    /// Joins a piece to another: `target_from_piece` takes the frame of the one to that of the other.
    /// Its nodes and edges move over, with the loops that hold them.
    ///
    /// # Errors
    /// The graph refuses them; the map is as it was.
    pub fn join(
        &mut self,
        piece: PieceId,
        target: PieceId,
        target_from_piece: &Pose,
        loops: &[(LoopId, Matrix6<f64>)],
    ) -> Result<Vec<LedgerEntry>, GraphError> {
        let members: Vec<NodeId> = self
            .nodes
            .iter()
            .filter(|n| n.piece == piece)
            .map(|n| n.id)
            .collect();
        let placed: Vec<(NodeId, Pose)> = members
            .iter()
            .map(|id| {
                (
                    *id,
                    target_from_piece * self.nodes[id.index()].map_from_node,
                )
            })
            .collect();
        let belongs = |id: NodeId| self.nodes.get(id.index()).is_some_and(|n| n.piece == piece);
        let mut edges: Vec<Edge> = self
            .edges
            .iter()
            .filter(|e| belongs(e.first) && belongs(e.second))
            .copied()
            .collect();
        let old = edges.len();
        edges.extend(self.loop_edges(loops));
        let Some(graph) = &mut self.pieces[target.0 as usize].graph else {
            return Ok(Vec::new());
        };
        graph.update(&placed, &edges, &[])?;
        graph.settle()?;
        for (id, pose) in placed {
            let node = &mut self.nodes[id.index()];
            node.piece = target;
            node.map_from_node = pose;
        }
        let joined = &mut self.pieces[piece.0 as usize];
        joined.graph = None;
        joined.joined_to = Some(target);
        self.next_edge += (edges.len() - old) as u32;
        self.edges.extend_from_slice(&edges[old..]);
        self.pending.edges.extend_from_slice(&edges[old..]);
        self.pending.joined.push((piece, target));
        self.take_poses(target);
        Ok(self.accept(loops))
    }

    /// The edges between two nodes.
    pub fn ties(&self, a: NodeId, b: NodeId) -> impl Iterator<Item = &Edge> {
        self.edges
            .iter()
            .filter(move |e| (e.first, e.second) == (a, b) || (e.first, e.second) == (b, a))
    }

    /// Whether a loop between two nodes was vetoed or outvoted: they are tied by it no more.
    pub fn is_contested(&self, a: NodeId, b: NodeId) -> bool {
        self.ledger.iter().any(|l| {
            matches!(l.verdict, Verdict::Vetoed | Verdict::Outvoted)
                && ((l.node, l.candidate) == (a, b) || (l.node, l.candidate) == (b, a))
        })
    }

    /// A loop was measured once more, with the same result.
    pub fn agrees(&mut self, id: LoopId) {
        if let Some(entry) = self.ledger.get_mut(id.0 as usize) {
            entry.agreeing = entry.agreeing.saturating_add(1);
            self.pending.ledger.push(id);
        }
    }

    /// The edges that loops are, numbered on.
    fn loop_edges(&self, loops: &[(LoopId, Matrix6<f64>)]) -> Vec<Edge> {
        let known = loops.iter().filter_map(|(loop_id, information)| {
            let entry = self.ledger.get(loop_id.0 as usize)?;
            Some((*loop_id, entry, *information))
        });
        known
            .zip(self.next_edge..)
            .map(|((loop_id, entry, information), id)| Edge {
                id,
                kind: EdgeKind::Loop(loop_id),
                first: entry.candidate,
                second: entry.node,
                first_from_second: entry.candidate_from_node,
                information,
            })
            .collect()
    }

    /// The entries of loops that the graph took: accepted from now on.
    fn accept(&mut self, loops: &[(LoopId, Matrix6<f64>)]) -> Vec<LedgerEntry> {
        let mut decided = Vec::new();
        for (loop_id, _) in loops {
            if let Some(entry) = self.ledger.get_mut(loop_id.0 as usize) {
                entry.verdict = Verdict::Accepted;
                decided.push(*entry);
                self.pending.ledger.push(*loop_id);
            }
        }
        decided
    }

    /// Takes a loop out by hand. `None` if there is no such loop in the map.
    ///
    /// # Errors
    /// The graph can't do without it (it alone joins two parts of the map).
    pub fn veto(&mut self, loop_id: LoopId) -> Result<Option<LedgerEntry>, GraphError> {
        let of_loop = |e: &Edge| e.kind == EdgeKind::Loop(loop_id);
        let Some(edge) = self.edges.iter().find(|e| of_loop(e)).copied() else {
            return Ok(None);
        };
        let piece = self.nodes[edge.second.index()].piece;
        if let Some(graph) = &mut self.pieces[piece.0 as usize].graph {
            graph.update(&[], &[], &[edge.id])?;
            graph.settle()?;
        }
        self.edges.retain(|e| !of_loop(e));
        self.pending.removed_edges.push(edge.id);
        self.take_poses(piece);
        let entry = &mut self.ledger[loop_id.0 as usize];
        entry.verdict = Verdict::Vetoed;
        self.pending.ledger.push(loop_id);
        let entry = *entry;
        // Others may be believed again without it.
        self.weigh_loops(piece);
        Ok(Some(entry))
    }

    /// Decides anew which of the accepted loops the graph believes; returns those that changed.
    fn weigh_loops(&mut self, piece: PieceId) -> Vec<LedgerEntry> {
        let mut changed = Vec::new();
        let Some(graph) = &self.pieces[piece.0 as usize].graph else {
            return changed;
        };
        for edge in &self.edges {
            let EdgeKind::Loop(id) = edge.kind else {
                continue;
            };
            if self.nodes[edge.second.index()].piece != piece {
                continue;
            }
            let Some(entry) = self.ledger.get_mut(id.0 as usize) else {
                continue;
            };
            let outvoted = graph.chi2(edge) > OUTVOTED_CHI2;
            let verdict = match entry.verdict {
                Verdict::Accepted if outvoted => Verdict::Outvoted,
                Verdict::Outvoted if !outvoted => Verdict::Accepted,
                same => same,
            };
            if verdict != entry.verdict {
                entry.verdict = verdict;
                changed.push(*entry);
                self.pending.ledger.push(id);
            }
        }
        changed
    }
}
