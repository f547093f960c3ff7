//! Loops that are true, loops that are not, and a robot that is carried away: on a corridor whose
//! every corner is known.

mod ring;

use hachi_hal::{Pose, Rotation, Vector3};
use hachi_odometry::{Condition, Doubt};
use hachi_slam::ledger::{FoundBy, Refusal, Verdict};
use hachi_slam::{MemoryStore, NodeId, Slam, SlamCondition, SlamConfig};
use nalgebra::Matrix6;
use ring::{SIDE_M, Walker};

const ROUND_M: f64 = 4.0 * SIDE_M;

fn around(metres: f64) -> Walker {
    let slam = Slam::new(SlamConfig::default(), Box::new(MemoryStore::default()));
    let mut walker = Walker::new(slam);
    walker.walk(metres);
    walker
}

#[test]
fn a_round_closes_and_a_false_loop_is_refused_or_outvoted_and_named() {
    let mut walker = around(ROUND_M + 8.0);
    let estimate = walker.step();
    let (metres, _) = walker.off_m(&estimate);
    let odometry_m = {
        let truth = ring::truth(0.5).inv_mul(&ring::truth(walker.way_m));
        let off = truth.inv_mul(&walker.odom_from_base);
        off.translation.vector.norm()
    };
    assert!(odometry_m > 0.3, "odometry drifts: {odometry_m}");
    assert!(metres < odometry_m / 3.0, "{metres} of {odometry_m}");
    let map = walker.slam.map();
    let closed = map.ledger().iter().filter(|e| e.verdict.is_accepted());
    assert!(closed.count() >= 2, "{:#?}", map.ledger());
    let poses: Vec<Pose> = map.nodes().iter().map(|n| n.map_from_node).collect();

    // Somebody says that the other side of the block is here.
    let last = NodeId(poses.len() as u32 - 1);
    let other = NodeId(poses.len() as u32 / 2);
    assert!(walker.slam.propose(last, other, &Pose::identity()));
    for _ in 0..200 {
        walker.scan(Condition::Ok);
    }
    let map = walker.slam.map();
    let proposed = map
        .ledger()
        .iter()
        .find(|e| e.found_by == FoundBy::Proposal);
    let proposed = proposed.expect("it stands in the ledger");
    assert!(
        matches!(proposed.verdict, Verdict::Refused(_) | Verdict::Waiting),
        "{proposed:?}"
    );
    assert!(!matches!(
        proposed.verdict,
        Verdict::Refused(Refusal::NoTime)
    ));

    // And a false loop that was proven and agreed upon, by whatever mishap.
    let map = walker.slam.map_mut();
    let stamp = map.nodes()[last.index()].stamp;
    let mut entry = map.open_entry(stamp, last, other, FoundBy::Looks);
    let truth = poses[other.index()].inv_mul(&poses[last.index()]);
    entry.candidate_from_node = truth
        * Pose::from_parts(
            Vector3::new(4.0, -2.0, 0.3).into(),
            Rotation::from_euler_angles(0.0, 0.0, 0.5),
        );
    map.close_entry(entry);
    let information = Matrix6::from_diagonal_element(1e4);
    let decided = map.add_loops(&[(entry.id, information)]).unwrap();
    let named = decided.iter().rfind(|e| e.id == entry.id).unwrap();
    assert_eq!(named.verdict, Verdict::Outvoted, "{decided:#?}");
    assert_eq!(map.ledger()[entry.id.0 as usize].verdict, Verdict::Outvoted);
    for (before, node) in poses.iter().zip(map.nodes()) {
        let moved = before
            .inv_mul(&node.map_from_node)
            .translation
            .vector
            .norm();
        assert!(moved < 0.15, "node {} moved by {moved} m", node.id);
    }
    // The true ones are still believed.
    let kept = map.ledger().iter().filter(|e| e.verdict.is_accepted());
    assert!(kept.count() >= 2);
}

#[test]
fn a_robot_that_is_carried_away_is_lost_then_recovering_then_ok_without_a_restart() {
    let mut walker = around(ROUND_M + 4.0);
    assert!(walker.step().condition.is_ok());
    let pieces = walker.slam.map().pieces().len();
    // In somebody's arms: nothing fits any more.
    for _ in 0..5 {
        let condition = Condition::Lost(Doubt::PoorFit { fit_share: 0.1 });
        let estimate = walker.scan(condition);
        assert!(matches!(estimate.condition, SlamCondition::Lost(_)));
    }
    walker.carry_to(ROUND_M + 2.0 * SIDE_M + 3.0);
    let mut seen = Vec::new();
    for _ in 0..200 {
        let estimate = walker.step();
        let name = estimate.condition.name();
        if seen.last() != Some(&name) {
            seen.push(name);
        }
        if estimate.condition.is_ok() {
            let (metres, radians) = walker.off_m(&estimate);
            assert!(metres < 0.2 && radians < 0.035, "{metres} m, {radians} rad");
            break;
        }
    }
    assert_eq!(seen.last(), Some(&"OK"), "{seen:?}");
    assert_eq!(seen.first(), Some(&"LOST"), "{seen:?}");
    assert!(seen.contains(&"RECOVERING"), "{seen:?}");
    let map = walker.slam.map();
    assert_eq!(map.pieces().len(), pieces + 1);
    assert!(map.nodes().iter().all(|n| n.piece.0 == 0), "one map again");
}
