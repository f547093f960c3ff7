//! Rounds and rounds through rooms that are known: the map grows with the space, not with time. On a
//! corridor whose every corner is known.

mod ring;

use std::sync::{Arc, Mutex};

use hachi_hal::Vector3;
use hachi_slam::ledger::FoundBy;
use hachi_slam::saved::SavedMap;
use hachi_slam::store::MapChange;
use hachi_slam::{MemoryStore, Slam, SlamConfig, StoreError, SubmapStore};
use ring::{SIDE_M, Walker};

const ROUND_M: f64 = 4.0 * SIDE_M;

/// What a map comes to after each round, and how far from the truth the robot is on it at most.
#[derive(Debug)]
struct Round {
    nodes: usize,
    edges: usize,
    most_off_m: f64,
}

fn round(walker: &mut Walker) -> Round {
    let mut most_off_m = 0.0f64;
    for _ in 0..(ROUND_M / 0.1) as usize {
        let estimate = walker.step();
        assert!(estimate.condition.is_ok(), "{:?}", estimate.condition);
        most_off_m = most_off_m.max(walker.off_m(&estimate).0);
    }
    let map = walker.slam.map();
    Round {
        nodes: map.nodes().len(),
        edges: map.edges().len(),
        most_off_m,
    }
}

fn walker(reuse_nodes: bool, store: Box<dyn SubmapStore>) -> Walker {
    let config = SlamConfig {
        reuse_nodes,
        ..SlamConfig::default()
    };
    Walker::new(Slam::new(config, store))
}

fn rounds(reuse_nodes: bool) -> Vec<Round> {
    let mut walker = walker(reuse_nodes, Box::new(MemoryStore::default()));
    (0..5).map(|_| round(&mut walker)).collect()
}

#[test]
fn after_five_rounds_the_map_is_as_large_as_after_one_and_as_true_as_with_a_node_for_everything() {
    let (reduced, full) = std::thread::scope(|scope| {
        let full = scope.spawn(|| rounds(false));
        (rounds(true), full.join().unwrap())
    });
    let (first, last) = (&reduced[0], &reduced[4]);
    assert!(full[4].nodes > 4 * first.nodes, "{full:#?}");
    assert!(4 * last.nodes <= 5 * first.nodes, "{reduced:#?}");
    assert!(4 * last.edges <= 5 * reduced[1].edges, "{reduced:#?}");
    // The last three rounds: without a loop nobody knows better than odometry.
    let worst = |rounds: &[Round]| rounds[2..].iter().map(|r| r.most_off_m).fold(0.0, f64::max);
    let (reduced_m, full_m) = (worst(&reduced), worst(&full));
    assert!(reduced_m < full_m + 0.03, "{reduced:#?} {full:#?}");
}

#[test]
fn what_is_new_at_a_known_place_gets_a_node_and_only_one_round_of_them() {
    let mut walker = walker(true, Box::new(MemoryStore::default()));
    round(&mut walker);
    let before = round(&mut walker).nodes;
    // A cupboard in the middle of the second side, at the inner wall.
    let (low, high) = ([SIDE_M - 1.2, 7.0, 0.0], [SIDE_M - 0.7, 8.2, 1.9]);
    walker.boxes.push([Vector3::from(low), Vector3::from(high)]);
    let with_it = round(&mut walker).nodes;
    let new = &walker.slam.map().nodes()[before..];
    let places: Vec<_> = new
        .iter()
        .map(|n| n.map_from_node.translation.vector + Vector3::new(0.5, 0.0, 0.0))
        .map(|p| [p.x, p.y])
        .collect();
    assert!((1..=6).contains(&new.len()), "{places:.1?}");
    // In the frame of the map, which is where the robot began.
    let near = places.iter().filter(|at| {
        let apart = (at[0] - SIDE_M).hypot(at[1] - 7.6);
        apart < SIDE_M / 2.0 + 2.0
    });
    assert!(near.count() >= 1, "{places:.1?}");
    // From now on it is known.
    let after = round(&mut walker).nodes;
    assert!(after - with_it <= 1, "{with_it} then {after}");
}

#[test]
fn a_robot_that_turns_on_the_spot_makes_nodes_for_a_few_turns_and_then_none() {
    let mut walker = walker(true, Box::new(MemoryStore::default()));
    walker.walk(5.0);
    let before = walker.slam.map().nodes().len();
    (walker.step_m, walker.turn_rad) = (0.0, 0.1);
    for _ in 0..12 * 63 {
        let estimate = walker.step();
        let (metres, radians) = walker.off_m(&estimate);
        assert!(metres < 0.1 && radians < 0.03, "{metres} m, {radians} rad");
    }
    // A node for every 1.2 rad would be 63.
    let turned = walker.slam.map().nodes().len() - before;
    assert!(turned <= 18, "{turned}");
}

/// Keeps a map as a file would.
#[derive(Clone, Default)]
struct Kept {
    submaps: MemoryStore,
    saved: SavedMap,
}

#[derive(Clone, Default)]
struct Keeper(Arc<Mutex<Kept>>);

impl SubmapStore for Keeper {
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError> {
        let kept = &mut *self.0.lock().unwrap();
        kept.submaps.commit(change)?;
        for new in change.nodes {
            kept.saved.nodes.push(new.node);
            let looks = (new.node.id, new.descriptor.to_vec());
            kept.saved.descriptors.push(looks);
        }
        kept.saved.edges.extend_from_slice(change.edges);
        let gone = |id: &u32| change.removed_edges.contains(id);
        kept.saved.edges.retain(|e| !gone(&e.id));
        for entry in change.ledger {
            let index = entry.id.0 as usize;
            if index == kept.saved.ledger.len() {
                kept.saved.ledger.push(*entry);
            } else {
                kept.saved.ledger[index] = *entry;
            }
        }
        for (id, pose) in change.poses {
            kept.saved.nodes[id.index()].map_from_node = *pose;
        }
        for (piece, target) in change.joined {
            for node in &mut kept.saved.nodes {
                if node.piece == *piece {
                    node.piece = *target;
                }
            }
        }
        Ok(())
    }

    fn submap(&mut self, node: hachi_slam::NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError> {
        self.0.lock().unwrap().submaps.submap(node, bytes)
    }
}

#[test]
fn a_second_run_in_a_saved_map_adds_what_it_takes_to_find_itself_and_can_be_undone() {
    let keeper = Keeper::default();
    let mut first = walker(true, Box::new(keeper.clone()));
    first.walk(ROUND_M * 1.5);
    // Killed: nothing is finished. What was a node is there, and holds together.
    let nodes = first.slam.map().nodes().len();
    let saved = keeper.0.lock().unwrap().saved.clone();
    saved.check().unwrap();
    assert_eq!(saved.nodes.len(), nodes);

    let slam = Slam::resume(SlamConfig::default(), saved, Box::new(keeper.clone())).unwrap();
    let mut second = Walker::new(slam);
    second.carry_to(1.5 * SIDE_M);
    let mut found_after = 0;
    while !second.step().condition.is_ok() {
        found_after += 1;
        assert!(found_after < 400, "lost");
    }
    let found = second.slam.map().nodes().len();
    let there = round(&mut second);
    assert!(
        there.nodes - nodes <= nodes / 3,
        "{nodes} {found} {there:?}"
    );
    assert!(there.most_off_m < 0.15, "{there:?}");
    let saved = keeper.0.lock().unwrap().saved.clone();
    saved.check().unwrap();
    assert_eq!(saved.nodes.len(), there.nodes);

    // Whatever covered submaps told the graph can be taken out again: the chain holds.
    let map = second.slam.map();
    let told: Vec<_> = map
        .ledger()
        .iter()
        .filter(|l| l.found_by == FoundBy::Coverage && l.verdict.is_accepted())
        .map(|l| l.id)
        .collect();
    assert!(!told.is_empty());
    for id in told {
        assert!(second.slam.veto(id).unwrap().is_some());
    }
    let estimate = second.step();
    assert!(second.off_m(&estimate).0 < 0.3);
}
