//! The map: nodes, edges, pieces, ledger, looks; and the store that keeps them.
//!
//! In: nodes and edges as they come. Out: poses after optimisation, submaps, covariances. Every
//! change is handed to the store at once; what it can't keep stays pending and goes with the next.

use std::sync::Arc;

use hachi_hal::{Pose, Rotation, Stamp};
use nalgebra::{Matrix6, Vector6};

use crate::cache::SubmapCache;
use crate::codec;
use crate::edge::{Edge, EdgeKind};
use crate::graph::{GraphError, PoseGraph};
use crate::ledger::{FoundBy, LedgerEntry, LoopId, Verdict};
use crate::node::{Node, NodeId, PieceId};
use crate::places::Places;
use crate::saved::{SavedMap, SavedMapError};
use crate::store::{MapChange, NewNode, StoreError, SubmapStore};
use crate::submap::Submap;
use crate::uncertainty::invert;

/// Poses that moved less than this need not be written again.
const MOVED_M: f64 = 1e-4;
const MOVED_RAD: f64 = 1e-5;

/// Old poses are written again after so many new nodes; from the edges they can be had at any time.
const POSES_EVERY: usize = 50;

/// A loop farther than this from where the graph has its nodes, in squared standard deviations of its
/// own, is outvoted: the rest of the graph does not believe it. Twice what one in a thousand true ones
/// exceeds.
const OUTVOTED_CHI2: f64 = 45.0;

/// Nodes that hang together.
#[derive(Debug)]
pub struct Piece {
    /// The piece it was joined to, if it was.
    pub joined_to: Option<PieceId>,
    graph: Option<PoseGraph>,
}

/// Why a saved map can't be gone on with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResumeError {
    /// Its parts do not fit together.
    #[error(transparent)]
    Saved(#[from] SavedMapError),
    /// Its edges do not hold its nodes together.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

/// The map.
pub struct Map {
    nodes: Vec<Node>,
    edges: Vec<Edge>,
    pieces: Vec<Piece>,
    ledger: Vec<LedgerEntry>,
    /// What places look like.
    pub places: Places,
    store: Box<dyn SubmapStore>,
    cache: SubmapCache,
    next_edge: u32,
    pending: Pending,
}

/// What the store has not been given yet.
#[derive(Debug, Default)]
struct Pending {
    nodes: Vec<(NodeId, Vec<u8>, Vec<u8>)>,
    edges: Vec<Edge>,
    removed_edges: Vec<u32>,
    ledger: Vec<LoopId>,
    joined: Vec<(PieceId, PieceId)>,
    /// Poses as the store has them.
    stored: Vec<Pose>,
    nodes_since_poses: usize,
}

impl std::fmt::Debug for Map {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Map")
            .field("nodes", &self.nodes.len())
            .field("edges", &self.edges.len())
            .field("pieces", &self.pieces.len())
            .field("ledger", &self.ledger.len())
            .finish_non_exhaustive()
    }
}

impl Map {
    /// An empty map.
    pub fn new(store: Box<dyn SubmapStore>, submap_memory_bytes: usize) -> Self {
        Self {
            nodes: Vec::new(),
            edges: Vec::new(),
            pieces: Vec::new(),
            ledger: Vec::new(),
            places: Places::default(),
            store,
            cache: SubmapCache::new(submap_memory_bytes),
            next_edge: 0,
            pending: Pending::default(),
        }
    }

    /// A saved map, whose submaps `store` has. Descriptors that can't be read cost a place's looks,
    /// not the map.
    ///
    /// # Errors
    /// Its parts do not fit together.
    pub fn resume(
        saved: SavedMap,
        store: Box<dyn SubmapStore>,
        submap_memory_bytes: usize,
    ) -> Result<Self, ResumeError> {
        saved.check()?;
        let mut map = Self::new(store, submap_memory_bytes);
        for (node, bytes) in &saved.descriptors {
            map.places.insert_bytes(*node, bytes);
        }
        map.next_edge = saved.edges.iter().map(|e| e.id + 1).max().unwrap_or(0);
        map.pending.stored = saved.nodes.iter().map(|n| n.map_from_node).collect();
        let pieces = saved.pieces();
        (map.nodes, map.edges, map.ledger) = (saved.nodes, saved.edges, saved.ledger);
        for _ in 0..pieces {
            let piece = map.begin_piece();
            map.build_graph(piece)?;
        }
        Ok(map)
    }

    /// How many runs of the robot made it.
    pub fn sessions(&self) -> u32 {
        let highest = self.nodes.iter().map(|n| n.session).max();
        highest.map_or(0, |s| s.saturating_add(1))
    }

    /// All nodes, by number.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// A node.
    pub fn node(&self, id: NodeId) -> Option<&Node> {
        self.nodes.get(id.index())
    }

    /// All edges that hold.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The loop ledger, by number.
    pub fn ledger(&self) -> &[LedgerEntry] {
        &self.ledger
    }

    /// All pieces, by number; those that were joined to another say so.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// A node's submap.
    ///
    /// # Errors
    /// The store can't give it.
    pub fn submap(&mut self, node: NodeId) -> Result<Arc<Submap>, StoreError> {
        self.cache.get(node, &mut *self.store)
    }

    /// Bytes of submaps in memory.
    pub fn submap_bytes(&self) -> usize {
        self.cache.bytes()
    }

    /// A new piece that hangs on nothing.
    pub fn begin_piece(&mut self) -> PieceId {
        self.pieces.push(Piece {
            joined_to: None,
            graph: None,
        });
        PieceId(self.pieces.len() as u32 - 1)
    }

    /// Adds a node whose number is the next; `edge` hangs it on the one before in its piece.
    ///
    /// # Errors
    /// The graph refuses it; the map is as it was.
    pub fn add_node(
        &mut self,
        node: Node,
        submap: Arc<Submap>,
        edge: Option<(NodeId, Pose, Matrix6<f64>)>,
    ) -> Result<(), GraphError> {
        let edge = edge.map(|(first, first_from_second, information)| Edge {
            id: self.next_edge,
            kind: EdgeKind::Chain,
            first,
            second: node.id,
            first_from_second,
            information,
        });
        let piece = &mut self.pieces[node.piece.0 as usize];
        match &mut piece.graph {
            Some(graph) => graph.update(&[(node.id, node.map_from_node)], edge.as_slice(), &[])?,
            empty => *empty = Some(PoseGraph::new(node.id, &node.map_from_node)?),
        }
        let mut bytes = Vec::new();
        codec::encode(&submap, &mut bytes);
        // What is kept is what was written: the same loops are found today and tomorrow.
        let mut kept = Submap::default();
        let submap = match codec::decode(&bytes, &mut kept) {
            Ok(()) => Arc::new(kept),
            Err(_) => submap,
        };
        self.cache.insert(node.id, submap);
        self.pending
            .nodes
            .push((node.id, bytes, self.places.bytes()));
        self.places.insert(node.id);
        self.nodes.push(node);
        if let Some(edge) = edge {
            self.next_edge += 1;
            self.edges.push(edge);
            self.pending.edges.push(edge);
        }
        self.take_poses(node.piece);
        Ok(())
    }

    /// Adds a node of another map, described before; it hangs on nothing until [`Map::hold`].
    pub fn add_bare(&mut self, node: Node, submap: Arc<Submap>) {
        let mut bytes = Vec::new();
        codec::encode(&submap, &mut bytes);
        self.cache.insert(node.id, submap);
        self.pending
            .nodes
            .push((node.id, bytes, self.places.bytes()));
        self.places.insert(node.id);
        self.nodes.push(node);
    }

    /// Holds the nodes from `first` on together by the edges of the map they come from, whose numbers
    /// they count on; its ledger goes on this one's.
    ///
    /// # Errors
    /// The edges do not hold the nodes.
    pub fn hold(
        &mut self,
        first: u32,
        edges: &[Edge],
        ledger: &[LedgerEntry],
    ) -> Result<(), GraphError> {
        let on = |id: NodeId| NodeId(first + id.0);
        let loops = self.ledger.len() as u32;
        self.ledger.extend(ledger.iter().map(|entry| LedgerEntry {
            id: LoopId(loops + entry.id.0),
            node: on(entry.node),
            candidate: on(entry.candidate),
            ..*entry
        }));
        self.pending
            .ledger
            .extend((loops..self.ledger.len() as u32).map(LoopId));
        let edges: Vec<Edge> = edges
            .iter()
            .zip(self.next_edge..)
            .map(|(edge, id)| Edge {
                id,
                kind: match edge.kind {
                    EdgeKind::Chain => EdgeKind::Chain,
                    EdgeKind::Loop(of) => EdgeKind::Loop(LoopId(loops + of.0)),
                },
                first: on(edge.first),
                second: on(edge.second),
                ..*edge
            })
            .collect();
        self.next_edge += edges.len() as u32;
        self.edges.extend_from_slice(&edges);
        self.pending.edges.extend_from_slice(&edges);
        for piece in (0..self.pieces.len() as u32).map(PieceId) {
            if self.pieces[piece.0 as usize].graph.is_none() {
                self.build_graph(piece)?;
            }
        }
        Ok(())
    }

    /// Makes a piece's graph from its nodes and edges.
    fn build_graph(&mut self, piece: PieceId) -> Result<(), GraphError> {
        let nodes = &self.nodes;
        let of_piece = |id: NodeId| nodes[id.index()].piece == piece;
        let mut placed = nodes
            .iter()
            .filter(|n| n.piece == piece)
            .map(|n| (n.id, n.map_from_node));
        let Some((first, pose)) = placed.next() else {
            // Only a joined piece has no nodes of its own; to which is of no matter any more.
            self.pieces[piece.0 as usize].joined_to = Some(PieceId(0));
            return Ok(());
        };
        let rest: Vec<(NodeId, Pose)> = placed.collect();
        let edges: Vec<Edge> = self
            .edges
            .iter()
            .filter(|e| of_piece(e.first) && of_piece(e.second))
            .copied()
            .collect();
        let mut graph = PoseGraph::new(first, &pose)?;
        graph.update(&rest, &edges, &[])?;
        graph.settle()?;
        self.pieces[piece.0 as usize].graph = Some(graph);
        self.take_poses(piece);
        Ok(())
    }

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
        let mut edges = Vec::new();
        let mut piece = None;
        for (loop_id, information) in loops {
            let Some(entry) = self.ledger.get(loop_id.0 as usize) else {
                continue;
            };
            piece = self.node(entry.node).map(|n| n.piece);
            edges.push(Edge {
                id: self.next_edge + edges.len() as u32,
                kind: EdgeKind::Loop(*loop_id),
                first: entry.candidate,
                second: entry.node,
                first_from_second: entry.candidate_from_node,
                information: *information,
            });
        }
        let Some(piece) = piece else {
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
        let mut decided = Vec::new();
        for (loop_id, _) in loops {
            if let Some(entry) = self.ledger.get_mut(loop_id.0 as usize) {
                entry.verdict = Verdict::Accepted;
                decided.push(*entry);
                self.pending.ledger.push(*loop_id);
            }
        }
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
        for (loop_id, information) in loops {
            if let Some(entry) = self.ledger.get(loop_id.0 as usize) {
                edges.push(Edge {
                    id: self.next_edge + (edges.len() - old) as u32,
                    kind: EdgeKind::Loop(*loop_id),
                    first: entry.candidate,
                    second: entry.node,
                    first_from_second: entry.candidate_from_node,
                    information: *information,
                });
            }
        }
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
        let mut decided = Vec::new();
        for (loop_id, _) in loops {
            if let Some(entry) = self.ledger.get_mut(loop_id.0 as usize) {
                entry.verdict = Verdict::Accepted;
                decided.push(*entry);
                self.pending.ledger.push(*loop_id);
            }
        }
        Ok(decided)
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

    /// Poses from the graph into the nodes.
    fn take_poses(&mut self, piece: PieceId) {
        let Some(graph) = &self.pieces[piece.0 as usize].graph else {
            return;
        };
        for node in self.nodes.iter_mut().filter(|n| n.piece == piece) {
            if let Some(pose) = graph.pose(node.id) {
                node.map_from_node = pose;
            }
        }
    }

    /// Covariance of a node's pose on its piece, translation first, update on the right.
    pub fn covariance(&mut self, node: NodeId) -> Option<Matrix6<f64>> {
        let piece = self.node(node)?.piece;
        self.pieces[piece.0 as usize]
            .graph
            .as_mut()?
            .covariance(node)
    }

    /// Covariance of `second` as seen from `first`, translation first, update on the right. `None` if
    /// they are of different pieces.
    pub fn relative_covariance(&mut self, first: NodeId, second: NodeId) -> Option<Matrix6<f64>> {
        let piece = self.node(first)?.piece;
        if self.node(second)?.piece != piece {
            return None;
        }
        let graph = self.pieces[piece.0 as usize].graph.as_mut()?;
        graph.relative_covariance(first, second)
    }

    /// Squared Mahalanobis distance between where the graph has `second` as seen from `first`, and
    /// where an alignment with this information has it. `None` if they are of different pieces.
    pub fn chi2(
        &mut self,
        first: NodeId,
        second: NodeId,
        first_from_second: &Pose,
        information: &Matrix6<f64>,
    ) -> Option<f64> {
        let covariance = self.relative_covariance(first, second)?;
        let (a, b) = (self.node(first)?, self.node(second)?);
        let expected = a.map_from_node.inv_mul(&b.map_from_node);
        let off = difference(&expected, first_from_second);
        let sum = covariance + invert(information);
        Some((off.transpose() * invert(&sum) * off)[0])
    }

    /// Hands the store all that it does not have yet. With `poses`, also every pose that moved.
    ///
    /// # Errors
    /// The store's; what was not kept goes with the next call.
    pub fn commit(&mut self, poses: bool) -> Result<(), StoreError> {
        let pending = &self.pending;
        let nodes: Vec<NewNode<'_>> = pending
            .nodes
            .iter()
            .map(|(id, submap, descriptor)| NewNode {
                node: self.nodes[id.index()],
                submap,
                descriptor,
            })
            .collect();
        let poses = poses || pending.nodes_since_poses + nodes.len() >= POSES_EVERY;
        let moved: Vec<(NodeId, Pose)> = if poses {
            let known = pending.stored.iter().zip(&self.nodes);
            known
                .filter(|(stored, node)| {
                    let off = stored.inv_mul(&node.map_from_node);
                    off.translation.vector.norm() > MOVED_M || off.rotation.angle() > MOVED_RAD
                })
                .map(|(_, node)| (node.id, node.map_from_node))
                .collect()
        } else {
            Vec::new()
        };
        let ledger: Vec<LedgerEntry> = pending
            .ledger
            .iter()
            .filter_map(|id| self.ledger.get(id.0 as usize).copied())
            .collect();
        let change = MapChange {
            nodes: &nodes,
            edges: &pending.edges,
            removed_edges: &pending.removed_edges,
            ledger: &ledger,
            poses: &moved,
            joined: &pending.joined,
        };
        if change.is_empty() {
            return Ok(());
        }
        self.store.commit(&change)?;
        let new: Vec<Pose> = nodes.iter().map(|n| n.node.map_from_node).collect();
        drop(nodes);
        self.pending.nodes_since_poses += new.len();
        self.pending.stored.extend(new);
        for (id, pose) in moved {
            self.pending.stored[id.index()] = pose;
        }
        if poses {
            self.pending.nodes_since_poses = 0;
        }
        let pending = &mut self.pending;
        pending.nodes.clear();
        pending.edges.clear();
        pending.removed_edges.clear();
        pending.ledger.clear();
        pending.joined.clear();
        Ok(())
    }
}

/// The pose after a small step on its right, translation first.
pub fn stepped(pose: &Pose, step: &Vector6<f64>) -> Pose {
    let shift = step.fixed_rows::<3>(0).into_owned();
    let turn = Rotation::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    pose * Pose::from_parts(shift.into(), turn)
}

/// The step on the right of `from` that leads to `to`: translation first.
pub fn difference(from: &Pose, to: &Pose) -> Vector6<f64> {
    let step = from.inv_mul(to);
    let (shift, turn) = (step.translation.vector, step.rotation.scaled_axis());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}
