//! Nodes of another map: added one by one, then held together by the edges they had there.

use std::sync::Arc;

use super::Map;
use crate::codec;
use crate::edge::{Edge, EdgeKind};
use crate::graph::GraphError;
use crate::ledger::{LedgerEntry, LoopId};
use crate::node::{Node, NodeId, PieceId};
use crate::submap::Submap;

impl Map {
    /// Adds a node of another map, described before; it hangs on nothing until [`Map::hold`].
    pub fn add_bare(&mut self, node: Node, submap: Arc<Submap>) {
        let mut bytes = Vec::new();
        codec::encode(&submap, &mut bytes);
        self.cache.insert(node.id, submap);
        self.pending.add(node.id, bytes, self.places.bytes());
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
}
