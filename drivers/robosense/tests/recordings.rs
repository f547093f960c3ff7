//! A real recording, against what is known of it and against another decoder's clouds.
//!
//! Run with `HACHI_DATA` naming the folder of recordings; without it each test says that it was
//! skipped.
#![allow(clippy::print_stderr, reason = "a test without its recordings says so")]

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::conformance::ScanPromise;
use hachi_hal::{Completeness, LidarScans, Point, ScanHeader, Stamp};
use hachi_robosense::packet::{ReturnMode, SyncStatus};
use hachi_robosense::{RobosenseConfig, RobosenseScans};

const NEVER: Stamp = Stamp::from_nanos(i64::MAX);

fn recording() -> Option<PathBuf> {
    let Ok(data) = std::env::var("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA is not set, helios16p_5scans.pcap not read");
        return None;
    };
    Some(PathBuf::from(data).join("robosense/helios16p_5scans.pcap"))
}

type Scans = Vec<(ScanHeader, Vec<Point>)>;
type Lidar = RobosenseScans<CaptureSource<std::fs::File>>;

fn scans(path: &Path) -> (Scans, Lidar) {
    let capture = CaptureSource::open(path, CaptureConfig::default()).unwrap();
    let mut lidar = RobosenseScans::new(capture, RobosenseConfig::default());
    let (mut scans, mut promise) = (Vec::new(), ScanPromise::default());
    let mut points = Vec::new();
    while let Some(header) = lidar.read_scan(&mut points, NEVER).unwrap() {
        promise.check(&header, &points).unwrap();
        scans.push((header, points.clone()));
    }
    assert!(lidar.at_end());
    (scans, lidar)
}

#[test]
fn calibration_that_comes_in_the_fourth_turn_is_used_from_the_first() {
    let Some(path) = recording() else { return };
    let (scans, lidar) = scans(&path);
    let counters = lidar.counters();
    assert_eq!((counters.packets, counters.difop_packets), (750, 1));
    assert!(
        counters.dropped().all(|(_, count)| count == 0),
        "{counters:?}"
    );
    let difop = lidar.difop().unwrap();
    assert_eq!(difop.return_mode, ReturnMode::Strongest);
    assert_eq!(difop.configured_rpm, 600);
    assert_eq!(difop.sync_status, SyncStatus::Unsynchronised);
    // Its lowest laser points to -8.01°, the manual's to -15°.
    for (_, points) in &scans {
        let low = points.iter().filter(|p| p.ring == 0 && p.range_m > 0.5);
        for point in low {
            let elevation = (point.z / point.range_m).asin().to_degrees();
            assert!((elevation + 8.01).abs() < 0.01, "{elevation}");
        }
    }
    let kinds: Vec<_> = scans.iter().map(|(h, _)| h.completeness).collect();
    assert_eq!(kinds.first(), Some(&Completeness::PartialFirst));
    assert_eq!(kinds.last(), Some(&Completeness::PartialLast));
    assert_eq!(kinds.len(), 6);
}

/// A point of the other decoder's cloud.
struct Expected {
    position: [f32; 3],
    intensity: f32,
    channel: u16,
    azimuth_deg: f32,
    range_m: f32,
}

/// Reads the text clouds that lie beside the recording: x y z intensity return_type channel
/// azimuth elevation distance time_stamp, angles in 0.01°.
fn read_pcd(path: &Path) -> Vec<Expected> {
    let text = std::fs::read_to_string(path).unwrap();
    let (_, rows) = text.split_once("DATA ascii\n").unwrap();
    rows.lines()
        .map(|row| {
            let values: Vec<f32> = row.split(' ').map(|v| v.parse().unwrap()).collect();
            Expected {
                position: [values[0], values[1], values[2]],
                intensity: values[3],
                channel: values[5] as u16,
                azimuth_deg: values[6] / 100.0,
                range_m: values[8],
            }
        })
        .collect()
}

fn apart_deg(a: f32, b: f32) -> f32 {
    let difference = (a - b).rem_euclid(360.0);
    difference.min(360.0 - difference)
}

#[test]
fn another_decoders_clouds_are_found_point_by_point() {
    let Some(path) = recording() else { return };
    let (scans, _) = scans(&path);
    let mut ours: HashMap<(u16, u32), Vec<&Point>> = HashMap::new();
    for point in scans.iter().flat_map(|(_, points)| points) {
        let count = (point.range_m * 400.0).round() as u32;
        ours.entry((point.ring, count)).or_default().push(point);
    }
    let clouds = std::fs::read_dir(path.with_file_name("helios16p_expected")).unwrap();
    let mut compared = 0;
    for cloud in clouds {
        let expected = read_pcd(&cloud.unwrap().path());
        let found = expected.iter().filter(|e| is_among(e, &ours)).count();
        let share = found as f64 / expected.len() as f64;
        eprintln!("{found} of {} points found", expected.len());
        // What is left (one in a thousand) lies 0.020 to 0.036 degrees beside theirs: late lasers of
        // blocks where the rotor's step strays from its usual 0.20 degrees, and where that decoder
        // cuts to whole hundredths what ours keeps.
        assert!(share >= 0.995, "{share}");
        compared += 1;
    }
    assert_eq!(compared, 2);
}

fn is_among(expected: &Expected, ours: &HashMap<(u16, u32), Vec<&Point>>) -> bool {
    let count = (expected.range_m * 400.0).round() as u32;
    let candidates = (count - 1..=count + 1).filter_map(|c| ours.get(&(expected.channel, c)));
    candidates.flatten().any(|point| {
        let apart_m = point
            .position()
            .iter()
            .zip(expected.position)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f32>()
            .sqrt();
        // 0.02° of the range, a distance count, and the lens offset turned by as much.
        let limit_m = (point.range_m + 0.035) * 0.02_f32.to_radians() + 0.003;
        (point.intensity - expected.intensity).abs() <= 1.0
            && apart_deg(point.azimuth_deg, expected.azimuth_deg) <= 0.02
            && apart_m <= limit_m
    })
}
