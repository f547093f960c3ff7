//! Submaps in memory: the recently used ones, up to a number of bytes.
//!
//! In: a node's number. Out: its submap, from memory or from the store.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::codec;
use crate::node::NodeId;
use crate::store::{StoreError, StoreFault, SubmapStore};
use crate::submap::Submap;

#[derive(Debug)]
struct Entry {
    submap: Arc<Submap>,
    bytes: usize,
    used: u64,
}

/// The submaps in memory.
#[derive(Debug)]
pub struct SubmapCache {
    limit_bytes: usize,
    bytes: usize,
    uses: u64,
    entries: BTreeMap<NodeId, Entry>,
    encoded: Vec<u8>,
}

impl SubmapCache {
    /// An empty one that holds so many bytes, and at least the one asked for last.
    pub fn new(limit_bytes: usize) -> Self {
        Self {
            limit_bytes,
            bytes: 0,
            uses: 0,
            entries: BTreeMap::new(),
            encoded: Vec::new(),
        }
    }

    /// Bytes of all submaps in memory.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Puts a submap in that was made just now.
    pub fn insert(&mut self, node: NodeId, submap: Arc<Submap>) {
        self.uses += 1;
        let bytes = submap.bytes();
        let entry = Entry {
            submap,
            bytes,
            used: self.uses,
        };
        self.bytes += bytes;
        if let Some(old) = self.entries.insert(node, entry) {
            self.bytes -= old.bytes;
        }
        while self.bytes > self.limit_bytes && self.entries.len() > 1 {
            self.drop_oldest();
        }
    }

    /// A node's submap.
    ///
    /// # Errors
    /// The store does not have it, or not as it was written.
    pub fn get(
        &mut self,
        node: NodeId,
        store: &mut dyn SubmapStore,
    ) -> Result<Arc<Submap>, StoreError> {
        self.uses += 1;
        if let Some(entry) = self.entries.get_mut(&node) {
            entry.used = self.uses;
            return Ok(entry.submap.clone());
        }
        let mut encoded = std::mem::take(&mut self.encoded);
        let submap = match store.submap(node, &mut encoded) {
            Ok(()) => self.decode(node, &encoded),
            Err(error) => Err(error),
        };
        self.encoded = encoded;
        submap
    }

    /// Puts a submap in that comes as bytes.
    ///
    /// # Errors
    /// They are not those of a submap.
    pub fn decode(&mut self, node: NodeId, bytes: &[u8]) -> Result<Arc<Submap>, StoreError> {
        let mut submap = Submap::default();
        codec::decode(bytes, &mut submap).map_err(|error| StoreError {
            fault: StoreFault::Damaged,
            message: format!("the submap of node {node} is damaged: {error}"),
        })?;
        let submap = Arc::new(submap);
        self.insert(node, submap.clone());
        Ok(submap)
    }

    fn drop_oldest(&mut self) {
        let oldest = self.entries.iter().min_by_key(|(_, entry)| entry.used);
        if let Some(node) = oldest.map(|(node, _)| *node)
            && let Some(entry) = self.entries.remove(&node)
        {
            self.bytes -= entry.bytes;
        }
    }
}
