//! Recordings of the simulated robot: kept, replayed, and the same bytes every time.

mod program;
mod rig;

use std::path::{Path, PathBuf};

use hachi_bridge::{Bag, Body};
use program::{file, hachi, names, run, text, tum, whole_results};
use rig::{Rig, alone};

/// A walk of the simulated B1, recorded.
fn walk(folder: &Path, seconds: &str) -> PathBuf {
    let path = folder.join("walk.mcap");
    let out = folder.join("demo");
    let arguments = [
        "demo",
        "--seconds",
        seconds,
        "--headless",
        "--out",
        text(&out),
    ];
    run(&[&arguments[..], &["--record", text(&path)]].concat()).success();
    path
}

#[test]
fn a_recorded_walk_replays_to_the_truth_with_the_same_bytes_for_one_thread_and_two() {
    let folder = tempfile::tempdir().unwrap();
    let recording = walk(folder.path(), "6");
    let legs = file(folder.path(), "legs.toml", "motion = \"odometry\"\n");
    let replay = |threads: &str| {
        let out = folder.path().join(threads);
        let arguments = [
            "replay",
            text(&recording),
            "--platform",
            "b1",
            "--stage",
            "slam",
        ];
        let more = [
            "--config",
            text(&legs),
            "--threads",
            threads,
            "--out",
            text(&out),
        ];
        run(&[&arguments[..], &more].concat()).success();
        out
    };
    let (one, two) = (replay("1"), replay("2"));
    let report = whole_results(&one);
    assert!(
        (58..=60).contains(&report["scans"].as_u64().unwrap()),
        "{report}"
    );
    for name in names(&one).iter().filter(|name| *name != "report.json") {
        let read = |out: &Path| std::fs::read(out.join(name)).unwrap();
        assert!(read(&one) == read(&two), "{name} differs");
    }
    let error = run(&[
        "eval",
        "trajectory",
        "--reference",
        text(&folder.path().join("demo/truth.tum")),
        "--estimate",
        text(&one.join("trajectory.tum")),
        "--align",
        "se3",
        "--json",
    ])
    .json();
    assert!(error["ape"]["rmse"].as_f64().unwrap() < 0.05, "{error}");
    assert!(error["ape"]["n"].as_u64().unwrap() > 50, "{error}");
}

/// Read with the program's own reader, which was tried on other programs' files.
#[test]
fn legs_and_body_are_in_it_with_their_own_values() {
    let folder = tempfile::tempdir().unwrap();
    let recording = walk(folder.path(), "3");
    let mut bag = Bag::open(&recording).unwrap();
    assert!(bag.notes().is_empty(), "{:?}", bag.notes());
    let mut kinds: Vec<_> = bag.topics().iter().map(|t| t.name.clone()).collect();
    kinds.sort();
    let expected = [
        "/imu",
        "/joint_states",
        "/leg_odometry",
        "/velodyne_packets",
    ];
    assert_eq!(kinds, expected);
    let (mut forces, mut way_m, mut packets) = (Vec::new(), 0.0f64, 0);
    while let Some(message) = bag.next_message().unwrap() {
        match message.body {
            Body::Imu(sample) => forces.push(sample.specific_force.norm()),
            Body::Odometry(sample) => way_m = sample.odom_from_base.translation.x,
            Body::Packets(some) => packets += some.len(),
            _ => {}
        }
    }
    // A state every 3 ms (the simulated robot steps by the millisecond), 754 packets a second,
    // gravity in the mean, and the way that the truth has.
    assert!(forces.len() > 950, "{}", forces.len());
    assert!((2_150..=2_270).contains(&packets), "{packets}");
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    assert!((mean - 9.81).abs() < 0.3, "{mean}");
    let truth = tum(&folder.path().join("demo/truth.tum"));
    let gone = truth.last().unwrap()[1];
    assert!(gone > 0.8 && (way_m - gone).abs() < 0.15, "{way_m} {gone}");
}

#[test]
fn a_live_recording_is_whole_and_one_that_is_there_is_not_touched() {
    let _alone = alone();
    let rig = Rig::new("go1");
    let settings = rig.write(&rig.settings());
    let path = rig.folder.path().join("live.mcap");
    let arguments = [
        "record",
        "--seconds",
        "3",
        "--config",
        text(&settings),
        "--out",
    ];
    let record = || hachi().args(arguments).arg(&path).output().unwrap();
    assert!(record().status.success());
    assert_eq!(rig.now().way_m, 0.0, "nobody drives it");
    let again = record();
    let said = String::from_utf8(again.stderr).unwrap();
    assert!(
        !again.status.success() && said.contains("live.mcap"),
        "{said}"
    );
    let out = rig.folder.path().join("replay");
    let replay = [
        "replay",
        text(&path),
        "--platform",
        "go1",
        "--out",
        text(&out),
    ];
    run(&replay).success();
    assert!(whole_results(&out)["scans"].as_u64().unwrap() > 15);
}
