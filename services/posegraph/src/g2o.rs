//! g2o files: poses and edges as text, in the plane or in space.
//!
//! In and out: `VERTEX_SE2`, `EDGE_SE2`, `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT` and `FIX`. Information
//! matrices belong to the errors of [`Se2`] and [`Se3`], as GTSAM reads these files; g2o itself
//! measures the rotation in space by half angles. Elsewhere: initial poses for files that have none
//! (`initialise`).

mod line;
mod read;
mod write;

use std::collections::{BTreeMap, BTreeSet};

use crate::error::Error;
use crate::factor::{Factor, Key};
use crate::graph::Graph;
use crate::group::{Group, Se2, Se3};
use crate::initialise;

pub use line::LineProblem;
pub use read::{ReadError, read};
pub use write::{Writable, write};

/// What a file holds.
#[derive(Debug, Clone)]
pub enum Document {
    /// Poses in the plane.
    Plane(Contents<Se2>),
    /// Poses in space.
    Space(Contents<Se3>),
}

/// Poses and edges of a file, in its order.
#[derive(Debug, Clone)]
pub struct Contents<G: Group> {
    /// Poses, each key once.
    pub vertices: Vec<(Key, G)>,
    /// Edges. Those between neighbouring keys are odometry, the others loops.
    pub edges: Vec<Factor<G>>,
    /// Poses that are to stay where they are.
    pub fixed: Vec<Key>,
    /// What was not as it should be.
    pub repairs: Repairs,
}

/// What was mended or left out while reading.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Repairs {
    /// Poses given again; the first one counts.
    pub duplicate_vertices: usize,
    /// Edges that repeat another to the last digit. They count, as in every other program.
    pub duplicate_edges: usize,
    /// Poses that only edges name. They are placed along edges.
    pub missing_vertices: usize,
    /// Quaternions whose length is off by more than a thousandth; scaled.
    pub scaled_quaternions: usize,
    /// Information matrices with an eigenvalue that rounding made negative; set to zero.
    pub clipped_information: usize,
    /// `FIX` of a key that nothing else names; left out.
    pub unknown_fixed: usize,
    /// Parts of the graph, besides that of the smallest key, in which no pose is fixed; each is held
    /// at its pose with the smallest key.
    pub loose_parts: usize,
    /// Lines with other tags; left out. At most 32 different tags are told apart, the others are
    /// counted as `...`.
    pub unknown_tags: BTreeMap<String, usize>,
}

impl<G: Group> Contents<G> {
    /// A graph of it, ready to be solved: missing poses are placed along edges, and each part
    /// without a fixed pose is held at its pose with the smallest key. Both are counted.
    ///
    /// # Errors
    /// [`Error::TooLarge`].
    pub fn graph(&mut self) -> Result<Graph<G>, Error> {
        let mut graph = Graph::new();
        for &(key, pose) in &self.vertices {
            graph.insert(key, pose)?;
        }
        let given = graph.len();
        let ends = self.edges.iter().flat_map(|edge| [edge.from(), edge.to()]);
        let missing: BTreeSet<Key> = ends.filter(|&key| graph.pose(key).is_none()).collect();
        for &key in &missing {
            graph.insert(key, G::identity())?;
        }
        for edge in &self.edges {
            graph.add(*edge)?;
        }
        self.repairs.missing_vertices = missing.len();
        self.repairs.unknown_fixed = 0;
        for &key in &self.fixed {
            if graph.fix(key).is_err() {
                self.repairs.unknown_fixed += 1;
            }
        }
        if !missing.is_empty() {
            initialise::complete(&mut graph, given);
        }
        self.repairs.loose_parts = graph.hold_loose_parts();
        Ok(graph)
    }
}
