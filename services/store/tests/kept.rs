//! What was kept is there: after a restart, after a power cut, and where it can't be it is said.

use std::path::Path;

use hachi_hal::{Pose, Rotation, Stamp, Vector3};
use hachi_slam::edge::{Edge, EdgeKind};
use hachi_slam::ledger::{FoundBy, LedgerEntry, LoopId, Verdict};
use hachi_slam::node::{Ground, Node, NodeId, PieceId};
use hachi_slam::store::{MapChange, NewNode};
use hachi_store::{Access, Identity, MapError, MapFile};
use nalgebra::Matrix6;

fn robot(platform: &str) -> Identity {
    Identity {
        platform: platform.to_owned(),
        sensor: "VLP-16".to_owned(),
    }
}

fn pose(i: u32) -> Pose {
    Pose::from_parts(
        Vector3::new(1.5 * f64::from(i), 0.1, -0.02).into(),
        Rotation::from_euler_angles(0.01, -0.02, 0.3 * f64::from(i)),
    )
}

fn node(i: u32) -> Node {
    Node {
        id: NodeId(i),
        session: 0,
        piece: PieceId(0),
        chained: i > 0,
        stamp: Stamp::from_nanos(1_700_000_000_000_000_000 + i64::from(i) * 2_000_000_000),
        odom_from_node: pose(i),
        map_from_node: pose(i),
        path_m: 1.5 * f64::from(i),
        ground: Ground::level(0.62),
    }
}

fn edge(i: u32) -> Edge {
    Edge {
        id: i,
        kind: EdgeKind::Chain,
        first: NodeId(i),
        second: NodeId(i + 1),
        first_from_second: pose(i).inv_mul(&pose(i + 1)),
        information: Matrix6::identity() * 1e4 + Matrix6::repeat(3.0),
    }
}

/// Node `i` with the edge from the one before, and a submap that says which it is.
fn keep(map: &mut MapFile, i: u32) -> Result<(), MapError> {
    let submap = vec![i as u8; 50_000];
    let nodes = [NewNode {
        node: node(i),
        submap: &submap,
        descriptor: &[7; 4_800],
    }];
    let edges: Vec<Edge> = i.checked_sub(1).map(edge).into_iter().collect();
    map.write(&MapChange {
        nodes: &nodes,
        edges: &edges,
        ..MapChange::default()
    })
}

#[test]
fn a_map_comes_back_as_it_was_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("office.map");
    let mut map = MapFile::create(&path, &robot("go1")).unwrap();
    for i in 0..5 {
        keep(&mut map, i).unwrap();
    }
    let mut entry = LedgerEntry::new(
        LoopId(0),
        node(4).stamp,
        NodeId(4),
        NodeId(0),
        FoundBy::Looks,
    );
    entry.similarity = 0.75;
    entry.chi2 = 3.5;
    entry.candidate_from_node = pose(1);
    entry.verdict = Verdict::Accepted;
    let closing = Edge {
        id: 4,
        kind: EdgeKind::Loop(LoopId(0)),
        first: NodeId(0),
        second: NodeId(4),
        ..edge(3)
    };
    map.write(&MapChange {
        edges: &[closing],
        ledger: &[entry],
        poses: &[(NodeId(3), pose(9))],
        removed_edges: &[1],
        joined: &[(PieceId(0), PieceId(2))],
        ..MapChange::default()
    })
    .unwrap();
    drop(map);
    assert!(
        !folder.path().join("office.map-wal").exists(),
        "a map that was closed is one file"
    );

    let map = MapFile::open(&path, Access::Read).unwrap();
    assert_eq!(map.identity(), &robot("go1"));
    let mut bytes = Vec::new();
    map.read_submap(NodeId(3), &mut bytes).unwrap();
    assert_eq!(bytes, vec![3; 50_000]);
    // A joined piece is known by its new number: here one that has no beginning, which is said.
    assert!(matches!(map.load(), Err(MapError::Damaged { .. })));
    drop(map);

    let mut map = MapFile::open(&path, Access::Write).unwrap();
    map.write(&MapChange {
        joined: &[(PieceId(2), PieceId(0))],
        ..MapChange::default()
    })
    .unwrap();
    let saved = map.load().unwrap();
    assert_eq!(saved.nodes.len(), 5);
    assert_eq!(saved.nodes[2], node(2));
    assert_eq!(saved.nodes[3].map_from_node, pose(9));
    assert_eq!(saved.edges, [edge(0), edge(2), edge(3), closing]);
    assert_eq!(saved.ledger.len(), 1);
    assert_eq!(saved.ledger[0].verdict, Verdict::Accepted);
    assert_eq!(saved.ledger[0].similarity, 0.75);
    assert!(
        saved.ledger[0].yaw_rad.is_nan(),
        "what was not asked stays so"
    );
    assert_eq!(saved.descriptors[4], (NodeId(4), vec![7; 4_800]));
}

/// Where the child process of the next test writes; unset in an ordinary run.
const VICTIM: &str = "HACHI_STORE_VICTIM";

/// Not a test of its own: keeps nodes and says so, until it is killed.
#[test]
fn writes_until_it_is_killed() {
    let Ok(path) = std::env::var(VICTIM) else {
        return;
    };
    let mut map = MapFile::create(Path::new(&path), &robot("go1")).unwrap();
    for i in 0.. {
        keep(&mut map, i).unwrap();
        // The reader counts these lines: each says that its node is kept.
        #[allow(clippy::print_stdout, reason = "a line to the parent process")]
        {
            println!("kept {i}");
        }
    }
}

#[test]
fn killed_at_any_instant_the_map_is_that_of_the_last_node_kept() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    for (round, kills_after) in [1u32, 2, 5, 9, 17].into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("killed.map");
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "writes_until_it_is_killed", "--nocapture"])
            .env(VICTIM, &path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut kept = 0;
        while kept < kills_after {
            let line = lines.next().unwrap().unwrap();
            kept += u32::from(line.contains("kept"));
        }
        // Somewhere within the next transaction.
        std::thread::sleep(std::time::Duration::from_micros(700 * round as u64));
        child.kill().unwrap();
        child.wait().unwrap();

        let mut map = MapFile::open(&path, Access::Write).unwrap();
        let saved = map.load().unwrap();
        let count = saved.nodes.len() as u32;
        assert!(
            count >= kills_after,
            "{count} of {kills_after} said to be kept"
        );
        assert_eq!(
            saved.edges.len() as u32,
            count - 1,
            "a node without its edge"
        );
        let mut bytes = Vec::new();
        for i in 0..count {
            map.read_submap(NodeId(i), &mut bytes).unwrap();
            assert_eq!(bytes, vec![i as u8; 50_000]);
        }
        // And it can be gone on with.
        keep(&mut map, count).unwrap();
    }
}

#[test]
fn a_full_disk_costs_the_node_that_did_not_fit_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.map");
    let mut map = MapFile::create(&path, &robot("go1")).unwrap();
    map.set_quota(400_000).unwrap();
    let mut kept = 0;
    let error = loop {
        match keep(&mut map, kept) {
            Ok(()) => kept += 1,
            Err(error) => break error,
        }
    };
    assert!(matches!(error, MapError::Full { .. }), "{error:?}");
    assert!(error.to_string().contains("free some space"), "{error}");
    assert!(kept > 2);
    assert_eq!(map.load().unwrap().nodes.len() as u32, kept);
    map.set_quota(4_000_000).unwrap();
    keep(&mut map, kept).unwrap();
    drop(map);
    let map = MapFile::open(&path, Access::Read).unwrap();
    assert_eq!(map.load().unwrap().nodes.len() as u32, kept + 1);
}

#[test]
fn what_is_no_map_of_ours_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let refused = |name: &str| MapFile::open(&path(name), Access::Write).unwrap_err();

    let missing = refused("missing.map");
    assert!(missing.to_string().contains("--map"), "{missing}");

    std::fs::write(path("text.map"), "not a map\n".repeat(500)).unwrap();
    let text = refused("text.map");
    assert!(matches!(text, MapError::NotAMap { .. }), "{text:?}");

    let other = rusqlite::Connection::open(path("other.map")).unwrap();
    other
        .execute_batch("CREATE TABLE node (id INTEGER)")
        .unwrap();
    drop(other);
    let other = refused("other.map");
    assert!(matches!(other, MapError::NotAMap { .. }), "{other:?}");

    let mut map = MapFile::create(&path("ours.map"), &robot("go1")).unwrap();
    for i in 0..4 {
        keep(&mut map, i).unwrap();
    }
    let twice = refused("ours.map");
    assert!(matches!(twice, MapError::InUse { .. }), "{twice:?}");
    let robot_error = map.check_identity(&robot("b1")).unwrap_err().to_string();
    assert!(
        robot_error.contains("go1") && robot_error.contains("b1"),
        "{robot_error}"
    );
    assert!(MapFile::create(&path("ours.map"), &robot("go1")).is_err());
    drop(map);

    let mut read_only = MapFile::open(&path("ours.map"), Access::Read).unwrap();
    let error = keep(&mut read_only, 4).unwrap_err();
    assert!(matches!(error, MapError::ReadOnly { .. }), "{error:?}");
    drop(read_only);

    // An older program's file is read, and is this one's once it is gone on with.
    let version = |set: Option<i64>| -> i64 {
        let file = rusqlite::Connection::open(path("ours.map")).unwrap();
        if let Some(version) = set {
            file.pragma_update(None, "user_version", version).unwrap();
        }
        file.pragma_query_value(None, "user_version", |row| row.get(0))
            .unwrap()
    };
    version(Some(2));
    let older = MapFile::open(&path("ours.map"), Access::Read).unwrap();
    assert_eq!(older.load().unwrap().nodes.len(), 4);
    drop(older);
    drop(MapFile::open(&path("ours.map"), Access::Write).unwrap());
    assert_eq!(version(None), 3);
    version(Some(1));
    let oldest = refused("ours.map");
    assert!(matches!(oldest, MapError::Version { found: 1, .. }));

    let newer = rusqlite::Connection::open(path("ours.map")).unwrap();
    newer.pragma_update(None, "user_version", 9).unwrap();
    drop(newer);
    let newer = refused("ours.map");
    assert!(
        matches!(newer, MapError::Version { found: 9, .. }),
        "{newer:?}"
    );
    assert!(newer.to_string().contains("the program that wrote it"));
}

#[test]
fn a_file_cut_short_or_scribbled_over_is_an_error_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.map");
    let mut map = MapFile::create(&path, &robot("go1")).unwrap();
    for i in 0..6 {
        keep(&mut map, i).unwrap();
    }
    drop(map);
    let whole = std::fs::read(&path).unwrap();
    let broken = folder.path().join("broken.map");
    let mut bytes = Vec::new();
    let mut try_all = |content: &[u8]| -> bool {
        std::fs::write(&broken, content).unwrap();
        let Ok(map) = MapFile::open(&broken, Access::Read) else {
            return false;
        };
        let whole = map.load().is_ok_and(|saved| saved.nodes.len() == 6);
        whole && (0..6).all(|i| map.read_submap(NodeId(i), &mut bytes).is_ok())
    };
    assert!(try_all(&whole));
    for tenth in 0..10 {
        assert!(!try_all(&whole[..whole.len() * tenth / 10]), "{tenth}");
    }
    // Bytes of the pages that hold the tables: whatever comes of it, it is no panic.
    for at in (0..whole.len().min(40_000)).step_by(997) {
        let mut changed = whole.clone();
        changed[at] ^= 0xff;
        try_all(&changed);
    }
}
