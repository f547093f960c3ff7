//! A store over another: what is new stays in memory, what is old is read from below.
//!
//! For looking something up in a map that is not to be changed.

use crate::node::NodeId;
use crate::store::{MapChange, MemoryStore, StoreError, SubmapStore};

/// Memory over a store that is only read.
#[derive(Debug)]
pub struct OverlayStore<S> {
    above: MemoryStore,
    below: S,
}

impl<S: SubmapStore> OverlayStore<S> {
    /// Nothing in memory yet.
    pub fn over(below: S) -> Self {
        Self {
            above: MemoryStore::default(),
            below,
        }
    }
}

impl<S: SubmapStore> SubmapStore for OverlayStore<S> {
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError> {
        self.above.commit(change)
    }

    fn submap(&mut self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError> {
        match self.above.submap(node, bytes) {
            Ok(()) => Ok(()),
            Err(_) => self.below.submap(node, bytes),
        }
    }
}
