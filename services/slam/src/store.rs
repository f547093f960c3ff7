//! Where a map is kept: the trait, and memory as the simplest of stores.
//!
//! [`Slam`](crate::Slam) hands a store each node once, with all that joined the map with it, and asks
//! for submaps again when a loop is checked. A file that survives a power cut is `hachi-store`'s.

use hachi_hal::Pose;

use crate::edge::Edge;
use crate::ledger::LedgerEntry;
use crate::node::{Node, NodeId, PieceId};

/// What joined or changed the map at one moment: kept whole or not at all.
#[derive(Debug, Clone, Copy, Default)]
pub struct MapChange<'a> {
    /// New nodes.
    pub nodes: &'a [NewNode<'a>],
    /// New edges.
    pub edges: &'a [Edge],
    /// Edges that are no longer part of the map, by number.
    pub removed_edges: &'a [u32],
    /// New entries of the loop ledger, and old ones (by number) that were decided anew.
    pub ledger: &'a [LedgerEntry],
    /// Poses that optimisation moved.
    pub poses: &'a [(NodeId, Pose)],
    /// Pieces that were joined to another: all nodes of the first now hang on the second.
    pub joined: &'a [(PieceId, PieceId)],
}

/// A node that joins the map.
#[derive(Debug, Clone, Copy)]
pub struct NewNode<'a> {
    /// What is known of it.
    pub node: Node,
    /// Its submap, as [`codec`](crate::codec) writes it.
    pub submap: &'a [u8],
    /// Its looks, as [`hachi_place::Descriptor::to_bytes`] writes them.
    pub descriptor: &'a [u8],
}

impl MapChange<'_> {
    /// Whether there is nothing to keep.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
            && self.edges.is_empty()
            && self.removed_edges.is_empty()
            && self.ledger.is_empty()
            && self.poses.is_empty()
            && self.joined.is_empty()
    }
}

/// What can be done about a store's failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StoreFault {
    /// There is no room: free some.
    Full,
    /// It may not be written.
    ReadOnly,
    /// What was read is not what was written.
    Damaged,
    /// Anything else.
    Other,
}

/// A store's failure.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct StoreError {
    /// What can be done.
    pub fault: StoreFault,
    /// What was seen.
    pub message: String,
}

/// Keeps a map's nodes, and gives their submaps back.
///
/// - `commit` keeps all of a change or nothing; a change that came back `Ok` is there after the
///   next start;
/// - an error leaves what was kept before as it was, and the store usable.
pub trait SubmapStore: Send {
    /// Keeps a change.
    ///
    /// # Errors
    /// [`StoreError`]; nothing of the change was kept.
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError>;

    /// Reads the bytes of a node's submap into `bytes`, which is cleared first.
    ///
    /// # Errors
    /// [`StoreError`], also where there is no such node.
    fn submap(&mut self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError>;
}

/// Keeps submaps in memory, sixty kilobytes each, and nothing else: for runs whose map nobody wants
/// to keep.
#[derive(Debug, Clone, Default)]
pub struct MemoryStore {
    submaps: Vec<Option<Box<[u8]>>>,
}

impl SubmapStore for MemoryStore {
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError> {
        for new in change.nodes {
            let index = new.node.id.index();
            if self.submaps.len() <= index {
                self.submaps.resize(index + 1, None);
            }
            self.submaps[index] = Some(new.submap.into());
        }
        Ok(())
    }

    fn submap(&mut self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError> {
        bytes.clear();
        match self.submaps.get(node.index()) {
            Some(Some(submap)) => {
                bytes.extend_from_slice(submap);
                Ok(())
            }
            _ => Err(StoreError {
                fault: StoreFault::Damaged,
                message: format!("node {node} has no submap"),
            }),
        }
    }
}
