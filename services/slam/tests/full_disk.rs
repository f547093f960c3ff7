//! A disk that is full for long: the robot goes on, memory stays bounded, and what was lost is counted;
//! and maps of more nodes than may wait for a disk that is not.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use hachi_hal::{Pose, Stamp};
use hachi_slam::codec;
use hachi_slam::merge::{MergeError, merge};
use hachi_slam::node::{Ground, PieceId};
use hachi_slam::store::MapChange;
use hachi_slam::submap::{Submap, SubmapPoint};
use hachi_slam::{Map, Node, NodeId, SlamConfig, StoreError, StoreFault, SubmapStore};
use nalgebra::Matrix6;

/// Keeps what each node came with, and how many surfaces that is, unless it is full.
#[derive(Clone, Default)]
struct Disk {
    is_full: Arc<AtomicBool>,
    surfaces: Arc<Mutex<Vec<usize>>>,
    submaps: Arc<Mutex<HashMap<NodeId, Vec<u8>>>>,
}

impl SubmapStore for Disk {
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError> {
        if self.is_full.load(Ordering::Relaxed) {
            return Err(StoreError {
                fault: StoreFault::Full,
                message: "no room".to_owned(),
            });
        }
        let mut submap = Submap::default();
        for new in change.nodes {
            codec::decode(new.submap, &mut submap).unwrap();
            self.surfaces.lock().unwrap().push(submap.points.len());
            let mut submaps = self.submaps.lock().unwrap();
            submaps.insert(new.node.id, new.submap.to_vec());
        }
        Ok(())
    }

    fn submap(&mut self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError> {
        let submaps = self.submaps.lock().unwrap();
        let kept = submaps.get(&node).ok_or_else(|| StoreError {
            fault: StoreFault::Full,
            message: "nothing was kept".to_owned(),
        })?;
        bytes.clone_from(kept);
        Ok(())
    }
}

fn submap() -> Submap {
    let point = |x: f32| SubmapPoint {
        position: [x, 1.0, 0.0],
        normal: [0.0, -1.0, 0.0],
        intensity: 50,
        viewpoint: 0,
    };
    Submap {
        voxel_m: 0.1,
        viewpoints: vec![[0.0; 3]],
        points: (0..100).map(|i| point(i as f32 * 0.1)).collect(),
    }
}

fn add(map: &mut Map, id: u32) {
    let pose = Pose::translation(1.5 * f64::from(id), 0.0, 0.0);
    let node = Node {
        id: NodeId(id),
        session: 0,
        piece: PieceId(0),
        chained: id > 0,
        stamp: Stamp::from_nanos(i64::from(id) * 1_000_000_000),
        odom_from_node: pose,
        map_from_node: pose,
        path_m: 1.5 * f64::from(id),
        ground: Ground::level(0.5),
    };
    let edge = id.checked_sub(1).map(|before| {
        let step = Pose::translation(1.5, 0.0, 0.0);
        (NodeId(before), step, Matrix6::identity() * 1e4)
    });
    map.add_node(node, Arc::new(submap()), edge).unwrap();
}

#[test]
fn what_a_full_disk_does_not_take_is_bounded_and_counted_and_the_rest_comes_back() {
    const NODES: u32 = 300;
    const MOST_PENDING: u32 = 256;
    let disk = Disk::default();
    disk.is_full.store(true, Ordering::Relaxed);
    // No room in memory either: every submap but the last is asked of the store.
    let mut map = Map::new(Box::new(disk.clone()), 1);
    map.begin_piece();
    for id in 0..NODES {
        add(&mut map, id);
        let error = map.commit(false).unwrap_err();
        assert_eq!(error.fault, StoreFault::Full);
    }
    assert_eq!(map.submaps_given_up(), u64::from(NODES - MOST_PENDING));
    assert_eq!(map.submap(NodeId(0)).unwrap().points.len(), 0);
    let waiting = map.submap(NodeId(NODES - MOST_PENDING)).unwrap();
    assert_eq!(waiting.points.len(), 100);

    disk.is_full.store(false, Ordering::Relaxed);
    map.commit(true).unwrap();
    let kept = disk.surfaces.lock().unwrap().clone();
    assert_eq!(kept.len(), NODES as usize, "every node is kept");
    let given_up = (NODES - MOST_PENDING) as usize;
    assert!(kept[..given_up].iter().all(|n| *n == 0));
    assert!(kept[given_up..].iter().all(|n| *n == 100));
}

#[test]
fn a_merge_of_long_maps_keeps_every_submap() {
    const NODES: u32 = 300;
    let long = || {
        let mut map = Map::new(Box::new(Disk::default()), 1);
        map.begin_piece();
        for id in 0..NODES {
            add(&mut map, id);
            map.commit(false).unwrap();
        }
        map
    };
    let disk = Disk::default();
    let merged = merge(
        &mut long(),
        &mut long(),
        Box::new(disk.clone()),
        &SlamConfig::default(),
        |_| (),
    );
    // A bare wall is no place that could be recognised; by then everything is copied.
    assert!(
        matches!(merged, Err(MergeError::Apart)),
        "{:?}",
        merged.err()
    );
    let kept = disk.surfaces.lock().unwrap().clone();
    assert_eq!(kept.len(), 2 * NODES as usize);
    assert!(kept.iter().all(|surfaces| *surfaces == 100));
}
