//! Real recordings, against what is known of them and against another decoder's clouds.
//!
//! Run with `HACHI_DATA` naming the folder of recordings; without it each test says that it was
//! skipped.
#![allow(clippy::print_stderr, reason = "a test without its recordings says so")]

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::conformance::ScanPromise;
use hachi_hal::{Completeness, LidarScans, PacketSource, Point, ReturnKind, ScanHeader, Stamp};
use hachi_velodyne::packet::nmea::Sentence;
use hachi_velodyne::packet::{Decoder, DecoderConfig, PointBatch, Pps};
use hachi_velodyne::{StampSource, VelodyneConfig, VelodyneCounters, VelodyneScans};

const NEVER: Stamp = Stamp::from_nanos(i64::MAX);

fn recording(name: &str) -> Option<PathBuf> {
    let Ok(data) = std::env::var("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA is not set, {name} not read");
        return None;
    };
    Some(PathBuf::from(data).join("velodyne").join(name))
}

type Scans = Vec<(ScanHeader, Vec<Point>)>;

fn open(path: &Path, config: VelodyneConfig) -> VelodyneScans<CaptureSource<std::fs::File>> {
    let capture = CaptureSource::open(path, CaptureConfig::default()).unwrap();
    VelodyneScans::new(capture, config)
}

/// All scans of a capture, each held to the promise of `LidarScans`.
fn scans_with(path: &Path, config: VelodyneConfig) -> (Scans, VelodyneCounters) {
    let mut lidar = open(path, config);
    let (mut scans, mut promise) = (Vec::new(), ScanPromise::default());
    let mut points = Vec::new();
    while let Some(header) = lidar.read_scan(&mut points, NEVER).unwrap() {
        promise.check(&header, &points).unwrap();
        scans.push((header, points.clone()));
    }
    assert!(lidar.at_end());
    (scans, lidar.counters())
}

fn scans(path: &Path) -> (Scans, VelodyneCounters) {
    scans_with(path, VelodyneConfig::default())
}

fn drops(counters: &VelodyneCounters) -> Vec<(&'static str, u64)> {
    counters.dropped().filter(|(_, count)| *count > 0).collect()
}

fn azimuths_rise(points: &[Point]) -> bool {
    points.is_sorted_by(|a, b| a.azimuth_deg <= b.azimuth_deg)
}

#[test]
fn thirteen_wraps_give_twelve_whole_turns_and_two_partial_ones() {
    let Some(path) = recording("vlp16_single_13turns.pcap") else {
        return;
    };
    let (scans, counters) = scans(&path);
    assert_eq!((counters.packets, drops(&counters)), (1_000, vec![]));
    let kinds: Vec<_> = scans.iter().map(|(h, _)| h.completeness).collect();
    assert_eq!(kinds.len(), 14);
    assert_eq!(kinds[0], Completeness::PartialFirst);
    assert_eq!(kinds[13], Completeness::PartialLast);
    assert!(kinds[1..13].iter().all(|k| *k == Completeness::Complete));
    for (header, points) in &scans[1..13] {
        assert!(azimuths_rise(points));
        let duration_ms = header.end.secs_since(header.start) * 1e3;
        assert!(
            (98.0..102.0).contains(&duration_ms),
            "{duration_ms} ms at 600 rpm"
        );
    }
    // Every return of the file is in exactly one turn.
    let total: usize = scans.iter().map(|(_, points)| points.len()).sum();
    assert_eq!(total, returns_in(&path));
}

/// Returns in all data packets of a capture with Ethernet, IPv4 and UDP headers of 42 bytes.
fn returns_in(path: &Path) -> usize {
    let bytes = std::fs::read(path).unwrap();
    let mut at = 24;
    let mut returns = 0;
    while at < bytes.len() {
        let len = u32::from_le_bytes(bytes[at + 8..at + 12].try_into().unwrap()) as usize;
        let payload = &bytes[at + 16 + 42..at + 16 + len];
        for block in payload[..1200].chunks(100) {
            returns += block[4..].chunks(3).filter(|r| r[..2] != [0, 0]).count();
        }
        at += 16 + len;
    }
    returns
}

#[test]
fn turns_are_cut_at_any_angle() {
    let Some(path) = recording("vlp16_single_13turns.pcap") else {
        return;
    };
    for cut_angle_deg in [90.0, 180.0, 271.3] {
        let config = VelodyneConfig {
            cut_angle_deg,
            ..VelodyneConfig::default()
        };
        let (scans, _) = scans_with(&path, config);
        let whole: Vec<_> = scans
            .iter()
            .filter(|(h, _)| h.completeness == Completeness::Complete)
            .collect();
        assert!((12..=13).contains(&whole.len()));
        for (_, points) in whole {
            let past = |p: &Point| (p.azimuth_deg - cut_angle_deg).rem_euclid(360.0);
            assert!(points.is_sorted_by(|a, b| past(a) <= past(b) + 1e-3));
            assert!(past(&points[0]) < 1.0 && past(points.last().unwrap()) > 359.0);
        }
    }
}

#[test]
fn gps_state_comes_from_the_position_packets() {
    let Some(path) = recording("vlp16_gps.pcap") else {
        return;
    };
    let mut lidar = open(&path, VelodyneConfig::default());
    let (mut points, mut wraps) = (Vec::new(), 0);
    while lidar.read_scan(&mut points, NEVER).unwrap().is_some() {
        wraps += 1;
    }
    assert_eq!(wraps - 1, 4);
    let counters = lidar.counters();
    assert_eq!((counters.packets, counters.position_packets), (293, 57));
    let position = lidar.position().unwrap();
    assert_eq!(
        (position.pps, position.hour_us),
        (Pps::Locked, 1_082_726_090)
    );
    let sentence = position.sentence().unwrap().unwrap();
    assert!(matches!(sentence, Sentence::Rmc { valid: true, .. }));
    // 2016-01-21 08:18:02 UTC.
    assert_eq!(
        sentence.unix_time().unwrap().as_nanos(),
        1_453_364_282_000_000_000
    );
}

#[test]
fn a_locked_sensor_can_give_the_stamps() {
    let Some(path) = recording("vlp16_gps.pcap") else {
        return;
    };
    let config = VelodyneConfig {
        stamps: StampSource::SensorUtc,
        ..VelodyneConfig::default()
    };
    let first = |scans: &Scans| scans[0].0.start.as_nanos();
    let utc_ns = first(&scans_with(&path, config).0);
    let arrival_ns = first(&scans(&path).0);
    // The first packet's stamp is 1082.340595 s into 08:00 UTC; its first return is within the
    // packet. The computer that captured it was 0.37 s ahead.
    let packet_ns = 1_453_363_200_000_000_000 + 1_082_340_595_000;
    assert!(
        (0..1_400_000).contains(&(utc_ns - packet_ns)),
        "{}",
        utc_ns - packet_ns
    );
    let ahead_ms = (arrival_ns - utc_ns) / 1_000_000;
    assert!((360..370).contains(&ahead_ms), "{ahead_ms}");
}

#[test]
fn stamps_agree_with_the_clock_of_an_exact_simulation() {
    let Some(path) = recording("office_35s.pcap") else {
        return;
    };
    let (scans, counters) = scans(&path);
    assert_eq!((counters.packets, drops(&counters)), (24_270, vec![]));
    // The first packet's stamp is 0 µs past the hour; packets are captured 1.4 ms after their
    // first firing, and that clock is exact.
    let first_capture_ns = 1_700_000_000_001_400_000_i64;
    let sensor_to_unix_ns = first_capture_ns - 1_400_000 - first_sensor_ns(&path);
    for (header, _) in &scans {
        let sensor_ns = header.sensor_start_ns.unwrap() as i64;
        let error_us = (header.start.as_nanos() - sensor_ns - sensor_to_unix_ns) / 1_000;
        assert!(error_us.abs() < 200, "{error_us} µs");
    }
    assert_eq!(scans.len(), 323);
    assert_eq!(scans[0].0.completeness, Completeness::Complete);
}

fn first_sensor_ns(path: &Path) -> i64 {
    let bytes = std::fs::read(path).unwrap();
    let at = 24 + 16 + 42 + 1200;
    i64::from(u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())) * 1_000
}

/// A point of the other decoder's cloud.
struct Expected {
    position: [f32; 3],
    intensity: f32,
    ring: u16,
    azimuth_deg: f32,
    range_m: f32,
    time_s: f64,
}

/// Reads the binary clouds that lie beside the recording: x y z intensity (f32), ring (u16),
/// azimuth in 0.01°, distance (f32), return type (u8), time (f64), packed.
fn read_pcd(path: &Path) -> Vec<Expected> {
    const STRIDE: usize = 35;
    let bytes = std::fs::read(path).unwrap();
    let marker = b"DATA binary\n";
    let data = bytes
        .windows(marker.len())
        .position(|w| w == marker)
        .unwrap()
        + marker.len();
    let float =
        |record: &[u8], at: usize| f32::from_le_bytes(record[at..at + 4].try_into().unwrap());
    bytes[data..]
        .chunks_exact(STRIDE)
        .map(|record| Expected {
            position: [float(record, 0), float(record, 4), float(record, 8)],
            intensity: float(record, 12),
            ring: u16::from_le_bytes([record[16], record[17]]),
            azimuth_deg: float(record, 18) / 100.0,
            range_m: float(record, 22),
            time_s: f64::from_le_bytes(record[27..35].try_into().unwrap()),
        })
        .collect()
}

/// Difference of two azimuths by the shorter way, degrees.
fn apart_deg(a: f32, b: f32) -> f32 {
    let difference = (a - b).rem_euclid(360.0);
    difference.min(360.0 - difference)
}

/// An echo of ours with what the other decoder would make of it.
struct Shot {
    ours: Point,
    theirs: Point,
    rule: Rule,
    packet: Stamp,
}

/// How the other decoder comes to an azimuth. Ours is always interpolated.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    Interpolated,
    /// The last of a packet's six pairs of blocks has no next azimuth to turn to: all its shots get
    /// that of the block.
    LastPair,
    /// The second block of the other pairs (a second echo of the same shots) gets that of the next.
    SecondEcho,
}

/// Every echo of a dual-return capture, by ring and distance count.
fn shots_of(path: &Path) -> HashMap<(u16, u32), Vec<Shot>> {
    // Dual mode: six pairs of blocks, one every 110.592 us (VLP-16 manual, section 9.4).
    const PAIR_NS: u32 = 110_592;
    let mut capture = CaptureSource::open(path, CaptureConfig::default()).unwrap();
    let decoder = Decoder::new(DecoderConfig::default());
    let (mut bytes, mut batch) = (vec![0; 2048], PointBatch::new());
    let mut shots: HashMap<_, Vec<Shot>> = HashMap::new();
    while !capture.at_end() {
        let Some(received) = capture.receive(&mut bytes, NEVER).unwrap() else {
            continue;
        };
        let payload = &bytes[..received.len];
        decoder.decode(payload, 0, &mut batch).unwrap();
        let azimuth_deg = |pair: usize| {
            let at = 200 * pair + 2;
            f32::from(u16::from_le_bytes([payload[at], payload[at + 1]])) / 100.0
        };
        let mut before = None;
        for point in batch.as_slice() {
            let pair = (point.time_offset_ns / PAIR_NS) as usize;
            let is_second = before.replace(point.time_offset_ns) == Some(point.time_offset_ns)
                || point.returned == ReturnKind::Strongest;
            let (theirs, rule) = match (pair, is_second) {
                (5, _) => (turned_to(point, azimuth_deg(5)), Rule::LastPair),
                (_, true) => (turned_to(point, azimuth_deg(pair + 1)), Rule::SecondEcho),
                (_, false) => (*point, Rule::Interpolated),
            };
            let count = (point.range_m * 500.0).round() as u32;
            shots.entry((point.ring, count)).or_default().push(Shot {
                ours: *point,
                theirs,
                rule,
                packet: received.stamp,
            });
        }
    }
    shots
}

/// The point at another azimuth, which grows clockwise.
fn turned_to(point: &Point, azimuth_deg: f32) -> Point {
    let (sin, cos) = (point.azimuth_deg - azimuth_deg).to_radians().sin_cos();
    Point {
        x: cos * point.x - sin * point.y,
        y: sin * point.x + cos * point.y,
        azimuth_deg,
        ..*point
    }
}

#[test]
fn another_decoders_dual_return_clouds_are_found_point_by_point() {
    let Some(path) = recording("vlp16_dual_8scans.pcap") else {
        return;
    };
    let (_, counters) = scans(&path);
    assert_eq!((counters.packets, drops(&counters)), (1_206, vec![]));
    let shots = shots_of(&path);
    let clouds = std::fs::read_dir(path.with_file_name("vlp16_dual_expected")).unwrap();
    let mut compared = 0;
    for cloud in clouds {
        let expected = read_pcd(&cloud.unwrap().path());
        let share = |fits: &dyn Fn(&Expected, &Shot) -> bool| {
            let found = expected.iter().filter(|e| is_among(e, &shots, fits));
            found.count() as f64 / expected.len() as f64
        };
        let by_rule = |rule| share(&|e, shot| shot.rule == rule && is_same(e, &shot.theirs, 0.02));
        let ours = share(&|e, shot| is_same(e, &shot.ours, 0.17));
        // What the rotor turns on by while a pair is fired.
        let but_last = share(&|e, shot| {
            let limit_deg = match shot.rule {
                Rule::LastPair => 0.4,
                _ => 0.17,
            };
            is_same(e, &shot.ours, limit_deg)
        });
        let theirs = share(&|e, shot| is_same(e, &shot.theirs, 0.02));
        eprintln!(
            "{ours:.4} of their points within 0.17 degrees, {but_last:.4} if those of the last \
             pair ({:.4}) may be a block off; {theirs:.4} within 0.02 degrees by their own rules, of \
             which {:.4} are second echoes",
            by_rule(Rule::LastPair),
            by_rule(Rule::SecondEcho),
        );
        // Two habits of that decoder are the whole difference, and most of it is the last pair's.
        assert!(ours >= 0.9, "{ours}");
        assert!(but_last >= 0.99, "{but_last}");
        assert!(theirs >= 0.999, "{theirs}");
        compared += 1;
    }
    assert_eq!(compared, 3);
}

/// Whether one of the echoes with the ring and distance (to one count) of a point, taken at about
/// its time, fits it.
fn is_among(
    expected: &Expected,
    shots: &HashMap<(u16, u32), Vec<Shot>>,
    fits: &dyn Fn(&Expected, &Shot) -> bool,
) -> bool {
    let count = (expected.range_m * 500.0).round() as u32;
    let candidates = (count - 1..=count + 1).filter_map(|c| shots.get(&(expected.ring, c)));
    candidates.flatten().any(|shot| {
        // Their times run up to twelve blocks on within a packet, ours six.
        let late_s = expected.time_s - shot.packet.as_nanos() as f64 * 1e-9;
        late_s.abs() < 0.003 && fits(expected, shot)
    })
}

/// Whether intensity (to one step), azimuth and position agree.
fn is_same(expected: &Expected, point: &Point, limit_deg: f32) -> bool {
    let steps = (point.intensity - expected.intensity).abs();
    let apart_m = point
        .position()
        .iter()
        .zip(expected.position)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f32>()
        .sqrt();
    // The azimuths' difference moves a point by as much of its range; 3 mm are for the distance
    // count and the rounding of their azimuth.
    let limit_m = point.range_m * limit_deg.to_radians() + 0.003;
    let azimuth_fits = apart_deg(point.azimuth_deg, expected.azimuth_deg) <= limit_deg;
    steps <= 1.0 && azimuth_fits && apart_m <= limit_m
}

#[test]
fn dual_returns_of_a_real_sensor_are_labelled() {
    let Some(path) = recording("vlp16_dual_8scans.pcap") else {
        return;
    };
    let (scans, _) = scans(&path);
    let mut kinds: HashMap<ReturnKind, usize> = HashMap::new();
    for point in scans.iter().flat_map(|(_, points)| points) {
        *kinds.entry(point.returned).or_default() += 1;
    }
    let count = |kind| kinds.get(&kind).copied().unwrap_or(0);
    // Nearly every shot of a room has one echo.
    let one_echo = count(ReturnKind::StrongestAndLast);
    let total: usize = kinds.values().sum();
    assert!(one_echo * 100 > total * 95, "{kinds:?}");
    assert!(
        count(ReturnKind::Last) > 0 && count(ReturnKind::SecondStrongest) > 0,
        "{kinds:?}"
    );
    assert_eq!(count(ReturnKind::Unknown), 0);
}

#[test]
fn recordings_of_other_sensors_are_refused_with_the_reason() {
    let cases = [
        ("odd/velodyne_vlp16.pcap", "wrong_product", 84),
        ("odd/velodyne_vlp32.pcap", "wrong_product", 91),
        ("odd/hdl32_example.pcap", "wrong_product", 876),
        ("odd/sample_velodyne_hdl32.pcap", "wrong_product", 500),
        ("odd/VLI-16-one-packet.pcap", "wrong_size", 1),
    ];
    for (name, reason, count) in cases {
        let Some(path) = recording(name) else { return };
        let (scans, counters) = scans(&path);
        assert!(scans.is_empty(), "{name}");
        assert_eq!(drops(&counters), [(reason, count)], "{name}");
    }
    let Some(empty) = recording("odd/empty_pcap.pcap") else {
        return;
    };
    let (scans, counters) = scans(&empty);
    assert!(scans.is_empty() && drops(&counters).is_empty());
}

#[test]
fn an_old_recording_that_says_it_is_a_vlp16_is_decoded() {
    let Some(path) = recording("odd/velodyne_example.pcap") else {
        return;
    };
    let config = VelodyneConfig {
        decoder: DecoderConfig {
            vertical_correction: true,
            ..DecoderConfig::default()
        },
        ..VelodyneConfig::default()
    };
    let (scans, counters) = scans_with(&path, config);
    assert_eq!((counters.packets, drops(&counters)), (84, vec![]));
    // 84 packets are 111 ms: one wrap.
    assert_eq!(scans.len(), 2);
}
