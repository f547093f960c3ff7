//! Real sequences: the metrics against py-motmetrics' published numbers, the tracker against SORT.
#![allow(
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "a test that does not run says so, and figures are printed"
)]

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use hachi_people::metrics::{TrackMetrics, evaluate};
use hachi_people::mot::{self, MotLine};
use hachi_people::recording::track_detections;
use hachi_people::track::TrackerConfig;

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("HACHI_DATA");
    if folder.is_none() {
        eprintln!("skipped: HACHI_DATA names no folder with people");
    }
    Some(Path::new(&folder?).join("people"))
}

fn read(path: &Path) -> Vec<MotLine> {
    mot::read(BufReader::new(File::open(path).unwrap())).unwrap()
}

fn truth(people: &Path, sequence: &str) -> Vec<MotLine> {
    read(&people.join("tud").join(sequence).join("gt.txt"))
}

/// A figure in percent, to one decimal.
fn percent(value: f64) -> f64 {
    (1000.0 * value).round() / 10.0
}

/// MOTA, IDF1, FP, FN, IDs, MT, ML.
fn figures(m: &TrackMetrics) -> (f64, f64, usize, usize, usize, usize, usize) {
    let shares = (percent(m.mota), percent(m.idf1));
    (shares.0, shares.1, m.fp, m.r#fn, m.ids, m.mt, m.ml)
}

#[test]
fn metrics_are_those_of_py_motmetrics() {
    let Some(people) = folder() else { return };
    for (sequence, result, expected) in [
        (
            "TUD-Campus",
            "tud/TUD-Campus/test.txt",
            (52.6, 55.8, 13, 150, 7, 1, 1),
        ),
        (
            "TUD-Stadtmitte",
            "tud/TUD-Stadtmitte/test.txt",
            (56.4, 64.5, 45, 452, 7, 5, 1),
        ),
        (
            "TUD-Campus",
            "sort_output/TUD-Campus.txt",
            (62.7, 60.6, 15, 113, 6, 5, 0),
        ),
        (
            "TUD-Stadtmitte",
            "sort_output/TUD-Stadtmitte.txt",
            (71.7, 73.5, 22, 295, 10, 6, 0),
        ),
    ] {
        let metrics = evaluate(&truth(&people, sequence), &read(&people.join(result))).unwrap();
        assert_eq!(figures(&metrics), expected, "{result}");
    }
}

#[test]
fn people_are_followed_better_than_by_sort() {
    let Some(people) = folder() else { return };
    for (sequence, sort_mota, sort_idf1) in [
        ("TUD-Campus", 0.627, 0.606),
        ("TUD-Stadtmitte", 0.717, 0.735),
    ] {
        let detections = people
            .join("mot15_detections")
            .join(sequence)
            .join("det/det.txt");
        let tracks = track_detections(&read(&detections), TrackerConfig::default(), 10.0);
        let metrics = evaluate(&truth(&people, sequence), &tracks).unwrap();
        println!("{sequence}: {:?}", figures(&metrics));
        assert!(
            metrics.mota > sort_mota && metrics.idf1 > sort_idf1,
            "{metrics:?}"
        );
    }
}
