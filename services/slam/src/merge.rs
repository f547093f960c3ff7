//! Two maps of one space become one.
//!
//! In: two maps. Out: a third in the frame of the first, with the nodes of both, held together by
//! places of the second that were recognised in the first and proven by alignment. Sessions, pieces,
//! edges and ledger entries of the second are numbered on.

use std::sync::Arc;

use crate::candidates::{Candidate, candidates, recognised};
use crate::closing::Closing;
use crate::config::SlamConfig;
use crate::graph::GraphError;
use crate::ledger::{Refusal, Verdict};
use crate::map::{MOST_PENDING, Map};
use crate::node::{NodeId, PieceId};
use crate::recognition::Recognition;
use crate::store::{StoreError, SubmapStore};

/// Copied nodes are handed to the store at least this often: only so many submaps may wait for it.
const COMMIT_EVERY: usize = MOST_PENDING / 2;

/// Why two maps can't be merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// Nothing of the second was recognised in the first.
    #[error("no place of the second map was recognised in the first")]
    Apart,
    /// One of them has no node.
    #[error("one of the maps is empty")]
    Empty,
    /// A submap can't be read, or the new map can't be written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The graph does not take it.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

/// Merges; `progress` is called with each node of the second that was looked for.
///
/// # Errors
/// [`MergeError`]; what was written to `store` by then is no map.
pub fn merge(
    first: &mut Map,
    second: &mut Map,
    store: Box<dyn SubmapStore>,
    config: &SlamConfig,
    mut progress: impl FnMut(NodeId),
) -> Result<Map, MergeError> {
    if first.nodes().is_empty() || second.nodes().is_empty() {
        return Err(MergeError::Empty);
    }
    let memory = config.submap_memory_mb.saturating_mul(1 << 20);
    let mut merged = Map::new(store, memory);
    copy(first, &mut merged)?;
    let added = copy(second, &mut merged)?;
    let mut closing = Closing::default();
    let mut recognition = Recognition::default();
    let mut found: Vec<Candidate> = Vec::new();
    for id in added.clone().map(NodeId) {
        progress(id);
        let (Some(node), Ok(submap)) = (merged.node(id).copied(), merged.submap(id)) else {
            continue;
        };
        merged.places.describe(&submap, &node.ground);
        if node.piece == PieceId(0) {
            candidates(&mut merged, id, config, &mut found);
        } else {
            recognised(&merged, &node, &mut recognition, &mut found);
        }
        for candidate in std::mem::take(&mut found) {
            prove(
                &mut merged,
                id,
                &candidate,
                &mut closing,
                &mut recognition,
                config,
            )?;
        }
        if node.piece != PieceId(0)
            && let Some(place) = recognition.conclude(id)
        {
            merged.join(
                node.piece,
                place.target,
                &place.target_from_piece,
                &place.loops,
            )?;
            recognition.clear();
        }
        merged.commit(false)?;
    }
    let on_the_first = |id: u32| {
        merged
            .node(NodeId(id))
            .is_some_and(|n| n.piece == PieceId(0))
    };
    if !added.clone().any(on_the_first) {
        return Err(MergeError::Apart);
    }
    merged.commit(true)?;
    Ok(merged)
}

/// Proves one candidate; in one piece it becomes a loop, of another piece it is a vote.
fn prove(
    map: &mut Map,
    id: NodeId,
    candidate: &Candidate,
    closing: &mut Closing,
    recognition: &mut Recognition,
    config: &SlamConfig,
) -> Result<(), MergeError> {
    let Some(node) = map.node(id).copied() else {
        return Ok(());
    };
    let same_piece = map
        .node(candidate.node)
        .is_some_and(|n| n.piece == node.piece);
    let mut entry = map.open_entry(node.stamp, id, candidate.node, candidate.found_by);
    if !closing.begin(map, &mut entry, candidate, config) {
        entry.verdict = Verdict::Refused(Refusal::Unreadable);
        map.close_entry(entry);
        return Ok(());
    }
    loop {
        let aligned = loop {
            if let Some(aligned) = closing.step() {
                break aligned;
            }
        };
        match closing.judge(&mut entry, candidate, &aligned, same_piece, config) {
            Err(refusal) => {
                if !same_piece {
                    recognition.vote(map, candidate, &entry, None);
                }
                entry.verdict = Verdict::Refused(refusal);
                map.close_entry(entry);
            }
            Ok(proven) if !same_piece => {
                recognition.vote(map, candidate, &entry, Some(proven.information));
                map.close_entry(entry);
            }
            Ok(mut proven) => {
                let loops = closing.agree(map, &mut proven);
                map.close_entry(proven.entry);
                map.add_loops(&loops)?;
            }
        }
        if closing.is_over() {
            return Ok(());
        }
        // The same two nodes lie on each other in another way too.
        entry = map.open_entry(node.stamp, id, candidate.node, candidate.found_by);
    }
}

/// Copies a map into another, numbered on. The numbers its nodes got.
fn copy(from: &mut Map, to: &mut Map) -> Result<std::ops::Range<u32>, MergeError> {
    let first = to.nodes().len() as u32;
    let (sessions, nodes) = (to.sessions(), from.nodes().to_vec());
    let edges = from.edges().to_vec();
    let mut pieces: Vec<Option<PieceId>> = vec![None; from.pieces().len()];
    for (count, node) in nodes.iter().enumerate() {
        let slot = &mut pieces[node.piece.0 as usize];
        let piece = *slot.get_or_insert_with(|| to.begin_piece());
        let submap = from.submap(node.id)?;
        let mut copied = *node;
        copied.id = NodeId(first + node.id.0);
        copied.session += sessions;
        copied.piece = piece;
        to.places.describe(&submap, &node.ground);
        to.add_bare(copied, Arc::clone(&submap));
        if (count + 1).is_multiple_of(COMMIT_EVERY) {
            to.commit(false)?;
        }
    }
    to.hold(first, &edges, from.ledger())?;
    to.commit(true)?;
    Ok(first..to.nodes().len() as u32)
}
