//! All filters together.

mod scene;

use hachi_cloud::{
    BodyBox, FilterConfig, Filters, GroundSource, GroundUse, IntensityMode, IntensityUse, Reason,
    ScanFrames,
};
use hachi_hal::{Point, Pose};
use nalgebra::Point3;
use scene::{Finish, Scan, Scene, Truth, standing};

const WALL: Finish = Finish::Solid(60.0);
const DARK_FLOOR: Finish = Finish::Solid(4.0);
const BLACK: Finish = Finish::Solid(3.0);

/// A corridor, glass on the left, dark floor, a black box, a box around the robot's rear.
fn corridor() -> Scene {
    let mut scene = Scene::default();
    let pane = Finish::Glass {
        dust: 0.05,
        clear: false,
    };
    scene
        .slab([-10.0, -1.2], [10.0, 1.2], 0.0, DARK_FLOOR)
        .wall([-10.0, -1.2], [10.0, -1.2], 0.0, 2.7, WALL)
        .wall([10.0, -1.2], [10.0, 1.2], 0.0, 2.7, WALL)
        .wall([-10.0, -1.2], [-10.0, 1.2], 0.0, 2.7, WALL)
        .wall([-10.0, 1.2], [10.0, 1.2], 0.0, 2.7, pane)
        .cuboid([3.0, -0.3], [3.4, 0.2], 0.0, 0.6, BLACK)
        .cuboid([-0.9, -0.2], [-0.6, 0.2], 0.0, 0.55, WALL);
    scene
}

fn filters(change: impl FnOnce(&mut FilterConfig)) -> Filters {
    let mut config = FilterConfig {
        body: vec![BodyBox {
            min_m: [-1.0, -0.25, -0.7],
            max_m: [0.3, 0.25, 0.0],
        }],
        ..FilterConfig::default()
    };
    change(&mut config);
    Filters::new(config).expect("a config that works")
}

fn given(scan: &Scan) -> ScanFrames {
    ScanFrames {
        footprint_from_lidar: Some(scan.footprint_from_lidar),
        // The base has the footprint's attitude and the sensor's place.
        base_from_lidar: Pose::from_parts(Default::default(), scan.footprint_from_lidar.rotation),
    }
}

/// Labels of the real points in a region of the footprint frame.
fn labels_where(
    scan: &Scan,
    labels: &[Reason],
    region: impl Fn(Point3<f64>) -> bool,
) -> Vec<Reason> {
    (scan.points.iter().zip(&scan.truth).zip(labels))
        .filter(|((p, truth), _)| {
            let p = scan.footprint_from_lidar * Point3::new(p.x, p.y, p.z).cast();
            **truth == Truth::Real && region(p)
        })
        .map(|(_, label)| *label)
        .collect()
}

fn share(labels: &[Reason], wanted: Reason) -> f64 {
    assert!(labels.len() > 40, "only {} points", labels.len());
    labels.iter().filter(|l| **l == wanted).count() as f64 / labels.len() as f64
}

#[test]
fn each_kind_of_point_gets_its_reason_on_a_body_tilted_fifteen_degrees() {
    for (roll, pitch) in [(0.0, 0.0), (15.0, 0.0), (-5.0, 15.0)] {
        let mut scan = corridor().scan(standing(0.6, roll, pitch), 16, 1800);
        scan.points[0].x = f32::NAN;
        let mut filters = filters(|_| ());
        let mut kept = Vec::new();
        let done = filters.step(&scan.points, &given(&scan), &mut kept);
        let labels = filters.labels();
        assert_eq!(labels.len(), scan.points.len());
        assert_eq!(labels[0], Reason::NonFinite);
        assert_eq!(done.counts.kept() as usize, kept.len());
        assert_eq!(
            done.counts.kept() + done.counts.removed(),
            labels.len() as u64
        );
        assert_eq!(
            (done.ground, done.intensity),
            (GroundUse::Given, IntensityUse::Ran)
        );
        let floor = labels_where(&scan, labels, |p| p.z < 0.02 && p.x.abs() < 9.0);
        assert!(
            share(&floor, Reason::Kept) > 0.95,
            "floor, tilt {roll} {pitch}"
        );
        let black = labels_where(&scan, labels, |p| {
            (2.9..3.1).contains(&p.x) && p.y.abs() < 0.25 && (0.1..0.6).contains(&p.z)
        });
        assert!(
            share(&black, Reason::Suspect) > 0.95,
            "black box, tilt {roll} {pitch}"
        );
        let rear = labels_where(&scan, labels, |p| {
            (-0.95..-0.55).contains(&p.x) && p.y.abs() < 0.22 && (0.1..0.58).contains(&p.z)
        });
        // Pitched up behind, the sensor looks over it.
        assert!(
            pitch > 10.0 || share(&rear, Reason::SelfHit) > 0.95,
            "rear, tilt {roll} {pitch}"
        );
        let wall = labels_where(&scan, labels, |p| p.y < -1.1 && p.z > 0.1);
        assert!(
            share(&wall, Reason::Kept) > 0.97,
            "wall, tilt {roll} {pitch}"
        );
        assert!(
            scan.share(labels, Truth::Ghost, Reason::Kept) < 0.06,
            "ghosts left, tilt {roll} {pitch}"
        );
        assert!(scan.share(labels, Truth::Glass, Reason::Kept) < 0.1);
    }
}

#[test]
fn plain_intensity_takes_the_floor_and_naive_and_normal_leave_it() {
    let scan = corridor().scan(standing(0.6, 3.0, 8.0), 16, 1800);
    let floor_kept = |mode: IntensityMode| {
        let mut filters = filters(|c| c.intensity = mode);
        filters.step(&scan.points, &given(&scan), &mut Vec::new());
        let near = labels_where(&scan, filters.labels(), |p| {
            p.z < 0.02 && p.x.abs() < 4.0 && p.y.abs() < 0.8
        });
        share(&near, Reason::Kept)
    };
    assert!(floor_kept(IntensityMode::Intensity) < 0.01);
    assert!(floor_kept(IntensityMode::Naive) > 0.95);
    assert!(floor_kept(IntensityMode::Normal) > 0.85);
    assert!(floor_kept(IntensityMode::None) > 0.95);
}

#[test]
fn with_no_platform_the_ground_is_found_in_the_scan() {
    let scan = corridor().scan(standing(0.6, 5.0, -6.0), 16, 1800);
    let mut filters = filters(|c| c.body.clear());
    let done = filters.step(&scan.points, &ScanFrames::default(), &mut Vec::new());
    assert!(
        matches!(done.ground, GroundUse::Found(GroundSource::Seen { .. })),
        "{done:?}"
    );
    let found = done.footprint_from_lidar.expect("seen");
    assert!((found.translation.z - 0.6).abs() < 0.03, "{found}");
    let floor = labels_where(&scan, filters.labels(), |p| p.z < 0.02 && p.x.abs() < 6.0);
    assert!(share(&floor, Reason::Kept) > 0.9);
}

#[test]
fn a_source_without_intensities_keeps_its_points() {
    let mut scan = corridor().scan(standing(0.6, 0.0, 0.0), 16, 900);
    for point in &mut scan.points {
        point.intensity = 0.0;
    }
    for mode in [
        IntensityMode::Intensity,
        IntensityMode::Naive,
        IntensityMode::Normal,
    ] {
        let mut filters = filters(|c| c.intensity = mode);
        let done = filters.step(&scan.points, &given(&scan), &mut Vec::new());
        assert_eq!(done.intensity, IntensityUse::NoSignal);
        assert_eq!(done.counts.get(Reason::Suspect), 0);
    }
}

#[test]
fn without_ground_the_naive_filter_removes_nothing_and_says_so() {
    let mut scene = Scene::default();
    scene.wall([-5.0, 3.0], [5.0, 3.0], -5.0, 5.0, WALL).wall(
        [-5.0, -3.0],
        [5.0, -3.0],
        -5.0,
        5.0,
        BLACK,
    );
    let scan = scene.scan(standing(0.6, 0.0, 0.0), 16, 900);
    let mut filters = filters(|_| ());
    let done = filters.step(&scan.points, &ScanFrames::default(), &mut Vec::new());
    assert_eq!(done.intensity, IntensityUse::NoGround);
    assert_eq!(done.footprint_from_lidar, None);
    assert_eq!(done.counts.get(Reason::Suspect), 0);
}

#[test]
fn switched_off_filters_remove_nothing_and_the_same_scan_gives_the_same_labels() {
    let scan = corridor().scan(standing(0.6, 2.0, 2.0), 16, 1800);
    let mut off = filters(|c| {
        (c.outliers, c.ghosts, c.intensity) = (false, false, IntensityMode::None);
        c.body.clear();
    });
    let mut kept = Vec::new();
    let done = off.step(&scan.points, &given(&scan), &mut kept);
    assert_eq!(
        (done.counts.removed(), done.ground),
        (0, GroundUse::NotNeeded)
    );
    assert_eq!(kept, scan.points);
    let (mut one, mut two) = (filters(|_| ()), filters(|_| ()));
    one.step(&scan.points, &given(&scan), &mut kept);
    two.step(
        &corridor().scan(standing(0.6, 0.0, 0.0), 16, 300).points,
        &given(&scan),
        &mut kept,
    );
    two.step(&scan.points, &given(&scan), &mut kept);
    assert_eq!(one.labels(), two.labels());
}

#[test]
fn an_empty_scan_and_a_million_equal_points_pass_through() {
    let mut filters = filters(|_| ());
    let mut kept = vec![Point::default()];
    let done = filters.step(&[], &ScanFrames::default(), &mut kept);
    assert_eq!((kept.len(), done.counts.removed()), (0, 0));
    let same = vec![
        Point {
            intensity: 60.0,
            ..Point::at(3.0, 1.0, 0.5)
        };
        1_000_000
    ];
    filters.step(&same, &ScanFrames::default(), &mut kept);
    assert_eq!(kept.len(), same.len());
}

#[cfg(feature = "serde")]
#[test]
fn a_config_names_modes_in_small_letters_and_refuses_unknown_keys() {
    let config: FilterConfig = serde_json::from_str(
        r#"{"intensity": "normal", "ghosts": false, "reject": {"low": 0, "high": 10}}"#,
    )
    .expect("known keys");
    assert_eq!(config.intensity, IntensityMode::Normal);
    assert!(!config.ghosts && !config.outliers);
    let wrong = serde_json::from_str::<FilterConfig>(r#"{"ghost": false}"#);
    assert!(
        wrong
            .expect_err("unknown")
            .to_string()
            .contains("unknown field `ghost`")
    );
}
