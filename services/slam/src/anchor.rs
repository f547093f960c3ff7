//! What odometry hangs on: the node that the last submap became, or the one that covers it.
//!
//! In: submaps as they become nodes or are covered. Out: how the next one lies to the node, and, by
//! odometry alone, to the last node that the robot made.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::node::NodeId;
use crate::uncertainty::{carried, invert};

/// A relative pose, and how surely.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// Takes points of the later frame to the earlier one's.
    pub pose: Pose,
    /// Covariance of an update on its right, translation first.
    pub covariance: Matrix6<f64>,
}

impl Link {
    /// Of two frames that are one.
    pub fn none() -> Self {
        Self {
            pose: Pose::identity(),
            covariance: Matrix6::zeros(),
        }
    }

    /// This link, and another from its end.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            pose: self.pose * next.pose,
            covariance: carried(&self.covariance, &next.pose.inverse()) + next.covariance,
        }
    }

    /// The same, seen from its end.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            pose: self.pose.inverse(),
            covariance: carried(&self.covariance, &self.pose),
        }
    }

    /// The inverse of its covariance.
    pub fn information(&self) -> Matrix6<f64> {
        invert(&self.covariance)
    }
}

/// What odometry hangs on.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    /// The node.
    pub node: NodeId,
    /// Where the odometry has it, as far as it knows now.
    pub odom_from_node: Pose,
    /// From it to the frame of the last submap: none if that became the node.
    pub to_submap: Link,
    /// The last node that the robot made; the way from it to the last submap is odometry's alone.
    pub made: NodeId,
    /// That way.
    pub made_to_submap: Link,
}

impl Anchor {
    /// The last submap became a node.
    pub fn made(node: NodeId, odom_from_node: &Pose) -> Self {
        Self {
            node,
            odom_from_node: *odom_from_node,
            to_submap: Link::none(),
            made: node,
            made_to_submap: Link::none(),
        }
    }

    /// A submap that a node covers; `way` leads to it from the last one by odometry.
    #[must_use]
    pub fn covered(
        &self,
        node: NodeId,
        to_submap: &Link,
        odom_from_submap: &Pose,
        way: &Link,
    ) -> Self {
        Self {
            node,
            odom_from_node: odom_from_submap * to_submap.pose.inverse(),
            to_submap: *to_submap,
            made: self.made,
            made_to_submap: self.made_to_submap.then(way),
        }
    }

    /// Whether the last submap became the node.
    pub fn is_made(&self) -> bool {
        self.node == self.made && self.to_submap.pose == Pose::identity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tangent::{difference, stepped};
    use hachi_hal::{Rotation, Vector3};
    use nalgebra::Vector6;

    #[test]
    fn errors_of_a_link_turn_up_at_the_end_of_the_next_and_seen_from_there() {
        let pose = |x: f64, yaw: f64| {
            Pose::from_parts(
                Vector3::new(x, 1.0, 0.2).into(),
                Rotation::from_euler_angles(0.1, -0.2, yaw),
            )
        };
        // An error of one direction only: its covariance is the error's outer product.
        let error = Vector6::new(1e-5, -2e-5, 3e-5, 4e-6, -5e-6, 6e-6);
        let first = Link {
            pose: pose(2.0, 1.2),
            covariance: error * error.transpose(),
        };
        let second = Link {
            pose: pose(-4.0, 0.4),
            covariance: Matrix6::zeros(),
        };
        let wrong = stepped(&first.pose, &error);
        let at_the_end = difference(&(first.pose * second.pose), &(wrong * second.pose));
        let expected = at_the_end * at_the_end.transpose();
        assert!((first.then(&second).covariance - expected).norm() < 1e-4 * expected.norm());
        let seen_back = difference(&first.pose.inverse(), &wrong.inverse());
        let expected = seen_back * seen_back.transpose();
        assert!((first.inverse().covariance - expected).norm() < 1e-4 * expected.norm());
    }
}
