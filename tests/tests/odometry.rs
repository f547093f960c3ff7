//! Odometry on the simulated robot, whose every pose is known.
#![allow(clippy::print_stderr, reason = "figures of a failed test")]

use hachi_cloud::{FilterConfig, Filters, ScanFrames};
use hachi_hal::{OdometrySample, Pose, Stamp};
use hachi_odometry::{Condition, Doubt, Estimate, Odometry, OdometryConfig, ScanInput};
use hachi_tests::{SimulatedScans, error};
use hachi_world::trajectory::{Gait, TrajectoryBuilder};
use hachi_world::{Preset, SimulationConfig};

/// What a walk through a simulated building came to.
struct Walk {
    truth: Vec<Pose>,
    estimates: Vec<Estimate>,
}

impl Walk {
    fn run(world: &SimulationConfig, config: OdometryConfig, with_legs: bool) -> Self {
        Self::seen_through(FilterConfig::default(), world, config, with_legs)
    }

    fn seen_through(
        filters: FilterConfig,
        world: &SimulationConfig,
        config: OdometryConfig,
        with_legs: bool,
    ) -> Self {
        let mut scans = SimulatedScans::new(world.clone());
        let mut filters = Filters::new(filters).unwrap();
        let mut odometry = Odometry::new(config);
        let mut legs = world.odometry();
        let mut samples: Vec<OdometrySample> = Vec::new();
        let mut kept = Vec::new();
        let (mut truth, mut estimates) = (Vec::new(), Vec::new());
        while let Some(header) = scans.next_scan() {
            filters.step(&scans.points, &ScanFrames::default(), &mut kept);
            if with_legs {
                while let Some(sample) = legs.next_until(header.end + 20_000_000) {
                    samples.push(sample);
                }
            }
            let input = ScanInput {
                odometry: &samples,
                ..ScanInput::new(&header, &kept)
            };
            estimates.push(odometry.step(&input));
            truth.push(world.map_from_lidar(header.end));
        }
        Self { truth, estimates }
    }

    fn errors(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let first = (&self.truth[0], &self.estimates[0].odom_from_lidar);
        self.truth
            .iter()
            .zip(&self.estimates)
            .map(move |(t, e)| error(first, (t, &e.odom_from_lidar)))
    }

    fn worst_m(&self) -> f64 {
        self.errors().map(|e| e.0).fold(0.0, f64::max)
    }

    fn last_m(&self) -> f64 {
        self.errors().last().map_or(0.0, |e| e.0)
    }
}

#[test]
fn a_trotting_robot_is_followed_to_centimetres() {
    let world = SimulationConfig::preset(Preset::Office, 11, 20.0);
    let walk = Walk::run(&world, OdometryConfig::default(), false);
    assert!(walk.worst_m() < 0.15, "{}", walk.worst_m());
    assert!(walk.estimates.iter().all(|e| e.condition.is_ok()));
}

#[test]
fn a_robot_that_stands_in_a_doorway_stays_where_it_is() {
    let mut world = SimulationConfig::preset(Preset::Office, 1, 32.0);
    // The first place that it turns off to is inside a room.
    let [before, inside] = [1, 2].map(|i| world.trajectory.places()[i]);
    let way = [0, 1].map(|a| inside[a] - before[a]);
    let door = [0, 1].map(|a| before[a] + 1.6 * way[a] / way[0].hypot(way[1]));
    let start = [before[0] - 3.0, before[1]];
    let trajectory = TrajectoryBuilder::new(start, 0.0, Gait::quadruped())
        .walk(&[before, door])
        .stand(25.0)
        .walk(&[before, start])
        .turn_to(0.0)
        .build(world.scene.floor().clone());
    world.trajectory = trajectory.unwrap().into();
    let walk = Walk::run(&world, OdometryConfig::default(), false);

    let last = walk.truth.last().unwrap();
    let walks = |t: &&Pose| t.inv_mul(last).translation.vector.norm() > 1e-3;
    let stops = walk.truth.iter().take_while(walks).count();
    let stands = &walk.estimates[stops..];
    assert!(stands.len() > 200, "{stops}");
    let still = |e: &Estimate| stands[0].odom_from_lidar.inv_mul(&e.odom_from_lidar);
    let (mut moved_m, mut turned) = (0.0, 0.0);
    for motion in stands.iter().map(still) {
        moved_m = f64::max(moved_m, motion.translation.vector.norm());
        turned = f64::max(turned, motion.rotation.angle());
    }
    eprintln!(
        "stood for {} scans: moved {moved_m:.4} m, turned {turned:.4} rad",
        stands.len()
    );
    assert!(moved_m < 0.015, "{moved_m} m");
    assert!(turned < 0.01, "{turned} rad");
}

#[test]
fn a_hand_held_sensor_that_shakes_and_spins_is_followed() {
    let world = SimulationConfig::preset(Preset::Stress, 5, 20.0);
    let walk = Walk::run(&world, OdometryConfig::default(), false);
    assert!(walk.worst_m() < 0.5, "{}", walk.worst_m());
}

#[test]
fn two_scans_a_second_of_a_walking_robot_are_enough() {
    // Four of five scans are lost, while the robot walks and turns on the spot.
    let world = SimulationConfig::preset(Preset::Office, 6, 30.0);
    let mut scans = SimulatedScans::new(world.clone());
    let mut odometry = Odometry::new(OdometryConfig::default());
    let (mut first, mut worst, mut unsaid, mut index) = (None, 0.0f64, 0, 0);
    while let Some(header) = scans.next_scan() {
        index += 1;
        if index % 5 != 0 {
            continue;
        }
        let estimate = odometry.step(&ScanInput::new(&header, &scans.points));
        let truth = world.map_from_lidar(header.end);
        let (t, e) = *first.get_or_insert((truth, estimate.odom_from_lidar));
        let (metres, _) = error((&t, &e), (&truth, &estimate.odom_from_lidar));
        worst = worst.max(metres);
        unsaid += usize::from(metres > 0.5 && estimate.condition.is_ok());
    }
    assert_eq!(
        unsaid, 0,
        "poses half a metre off were called OK; worst {worst}"
    );
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn two_scans_a_second_of_a_shaken_sensor_are_followed_or_doubted() {
    // Between two scans a hand turns the sensor by tens of degrees, and no speed says whereto. A pose
    // called OK has to agree with the OK one before, unless the surroundings changed in between.
    for (seed, least_ok) in [(5, 0.8), (9, 0.8), (14, 0.0)] {
        let world = SimulationConfig::preset(Preset::Stress, seed, 30.0);
        let mut scans = SimulatedScans::new(world.clone());
        let mut odometry = Odometry::new(OdometryConfig::default());
        let (mut last, mut ok, mut count, mut index) = (None, 0, 0, 0);
        while let Some(header) = scans.next_scan() {
            index += 1;
            if index % 5 != 0 {
                continue;
            }
            let estimate = odometry.step(&ScanInput::new(&header, &scans.points));
            let now = (world.map_from_lidar(header.end), estimate.odom_from_lidar);
            count += 1;
            match estimate.condition {
                Condition::Ok => {
                    ok += 1;
                    if let Some((truth, found)) = last.replace(now) {
                        let (metres, _) = error((&truth, &found), (&now.0, &now.1));
                        assert!(
                            metres < 0.7,
                            "seed {seed}, scan {index}: {metres} m off, and OK"
                        );
                    }
                }
                Condition::Degraded(Doubt::NewPlace { .. }) | Condition::Lost(_) => last = None,
                Condition::Degraded(_) => {}
            }
        }
        let share = f64::from(ok) / f64::from(count);
        assert!(share >= least_ok, "seed {seed}: only {share} are OK");
    }
}

#[test]
fn a_long_corridor_is_held_along_its_axis_with_legs_and_without() {
    let world = SimulationConfig::preset(Preset::Corridor, 3, 30.0);
    for with_legs in [false, true] {
        let config = OdometryConfig {
            base_from_lidar: world.base_from_lidar,
            ..OdometryConfig::default()
        };
        let walk = Walk::run(&world, config, with_legs);
        assert!(walk.last_m() < 0.3, "legs {with_legs}: {}", walk.last_m());
    }
}

/// Between open lots a quarter of a turn sees little that would hold the sensor's tilt; bounds on
/// acceleration made for a trot let it lean there from one scan to the next.
#[test]
fn a_robot_on_wheels_in_the_open_does_not_lean() {
    let world = SimulationConfig::preset(Preset::CampusLong, 2, 25.0);
    let walk = Walk::run(&world, OdometryConfig::default(), false);
    assert!(walk.estimates.iter().all(|e| e.condition.is_ok()));
    let places: Vec<_> = walk.truth.iter().zip(&walk.estimates).collect();
    let turns = places.windows(2).map(|pair| {
        let [(before, guessed), (after, found)] = [pair[0], pair[1]];
        let first = (before, &guessed.odom_from_lidar);
        error(first, (after, &found.odom_from_lidar)).1
    });
    let squares: f64 = turns.map(|turn| turn * turn).sum();
    let mean = (squares / places.len() as f64).sqrt().to_degrees();
    assert!(mean < 0.35, "{mean} degrees from scan to scan");
}

/// Nothing within sight fixes the way along the corridor, for hundreds of scans on end: there the
/// legs have to carry the pose, and nothing may take back what they carried.
#[test]
fn a_corridor_whose_end_is_out_of_sight_is_held_by_the_legs() {
    let world = SimulationConfig::preset(Preset::Corridor, 3, 60.0);
    let near = FilterConfig {
        far_m: 12.0,
        ..FilterConfig::default()
    };
    let config = OdometryConfig {
        base_from_lidar: world.base_from_lidar,
        ..OdometryConfig::default()
    };
    let walk = Walk::seen_through(near, &world, config, true);
    assert!(walk.worst_m() < 0.3, "{}", walk.worst_m());
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let world = SimulationConfig::preset(Preset::Office, 2, 4.0);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| Walk::run(&world, OdometryConfig::default(), false).estimates)
    };
    let one = run(1);
    for threads in [2, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}

#[test]
fn a_scan_of_another_place_is_doubted_and_the_new_place_taken_up() {
    // The sensor is carried off with its eyes shut: from one building straight into another.
    let mut here = SimulatedScans::new(SimulationConfig::preset(Preset::Office, 1, 3.0));
    let mut odometry = Odometry::new(OdometryConfig::default());
    while let Some(header) = here.next_scan() {
        odometry.step(&ScanInput::new(&header, &here.points));
    }
    let mut there = SimulationConfig::preset(Preset::GlassCorridor, 4, 3.0);
    there.start = there.start + 3_000_000_000;
    let mut there = SimulatedScans::new(there);
    let mut conditions = Vec::new();
    while let Some(header) = there.next_scan() {
        conditions.push(
            odometry
                .step(&ScanInput::new(&header, &there.points))
                .condition,
        );
    }
    assert!(
        matches!(conditions[0], Condition::Degraded(_)),
        "{:?}",
        conditions[0]
    );
    let settled = conditions.iter().position(Condition::is_ok);
    assert!(
        settled.is_some_and(|i| (1..=8).contains(&i)),
        "{conditions:?}"
    );
}

#[test]
fn hostile_scans_are_survived_and_said() {
    use hachi_hal::{Point, ScanHeader};
    let header = |i: i64| ScanHeader {
        start: Stamp::from_nanos(i * 100_000_000),
        end: Stamp::from_nanos(i * 100_000_000 + 99_000_000),
        has_point_times: true,
        ..ScanHeader::default()
    };
    let nan = vec![
        Point {
            x: f32::NAN,
            ..Point::default()
        };
        5_000
    ];
    let infinite = vec![
        Point {
            z: f32::INFINITY,
            ..Point::default()
        };
        5_000
    ];
    let equal = vec![Point::at(1.0, 2.0, 3.0); 1_000_000];
    let huge = (0..5_000)
        .map(|i| Point::at(1e30 * i as f32, -1e35, 3.0))
        .collect::<Vec<_>>();
    let times = (0..5_000)
        .map(|i| Point {
            time_offset_ns: u32::MAX,
            ..Point::at(i as f32 * 0.01, 2.0, 1.0)
        })
        .collect::<Vec<_>>();
    for hostile in [&nan, &infinite, &Vec::new(), &equal, &huge, &times] {
        let mut odometry = Odometry::new(OdometryConfig::default());
        for i in 0..4 {
            let estimate = odometry.step(&ScanInput::new(&header(i), hostile));
            let pose = estimate.odom_from_lidar.to_homogeneous();
            assert!(pose.iter().all(|v| v.is_finite()), "{estimate:?}");
        }
    }
}
