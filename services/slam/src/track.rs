//! Where every scan was, after all that was learnt later.
//!
//! In: the scans' poses as odometry saw them, and the nodes as the graph has them now. Out: poses on
//! the map. Between two nodes the correction is blended, so that the path has no step where a loop
//! moved its nodes.

use hachi_hal::{Pose, Stamp};

use crate::node::Node;

/// The pose of a scan on the map: `nodes` are those of its session, in order of time. `None` without
/// any.
pub fn corrected(nodes: &[Node], stamp: Stamp, odom_from_base: &Pose) -> Option<Pose> {
    let after = nodes.partition_point(|n| n.stamp <= stamp);
    let by = |node: &Node| node.map_from_node * node.odom_from_node.inv_mul(odom_from_base);
    let Some(before) = after.checked_sub(1).and_then(|i| nodes.get(i)) else {
        return nodes.first().map(by);
    };
    let earlier = by(before);
    // A node that hangs on nothing says nothing of the way to it.
    let Some(next) = nodes.get(after).filter(|next| next.chained) else {
        return Some(earlier);
    };
    let span_s = next.stamp.secs_since(before.stamp);
    let share = (stamp.secs_since(before.stamp) / span_s.max(1e-9)).clamp(0.0, 1.0);
    let later = by(next);
    Some(
        earlier
            .try_lerp_slerp(&later, share, 1e-9)
            .unwrap_or(earlier),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{Ground, NodeId, PieceId};

    fn node(id: u32, second: i64, odom_x: f64, map: Pose, chained: bool) -> Node {
        Node {
            id: NodeId(id),
            session: 0,
            piece: PieceId(0),
            chained,
            stamp: Stamp::from_nanos(second * 1_000_000_000),
            odom_from_node: Pose::translation(odom_x, 0.0, 0.0),
            map_from_node: map,
            path_m: odom_x,
            ground: Ground::level(0.5),
        }
    }

    #[test]
    fn the_path_bends_from_one_correction_to_the_next_without_a_step() {
        let nodes = [
            node(0, 0, 0.0, Pose::identity(), false),
            node(1, 10, 10.0, Pose::translation(10.0, 1.0, 0.0), true),
            node(2, 20, 20.0, Pose::translation(20.0, 1.0, 0.0), true),
        ];
        let at = |tenths: i64| {
            let stamp = Stamp::from_nanos(tenths * 100_000_000);
            let odom = Pose::translation(tenths as f64 / 10.0, 0.0, 0.0);
            corrected(&nodes, stamp, &odom).unwrap().translation.vector
        };
        assert!((at(50).y - 0.5).abs() < 1e-9 && (at(50).x - 5.0).abs() < 1e-9);
        assert!((at(250).y - 1.0).abs() < 1e-9);
        for tenths in 1..250 {
            assert!((at(tenths) - at(tenths - 1)).norm() < 0.102, "{tenths}");
        }
        assert_eq!(
            corrected(&[], Stamp::from_nanos(0), &Pose::identity()),
            None
        );
    }

    #[test]
    fn nothing_is_blended_over_a_break() {
        let nodes = [
            node(0, 0, 0.0, Pose::identity(), false),
            node(1, 10, 10.0, Pose::translation(90.0, 0.0, 0.0), false),
        ];
        let odom = Pose::translation(9.0, 0.0, 0.0);
        let pose = corrected(&nodes, Stamp::from_nanos(9_000_000_000), &odom).unwrap();
        assert_eq!(pose.translation.x, 9.0);
    }
}
