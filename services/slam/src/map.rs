//! The map: nodes, edges, pieces, ledger, looks; and the store that keeps them.
//!
//! In: nodes and edges as they come. Out: poses after optimisation, submaps, covariances. Every
//! change is handed to the store at once; what it can't keep stays pending and goes with the next.

mod beliefs;
mod copying;
mod keeping;
mod loops;

use std::sync::Arc;

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::cache::SubmapCache;
use crate::codec;
use crate::edge::{Edge, EdgeKind};
use crate::graph::{GraphError, PoseGraph};
use crate::ledger::LedgerEntry;
use crate::node::{Node, NodeId, PieceId};
use crate::places::Places;
use crate::saved::{SavedMap, SavedMapError};
use crate::store::{StoreError, SubmapStore};
use crate::submap::Submap;

pub(crate) use keeping::MOST_PENDING;
use keeping::Pending;

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
        match self.cache.get(node, &mut *self.store) {
            Ok(submap) => Ok(submap),
            // Perhaps the store has not been given it yet.
            Err(error) => match self.pending.submap(node) {
                Some(bytes) => self.cache.decode(node, bytes),
                None => Err(error),
            },
        }
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
        self.pending.add(node.id, bytes, self.places.bytes());
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
}
