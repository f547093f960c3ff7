//! A piece's pose graph: nodes held together by edges, optimised as they come.
//!
//! In: nodes, edges. Out: poses, covariances, how far each edge is from its measurement. Elsewhere:
//! the solver (`hachi-posegraph`), which edges there are ([`map`](crate::map)).

use std::collections::BTreeMap;

use hachi_hal::Pose;
use hachi_posegraph::{Factor, FactorId, Isam2, Isam2Config, Kernel, Se3};
use nalgebra::Matrix6;

use crate::edge::{Edge, EdgeKind};
use crate::node::NodeId;

/// How surely a piece's first node lies where it does: 0.1 mm and 0.1 mrad. It defines the frame.
const FIRST_INFORMATION: f64 = 1e8;

/// Where a loop's weight is a half, in standard deviations. A loop is added when odometry has drifted
/// by many of its own standard deviations: the kernel has to let it pull all the same (which one that
/// falls off faster would not), and takes the force from one that the rest of the graph contradicts.
const LOOP_SCALE: f64 = 5.0;

/// Poses that would move by more than this are linearised anew, metres and radians.
const RELINEARISE: f64 = 0.01;

/// Steps that changed by less are not passed on.
const PROPAGATE: f64 = 1e-4;

/// Updates after a loop, at most, until nothing is linearised anew.
const SETTLES_WITHIN: usize = 10;

/// Why a graph refuses a change.
#[derive(Debug, Clone, thiserror::Error)]
#[error("the graph of nodes does not take it: {0}")]
pub struct GraphError(#[from] hachi_posegraph::Error);

/// A piece's pose graph.
#[derive(Debug, Clone)]
pub struct PoseGraph {
    isam: Isam2<Se3>,
    factors: BTreeMap<u32, FactorId>,
}

impl PoseGraph {
    /// A graph of one node, whose pose is the frame's.
    ///
    /// # Errors
    /// The pose is none.
    pub fn new(first: NodeId, pose: &Pose) -> Result<Self, GraphError> {
        let mut isam = Isam2::new(Isam2Config {
            relinearise_threshold: RELINEARISE,
            propagate_threshold: PROPAGATE,
            ..Isam2Config::default()
        });
        let held = Matrix6::identity() * FIRST_INFORMATION;
        let prior = Factor::prior(key(first), se3(pose), held);
        isam.update(&[prior], &[(key(first), se3(pose))], &[])?;
        Ok(Self {
            isam,
            factors: BTreeMap::new(),
        })
    }

    /// Adds nodes and edges, removes edges by number, and optimises.
    ///
    /// # Errors
    /// A node would hang on nothing, an edge leads nowhere, or a number is none; the graph is as it
    /// was.
    pub fn update(
        &mut self,
        nodes: &[(NodeId, Pose)],
        edges: &[Edge],
        removed: &[u32],
    ) -> Result<(), GraphError> {
        let poses: Vec<(u64, Se3)> = nodes.iter().map(|(id, p)| (key(*id), se3(p))).collect();
        let factors: Vec<Factor<Se3>> = edges.iter().map(factor).collect();
        let gone: Vec<FactorId> = removed
            .iter()
            .filter_map(|id| self.factors.get(id).copied())
            .collect();
        let report = self.isam.update(&factors, &poses, &gone)?;
        for id in removed {
            self.factors.remove(id);
        }
        let new = edges.iter().map(|e| e.id).zip(report.factor_ids);
        self.factors.extend(new);
        Ok(())
    }

    /// Takes up what the last update left. `true` if nothing is left.
    ///
    /// # Errors
    /// The solver's.
    pub fn settle_a_little(&mut self) -> Result<bool, GraphError> {
        Ok(self.isam.update(&[], &[], &[])?.relinearised == 0)
    }

    /// Optimises until nothing moves.
    ///
    /// # Errors
    /// The solver's.
    pub fn settle(&mut self) -> Result<(), GraphError> {
        for _ in 0..SETTLES_WITHIN {
            if self.settle_a_little()? {
                break;
            }
        }
        Ok(())
    }

    /// Where a node is.
    pub fn pose(&self, node: NodeId) -> Option<Pose> {
        self.isam.estimate(key(node)).map(|p| pose(&p))
    }

    /// Covariance of a node's pose: translation first, of an update on its right.
    pub fn covariance(&self, node: NodeId) -> Option<Matrix6<f64>> {
        self.isam.marginal_covariance(key(node)).ok()
    }

    /// Covariance of where `second` is as seen from `first`, likewise.
    pub fn relative_covariance(&self, first: NodeId, second: NodeId) -> Option<Matrix6<f64>> {
        self.isam.relative_covariance(key(first), key(second)).ok()
    }

    /// Squared standard deviations between an edge's measurement and its nodes.
    pub fn chi2(&self, edge: &Edge) -> f64 {
        let id = self.factors.get(&edge.id);
        id.and_then(|id| self.isam.squared_mahalanobis(*id))
            .unwrap_or(0.0)
    }
}

fn factor(edge: &Edge) -> Factor<Se3> {
    let (from, to) = (key(edge.first), key(edge.second));
    let measured = se3(&edge.first_from_second);
    match edge.kind {
        EdgeKind::Chain => Factor::between(from, to, measured, edge.information),
        EdgeKind::Loop(_) => Factor::loop_closure(from, to, measured, edge.information)
            .with_kernel(Kernel::Cauchy { scale: LOOP_SCALE }),
    }
}

fn key(node: NodeId) -> u64 {
    u64::from(node.0)
}

fn se3(pose: &Pose) -> Se3 {
    Se3::new(pose.translation.vector, pose.rotation)
}

fn pose(se3: &Se3) -> Pose {
    Pose::from_parts(se3.translation.into(), se3.rotation)
}
