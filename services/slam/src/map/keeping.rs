//! Handing the store what is new: a change at a time, all of it or nothing.
//!
//! What the store can't take stays pending and goes with the next change. While a store fails for
//! long, the oldest submaps that wait are given up: their nodes stay, and show nothing. How many is
//! counted.

use std::collections::VecDeque;

use hachi_hal::Pose;

use super::Map;
use crate::codec;
use crate::edge::Edge;
use crate::ledger::{LedgerEntry, LoopId};
use crate::node::{NodeId, PieceId};
use crate::store::{MapChange, NewNode, StoreError};
use crate::submap::{FINEST_M, Submap};

/// Poses that moved less than this need not be written again.
const MOVED_M: f64 = 1e-4;
const MOVED_RAD: f64 = 1e-5;

/// Submaps that wait for the store, at most: 15 MB, some minutes of walking.
pub(crate) const MOST_PENDING: usize = 256;

/// Old poses are written again after so many new nodes; from the edges they can be had at any time.
const POSES_EVERY: usize = 50;

/// What the store has not been given yet.
#[derive(Debug, Default)]
pub(super) struct Pending {
    pub(super) nodes: VecDeque<NewSubmap>,
    /// Of these, how many have lost their submap, from the first on; and how many ever did.
    pub(super) hollow: usize,
    pub(super) given_up: u64,
    pub(super) edges: Vec<Edge>,
    pub(super) removed_edges: Vec<u32>,
    pub(super) ledger: Vec<LoopId>,
    pub(super) joined: Vec<(PieceId, PieceId)>,
    /// Poses as the store has them.
    pub(super) stored: Vec<Pose>,
    pub(super) nodes_since_poses: usize,
}

/// A node's submap and looks, as bytes for the store.
#[derive(Debug)]
pub(super) struct NewSubmap {
    pub(super) node: NodeId,
    pub(super) submap: Vec<u8>,
    pub(super) descriptor: Vec<u8>,
}

impl Pending {
    /// One more node; of too many the oldest loses its submap.
    pub(super) fn add(&mut self, node: NodeId, submap: Vec<u8>, descriptor: Vec<u8>) {
        self.nodes.push_back(NewSubmap {
            node,
            submap,
            descriptor,
        });
        if self.nodes.len() - self.hollow > MOST_PENDING {
            let oldest = &mut self.nodes[self.hollow];
            oldest.submap.clear();
            let empty = Submap {
                voxel_m: FINEST_M,
                ..Submap::default()
            };
            codec::encode(&empty, &mut oldest.submap);
            oldest.submap.shrink_to_fit();
            self.hollow += 1;
            self.given_up += 1;
        }
    }

    /// A submap that waits.
    pub(super) fn submap(&self, node: NodeId) -> Option<&[u8]> {
        let waiting = self.nodes.iter().find(|new| new.node == node)?;
        Some(&waiting.submap)
    }
}

impl Map {
    /// Submaps that were given up because the store could not take them for long.
    pub fn submaps_given_up(&self) -> u64 {
        self.pending.given_up
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
            .map(|new| NewNode {
                node: self.nodes[new.node.index()],
                submap: &new.submap,
                descriptor: &new.descriptor,
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
        pending.hollow = 0;
        pending.edges.clear();
        pending.removed_edges.clear();
        pending.ledger.clear();
        pending.joined.clear();
        Ok(())
    }
}
