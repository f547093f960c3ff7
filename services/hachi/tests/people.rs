//! `hachi people` and `hachi eval tracks` from outside.

mod program;

use std::fmt::Write as _;

use program::{file, recording, run, text};

/// One person who walks, as detections; the detector misses frames 10 to 12.
fn walk() -> String {
    let mut lines = String::new();
    for frame in (1..=30).filter(|frame| !(10..=12).contains(frame)) {
        let _ = writeln!(lines, "{frame},-1,{},50,40,100,0.9", 2 * frame);
    }
    lines
}

#[test]
fn detections_become_tracks_that_the_evaluation_accepts() {
    let folder = tempfile::tempdir().unwrap();
    let detections = file(folder.path(), "det.txt", &walk());
    let tracks = folder.path().join("tracks.txt");
    let out = run(&[
        "people",
        "track",
        text(&detections),
        "--out",
        text(&tracks),
        "--json",
    ])
    .json();
    assert_eq!((&out["people"], &out["boxes"]), (&1.into(), &30.into()));
    let truth: String = (1..=30)
        .map(|frame| format!("{frame},1,{},50,40,100,1\n", 2 * frame))
        .collect();
    let truth = file(folder.path(), "gt.txt", &truth);
    let metrics = run(&[
        "eval",
        "tracks",
        "--reference",
        text(&truth),
        "--estimate",
        text(&tracks),
        "--json",
    ])
    .json();
    assert_eq!(
        (&metrics["mota"], &metrics["idf1"]),
        (&1.0.into(), &1.0.into())
    );
    for key in ["ids", "fp", "fn", "ml"] {
        assert_eq!(metrics[key], 0, "{key}");
    }
    assert_eq!(metrics["mt"], 1);
}

#[test]
fn a_bad_line_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let detections = file(
        folder.path(),
        "det.txt",
        "1,-1,5,5,10,20,0.9\n2,-1,x,5,10,20,0.9\n",
    );
    let tracks = folder.path().join("tracks.txt");
    let failed = run(&["people", "track", text(&detections), "--out", text(&tracks)]);
    assert!(
        failed.failure().contains("line 2: the left edge is \"x\""),
        "{}",
        failed.stderr
    );
    assert!(!tracks.exists());
}

#[test]
fn metrics_of_a_real_result_are_the_published_ones() {
    let Some(people) = recording("people") else {
        return;
    };
    let sequence = people.join("tud/TUD-Campus");
    let metrics = run(&[
        "eval",
        "tracks",
        "--json",
        "--reference",
        text(&sequence.join("gt.txt")),
        "--estimate",
        text(&sequence.join("test.txt")),
    ])
    .json();
    let counts = ["fp", "fn", "ids", "mt", "ml"].map(|key| metrics[key].as_u64().unwrap());
    assert_eq!(counts, [13, 150, 7, 1, 1]);
    assert!((metrics["mota"].as_f64().unwrap() - 0.526).abs() < 5e-4);
    assert!((metrics["idf1"].as_f64().unwrap() - 0.558).abs() < 5e-4);
}
