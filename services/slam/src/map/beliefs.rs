//! How surely the map knows where its nodes are.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use super::Map;
use crate::node::NodeId;
use crate::tangent::difference;
use crate::uncertainty::invert;

impl Map {
    /// Covariance of a node's pose on its piece, translation first, update on the right.
    pub fn covariance(&mut self, node: NodeId) -> Option<Matrix6<f64>> {
        let piece = self.node(node)?.piece;
        self.pieces[piece.0 as usize]
            .graph
            .as_mut()?
            .covariance(node)
    }

    /// Covariance of `second` as seen from `first`, translation first, update on the right. `None` if
    /// they are of different pieces.
    pub fn relative_covariance(&mut self, first: NodeId, second: NodeId) -> Option<Matrix6<f64>> {
        let piece = self.node(first)?.piece;
        if self.node(second)?.piece != piece {
            return None;
        }
        let graph = self.pieces[piece.0 as usize].graph.as_mut()?;
        graph.relative_covariance(first, second)
    }

    /// Squared Mahalanobis distance between where the graph has `second` as seen from `first`, and
    /// where an alignment with this information has it. `None` if they are of different pieces.
    pub fn chi2(
        &mut self,
        first: NodeId,
        second: NodeId,
        first_from_second: &Pose,
        information: &Matrix6<f64>,
    ) -> Option<f64> {
        let covariance = self.relative_covariance(first, second)?;
        let (a, b) = (self.node(first)?, self.node(second)?);
        let expected = a.map_from_node.inv_mul(&b.map_from_node);
        let off = difference(&expected, first_from_second);
        let sum = covariance + invert(information);
        Some((off.transpose() * invert(&sum) * off)[0])
    }
}
