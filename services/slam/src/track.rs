//! Where every scan was, after all that was learnt later.
//!
//! In: the scans' poses as odometry saw them, and the nodes and visits as the graph has them now. Out:
//! poses on the map. Between two of them the correction is blended, so that the path has no step where a loop
//! moved its nodes.

use hachi_hal::{Pose, Stamp};

use crate::input::Visit;
use crate::map::Map;
use crate::node::Node;

/// A moment at which the robot's place on the map is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// When.
    pub stamp: Stamp,
    /// Where odometry had the robot.
    pub odom_from_base: Pose,
    /// Where it is on the map.
    pub map_from_base: Pose,
    /// Whether odometry knows the way to it from the fix before.
    pub chained: bool,
}

impl From<&Node> for Fix {
    fn from(node: &Node) -> Self {
        Self {
            stamp: node.stamp,
            odom_from_base: node.odom_from_node,
            map_from_base: node.map_from_node,
            chained: node.chained,
        }
    }
}

/// The fixes of a session, in order of time: its nodes, and the submaps that became none.
pub fn fixes(map: &Map, session: u32, visits: &[Visit]) -> Vec<Fix> {
    let nodes = map.nodes().iter().filter(|n| n.session == session);
    let mut fixes: Vec<Fix> = nodes.map(Fix::from).collect();
    fixes.extend(visits.iter().filter_map(|visit| {
        let node = map.node(visit.node)?;
        Some(Fix {
            stamp: visit.stamp,
            odom_from_base: visit.odom_from_submap,
            map_from_base: node.map_from_node * visit.node_from_submap,
            chained: true,
        })
    }));
    fixes.sort_by_key(|fix| fix.stamp);
    fixes
}

/// The pose of a scan on the map: `fixes` are those of its session, in order of time. `None` without
/// any.
pub fn corrected(fixes: &[Fix], stamp: Stamp, odom_from_base: &Pose) -> Option<Pose> {
    let after = fixes.partition_point(|n| n.stamp <= stamp);
    let by = |fix: &Fix| fix.map_from_base * fix.odom_from_base.inv_mul(odom_from_base);
    let Some(before) = after.checked_sub(1).and_then(|i| fixes.get(i)) else {
        return fixes.first().map(by);
    };
    let earlier = by(before);
    // A node that hangs on nothing says nothing of the way to it.
    let Some(next) = fixes.get(after).filter(|next| next.chained) else {
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

    fn fix(second: i64, odom_x: f64, map: Pose, chained: bool) -> Fix {
        Fix {
            stamp: Stamp::from_nanos(second * 1_000_000_000),
            odom_from_base: Pose::translation(odom_x, 0.0, 0.0),
            map_from_base: map,
            chained,
        }
    }

    #[test]
    fn the_path_bends_from_one_correction_to_the_next_without_a_step() {
        let fixes = [
            fix(0, 0.0, Pose::identity(), false),
            fix(10, 10.0, Pose::translation(10.0, 1.0, 0.0), true),
            fix(20, 20.0, Pose::translation(20.0, 1.0, 0.0), true),
        ];
        let at = |tenths: i64| {
            let stamp = Stamp::from_nanos(tenths * 100_000_000);
            let odom = Pose::translation(tenths as f64 / 10.0, 0.0, 0.0);
            corrected(&fixes, stamp, &odom).unwrap().translation.vector
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
        let fixes = [
            fix(0, 0.0, Pose::identity(), false),
            fix(10, 10.0, Pose::translation(90.0, 0.0, 0.0), false),
        ];
        let odom = Pose::translation(9.0, 0.0, 0.0);
        let pose = corrected(&fixes, Stamp::from_nanos(9_000_000_000), &odom).unwrap();
        assert_eq!(pose.translation.x, 9.0);
    }
}
