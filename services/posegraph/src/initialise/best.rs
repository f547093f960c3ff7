//! Which poses to start from, judged by the error they leave.

use super::{Rigid, rotations_first, spanning_tree};
use crate::batch::{self, Options, Report};
use crate::error::Error;
use crate::graph::Graph;

/// Where the poses that a solver started from came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// They were given.
    Given,
    /// [`spanning_tree`].
    SpanningTree,
    /// [`rotations_first`].
    Rotations,
}

/// A start whose error is so many times that of the best one is not worth a try: in all graphs
/// tried, the minimum it leads to is the same or worse.
const AMBIGUOUS: f64 = 3.0;

/// Finds poses from the graph alone and solves from whichever of the starts leaves the least error:
/// the given poses if `has_poses`, along a spanning tree, or rotations first. Starts that are nearly
/// as good are tried too, and the best end is kept.
///
/// # Errors
/// As [`batch::optimize`].
pub fn optimize_from_best<G: Rigid>(
    graph: &mut Graph<G>,
    has_poses: bool,
    options: &Options,
) -> Result<(Start, Report), Error> {
    let starts = starts(graph, has_poses)?;
    let least = starts.iter().map(|s| s.error).fold(f64::INFINITY, f64::min);
    let mut best: Option<(Start, Report, Vec<G>)> = None;
    for start in starts {
        // Written so that a start whose error is not finite is no candidate.
        let worthwhile = start.error <= least * AMBIGUOUS || best.is_none();
        if !worthwhile {
            continue;
        }
        graph.poses = start.poses;
        let report = batch::optimize(graph, options)?;
        let better = best
            .as_ref()
            .is_none_or(|(_, other, _)| report.final_error < other.final_error);
        if better {
            best = Some((start.start, report, core::mem::take(&mut graph.poses)));
        }
    }
    match best {
        Some((start, report, poses)) => {
            graph.poses = poses;
            Ok((start, report))
        }
        None => Ok((Start::Given, batch::optimize(graph, options)?)),
    }
}

struct Candidate<G> {
    start: Start,
    error: f64,
    poses: Vec<G>,
}

/// Starts by their error, the least first.
fn starts<G: Rigid>(graph: &mut Graph<G>, has_poses: bool) -> Result<Vec<Candidate<G>>, Error> {
    graph.check_held()?;
    let mut starts = Vec::new();
    let mut note = |start, graph: &Graph<G>| {
        let error = graph.error();
        if error.is_finite() {
            starts.push(Candidate {
                start,
                error,
                poses: graph.poses.clone(),
            });
        }
    };
    let given = graph.poses.clone();
    if has_poses {
        note(Start::Given, graph);
    } else {
        spanning_tree(graph);
        note(Start::SpanningTree, graph);
    }
    // Factors that know nothing of rotation or of translation leave it open: then there is no
    // such start.
    if rotations_first(graph).is_ok() {
        note(Start::Rotations, graph);
    }
    graph.poses = given;
    starts.sort_by(|a, b| a.error.total_cmp(&b.error));
    Ok(starts)
}
