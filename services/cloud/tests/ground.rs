//! The ground plane from a scan alone: known scenes, and a real car's scans.
#![allow(clippy::print_stderr, reason = "a skipped test says why")]

mod scene;

use hachi_cloud::{GroundFinder, GroundSource, GroundTracker, Reason};
use hachi_hal::{Point, Pose, Vector3};
use scene::{Finish, Scan, Scene, standing};

const WALL: Finish = Finish::Solid(60.0);
const FLOOR: Finish = Finish::Solid(5.0);

fn hall(floor: bool) -> Scene {
    let mut scene = Scene::default();
    if floor {
        scene.slab([-9.0, -6.0], [9.0, 6.0], 0.0, FLOOR);
    }
    scene
        .wall([-9.0, -6.0], [9.0, -6.0], -9.0, 4.0, WALL)
        .wall([-9.0, 6.0], [9.0, 6.0], -9.0, 4.0, WALL)
        .wall([9.0, -6.0], [9.0, 6.0], -9.0, 4.0, WALL)
        .wall([-9.0, -6.0], [-9.0, 6.0], -9.0, 4.0, WALL);
    scene
}

fn kept(scan: &Scan) -> Vec<Reason> {
    vec![Reason::Kept; scan.points.len()]
}

/// Angle between the planes in degrees, and difference of the sensor's height.
fn error(found: &Pose, truth: &Pose) -> (f64, f64) {
    let up = |pose: &Pose| pose.rotation.inverse() * Vector3::z();
    let angle = up(found).angle(&up(truth)).to_degrees();
    (angle, (found.translation.z - truth.translation.z).abs())
}

#[test]
fn the_floor_is_found_from_any_height_and_tilt_with_tables_about() {
    let mut scene = hall(true);
    scene
        .cuboid([2.0, -1.0], [4.0, 1.0], 0.0, 0.75, WALL)
        .cuboid([-5.0, 2.0], [-3.0, 4.0], 0.0, 0.4, WALL);
    for height in [0.3, 0.6, 1.2, 1.9] {
        for (roll, pitch) in [(0.0, 0.0), (8.0, -5.0), (0.0, 30.0), (-20.0, 20.0)] {
            let truth = standing(height, roll, pitch);
            let scan = scene.scan(truth, 16, 900);
            let plane = GroundFinder::default()
                .find(&scan.points, &kept(&scan), None)
                .unwrap_or_else(|why| panic!("{height} m, {roll}, {pitch}: {why}"));
            let (angle, offset) = error(&plane.footprint_from_lidar(), &truth);
            assert!(
                angle < 0.7 && offset < 0.03,
                "{height} m, {roll}, {pitch}: {angle:.2} degrees, {offset:.3} m off, {plane:?}"
            );
        }
    }
}

#[test]
fn on_a_ramp_the_ramp_is_the_ground() {
    // 8 degrees up along x, from x = -3 to 6, between walls.
    let slope = 8f64.to_radians();
    let mut scene = Scene::default();
    scene.rectangles.push(scene::Rectangle {
        corner: Vector3::new(-3.0 * slope.cos(), -2.0, -3.0 * slope.sin()),
        u: Vector3::new(9.0 * slope.cos(), 0.0, 9.0 * slope.sin()),
        v: Vector3::new(0.0, 4.0, 0.0),
        finish: FLOOR,
    });
    scene
        .slab(
            [-12.0, -2.0],
            [-3.0 * slope.cos(), 2.0],
            -3.0 * slope.sin(),
            FLOOR,
        )
        .wall([-12.0, -2.0], [10.0, -2.0], -2.0, 4.0, WALL)
        .wall([-12.0, 2.0], [10.0, 2.0], -2.0, 4.0, WALL);
    // The robot stands on the ramp and leans with it: in its own frame the ramp is level.
    let mut sensor = standing(0.0, 0.0, -8.0);
    sensor.translation.vector = sensor.rotation * Vector3::new(0.0, 0.0, 0.6);
    let scan = scene.scan(sensor, 16, 900);
    let plane = GroundFinder::default()
        .find(&scan.points, &kept(&scan), None)
        .expect("the ramp");
    let (angle, offset) = error(&plane.footprint_from_lidar(), &standing(0.6, 0.0, 0.0));
    assert!(angle < 1.0 && offset < 0.03, "{angle} {offset}");
}

#[test]
fn no_ground_in_sight_is_said() {
    for (roll, pitch) in [(0.0, 0.0), (10.0, 5.0)] {
        let scan = hall(false).scan(standing(0.6, roll, pitch), 16, 900);
        let found = GroundFinder::default().find(&scan.points, &kept(&scan), None);
        assert!(found.is_err(), "{found:?}");
    }
    assert!(GroundFinder::default().find(&[], &[], None).is_err());
    let same = vec![Point::at(1.0, 1.0, -1.0); 1000];
    assert!(
        GroundFinder::default()
            .find(&same, &[Reason::Kept; 1000], None)
            .is_err()
    );
}

#[test]
fn the_tracker_carries_the_ground_for_two_seconds_and_then_admits_it() {
    let truth = standing(0.6, 3.0, 4.0);
    let (with, without) = (
        hall(true).scan(truth, 16, 900),
        hall(false).scan(truth, 16, 900),
    );
    let mut tracker = GroundTracker::default();
    let unknown = tracker.step(&without.points, &kept(&without));
    assert!(unknown.footprint_from_lidar.is_none());
    assert!(matches!(unknown.source, GroundSource::Unknown { .. }));
    let seen = tracker.step(&with.points, &kept(&with));
    assert!(matches!(seen.source, GroundSource::Seen { confidence } if confidence > 0.5));
    for scans in 1..=hachi_cloud::ground_tracker::MAX_CARRIED {
        let carried = tracker.step(&without.points, &kept(&without));
        assert_eq!(carried.footprint_from_lidar, seen.footprint_from_lidar);
        assert!(
            matches!(carried.source, GroundSource::Carried { scans: s, because: Some(_) } if s == scans)
        );
    }
    let lost = tracker.step(&without.points, &kept(&without));
    assert!(lost.footprint_from_lidar.is_none());
}

#[test]
fn one_scan_with_another_floor_does_not_move_the_ground_but_two_do() {
    let scene = hall(true);
    let low = scene.scan(standing(0.4, 0.0, 0.0), 16, 900);
    let high = scene.scan(standing(1.2, 0.0, 0.0), 16, 900);
    let mut tracker = GroundTracker::default();
    let height = |tracker: &mut GroundTracker, scan: &Scan| {
        let estimate = tracker.step(&scan.points, &kept(scan));
        estimate
            .footprint_from_lidar
            .map(|pose| pose.translation.z)
            .expect("known")
    };
    assert!((height(&mut tracker, &low) - 0.4).abs() < 0.02);
    assert!((height(&mut tracker, &high) - 0.4).abs() < 0.02);
    assert!((height(&mut tracker, &low) - 0.4).abs() < 0.02);
    height(&mut tracker, &high);
    assert!((height(&mut tracker, &high) - 1.2).abs() < 0.02);
}

/// float32 x y z intensity (0 to 1).
fn read_bin(path: &std::path::Path) -> Vec<Point> {
    let bytes = std::fs::read(path).expect("a scan of the data folder");
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    bytes
        .chunks_exact(16)
        .map(|b| Point {
            intensity: number(&b[12..]) * 255.0,
            ..Point::at(number(b), number(&b[4..]), number(&b[8..]))
        })
        .collect()
}

#[test]
fn the_road_lies_1_73_m_below_the_lidar_of_the_kitti_car() {
    let Some(data) = std::env::var_os("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA is not set");
        return;
    };
    let mut tracker = GroundTracker::default();
    for frame in 0..12 {
        let file = format!("scans/kitti00_first12/{frame:06}.bin");
        let points = read_bin(&std::path::Path::new(&data).join(file));
        let labels = vec![Reason::Kept; points.len()];
        let estimate = tracker.step(&points, &labels);
        let pose = estimate.footprint_from_lidar.expect("a road");
        // The data set's sensor setup gives 1.73 m. The street is cambered: the median heights of
        // the returns 3 m to the right and to the left differ by 0.17 m, 1.6 degrees.
        let (angle, offset) = error(&pose, &standing(1.73, 0.0, 0.0));
        assert!(
            angle < 3.0 && offset < 0.08,
            "{frame}: {angle} degrees, {offset} m, {estimate:?}"
        );
    }
}
