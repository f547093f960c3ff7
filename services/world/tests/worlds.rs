//! The worlds that SLAM is measured on: how far the patrols go, where they come back, how fast,
//! and that what is reported lies on what stands there.

#[allow(
    dead_code,
    reason = "the decoder is shared with tests of other sensors"
)]
mod decoder;

use hachi_hal::{Stamp, Vector3};
use hachi_world::{
    Direction, Floor, Gait, LoopPass, LoopSearch, NoiseConfig, Preset, ReturnLabel, ReturnTruth,
    SceneBuilder, SensorKind, Simulation, SimulationConfig, TrajectoryBuilder, TrueLoops, World,
};

/// One round of a preset's patrol.
fn round(preset: Preset, seed: u64) -> SimulationConfig {
    let mut config = SimulationConfig::preset(preset, seed, 0.0);
    config.duration_s = config.trajectory.period_s();
    config
}

/// Loops of a length, by direction.
fn count(loops: &TrueLoops, direction: Direction, least_m: f64) -> usize {
    let long = |pass: &&LoopPass| pass.direction() == direction && pass.length_m() >= least_m;
    loops.passes.iter().filter(long).count()
}

#[test]
fn a_campus_patrol_is_over_2_km_and_closes_loops_in_both_directions() {
    for seed in 0..6 {
        let loops = round(Preset::Campus, seed).true_loops(&LoopSearch::default());
        assert!((2200.0..2800.0).contains(&loops.way_m), "{}", loops.way_m);
        let [same, across, opposite] = [Direction::Same, Direction::Across, Direction::Opposite]
            .map(|direction| {
                let least_m = if direction == Direction::Across {
                    0.0
                } else {
                    50.0
                };
                count(&loops, direction, least_m)
            });
        assert!(
            same >= 3 && across >= 1 && opposite >= 4,
            "{seed}: {same} {across} {opposite}"
        );
    }
}

#[test]
fn a_building_patrol_is_over_250_m_in_five_minutes_and_closes_loops_in_both_directions() {
    for seed in 0..12 {
        let mut config = round(Preset::Building, seed);
        let round = config.true_loops(&LoopSearch::default());
        assert!(round.way_m > 300.0, "{}", round.way_m);
        config.duration_s = 300.0;
        let search = LoopSearch {
            radius_m: 2.0,
            ..LoopSearch::default()
        };
        let loops = config.true_loops(&search);
        assert!((250.0..300.0).contains(&loops.way_m), "{}", loops.way_m);
        let [same, opposite] =
            [Direction::Same, Direction::Opposite].map(|direction| count(&loops, direction, 8.0));
        assert!(same >= 2 && opposite >= 2, "{seed}: {same} {opposite}");
    }
}

#[test]
fn the_long_patrol_is_20_km_and_keeps_seeing_new_streets() {
    let config = round(Preset::CampusLong, 1);
    let search = LoopSearch {
        radius_m: 3.0,
        step_m: 5.0,
        ..LoopSearch::default()
    };
    let loops = config.true_loops(&search);
    assert!(
        (20_000.0..21_500.0).contains(&loops.way_m),
        "{}",
        loops.way_m
    );
    // Ten metres of street at a time: how much of each quarter of the way was not seen before.
    let mut known = std::collections::BTreeSet::new();
    let mut fresh = [0; 4];
    let steps = 20_000;
    for step in 0..steps {
        let time_s = config.duration_s * f64::from(step) / f64::from(steps);
        let place = config
            .trajectory
            .map_from_footprint(time_s)
            .translation
            .vector;
        if known.insert([place.x, place.y].map(|x| (x / 10.0).round() as i64)) {
            fresh[(4 * step / steps) as usize] += 1;
        }
    }
    let all: i32 = fresh.iter().sum();
    assert!(all > 1000, "{fresh:?}");
    assert!(
        fresh[1] > fresh[0] / 2 && fresh[2] > fresh[0] / 5,
        "{fresh:?}"
    );
}

#[test]
fn robots_keep_to_their_speed_and_turn_no_faster_than_they_can() {
    for (preset, speed, turn) in [
        (Preset::Building, 1.0, 1.4),
        (Preset::Campus, 2.0, 1.5),
        (Preset::CampusLong, 4.0, 0.9),
    ] {
        let world = preset.world(2);
        let (mut fastest, mut quickest) = (0.0f64, 0.0f64);
        let mut time_s = 0.0;
        let mut last = world.trajectory.map_from_footprint(0.0);
        while time_s < world.trajectory.period_s() {
            time_s += 0.05;
            let now = world.trajectory.map_from_footprint(time_s);
            let moved = (now.translation.vector - last.translation.vector).norm();
            fastest = fastest.max(moved / 0.05);
            let [before, after] =
                [last, now].map(|pose| (pose.rotation * Vector3::x()).xy().normalize());
            quickest = quickest.max(before.perp(&after).asin().abs() / 0.05);
            last = now;
        }
        assert!(
            (0.98 * speed..1.02 * speed).contains(&fastest),
            "{preset:?}: {fastest} m/s"
        );
        assert!(quickest < turn, "{preset:?}: {quickest} rad/s");
    }
}

#[test]
fn loops_of_a_way_worked_out_by_hand_are_found() {
    // Out 100 m and back after turning, then 20 m aside and back: from the start 240 m.
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::quadruped())
        .walk(&[[100.0, 0.0]])
        .turn(std::f64::consts::PI)
        .walk(&[[0.0, 0.0]])
        .walk(&[[0.0, 20.0]])
        .turn(std::f64::consts::PI)
        .walk(&[[0.0, 0.0]])
        .turn_to(0.0)
        .build(Floor::default())
        .unwrap();
    let scene = SceneBuilder::new().build();
    let mut config = SimulationConfig::new(World { scene, trajectory }, 1, 0.0);
    config.duration_s = config.trajectory.period_s();
    let search = LoopSearch {
        radius_m: 2.0,
        least_way_m: 60.0,
        step_m: 0.5,
    };
    let loops = config.true_loops(&search);
    assert!((loops.way_m - 240.0).abs() < 0.1, "{}", loops.way_m);
    // The lane back is known once 60 m lie between: from 30 m after the turn on.
    let back = &loops.passes[0];
    assert_eq!(back.direction(), Direction::Opposite);
    assert!((back.first.later_way_m - 130.0).abs() < 1.5, "{back:?}");
    assert!((back.first.earlier_way_m - 70.0).abs() < 2.5, "{back:?}");
    assert!((back.nearest.yaw_rad.abs() - std::f64::consts::PI).abs() < 1e-6);
    assert!(back.nearest.distance_m < 0.3);
    let last = loops.revisits.last().unwrap();
    assert!(
        (last.later_way_m - 240.0).abs() < 0.6 && last.earlier_way_m < 2.5,
        "{last:?}"
    );
    assert!(
        (last.yaw_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-6,
        "{last:?}"
    );
    for revisit in &loops.revisits {
        assert!(revisit.later_way_m - revisit.earlier_way_m >= 60.0);
        let [a, b] = [revisit.earlier, revisit.later]
            .map(|stamp| config.map_from_footprint(stamp).translation.vector);
        assert!((a - b).norm() <= 2.0 && ((a - b).norm() - revisit.distance_m).abs() < 1e-9);
    }
}

/// Where the sensor is, a decoded point in the map, and its truth, for all points after a time.
fn points_from(config: &SimulationConfig, time_s: f64) -> Vec<(Vector3, Vector3, ReturnTruth)> {
    let mut simulation = Simulation::new(config.clone());
    simulation.skip_to(config.start + (time_s * 1e9) as i64);
    let mut points = Vec::new();
    while let Some(packet) = simulation.next_packet() {
        if packet.port != 2368 {
            continue;
        }
        let (channels, micros) = decoder::vlp16(packet.bytes);
        let hour_ns = 3_600_000_000_000;
        let hour = packet.stamp.as_nanos() / hour_ns * hour_ns;
        let begins = Stamp::from_nanos(hour + i64::from(micros) * 1000);
        for (channel, truth) in channels.iter().zip(packet.truth) {
            if channel.raw_distance > 0 {
                let map_from_lidar = config.map_from_lidar(begins + (channel.time_s * 1e9) as i64);
                let point = nalgebra::Point3::new(channel.x, channel.y, channel.z);
                let eye = map_from_lidar.translation.vector;
                points.push((eye, (map_from_lidar * point).coords, *truth));
            }
        }
    }
    points
}

#[test]
fn what_is_reported_of_a_campus_lies_on_its_ground_and_on_what_stands_there() {
    let mut config = SimulationConfig::preset(Preset::Campus, 3, 500.5);
    config.noise = NoiseConfig::NONE;
    let floor = config.scene.floor();
    let (mut grounds, mut seen, mut seen_again) = (0, 0, 0);
    let (mut highest, mut lowest) = (f64::MIN, f64::MAX);
    // Past the level start, where the ground rolls.
    for (eye, place, truth) in points_from(&config, 500.0) {
        match truth.label {
            ReturnLabel::Floor => {
                // Half a count of distance and of azimuth, and the cells' flatness.
                let off = place.z - floor.height(place.x, place.y);
                assert!(off.abs() < 0.01, "{place} is {off} m over the ground");
                (highest, lowest) = (highest.max(place.z), lowest.min(place.z));
                grounds += 1;
            }
            ReturnLabel::Direct => {
                // Looked at from half a metre before it. At a grazing angle, half a count of
                // azimuth is a long way.
                let way = place - eye;
                let again =
                    (config.scene).distance(place - way.normalize() * 0.5, way.normalize(), 2.0);
                let near = |again: f64| (again - 0.5).abs() < 0.01 + 1e-3 * way.norm();
                seen += 1;
                seen_again += usize::from(again.is_some_and(near));
            }
            _ => {}
        }
    }
    assert!(grounds > 25_000 && seen > 25_000, "{grounds} {seen}");
    assert!(seen_again * 100 > seen * 97, "{seen_again} of {seen}");
    assert!(highest - lowest > 0.5, "{lowest} to {highest}");
}

#[test]
fn a_simulation_that_is_entered_late_goes_on_as_the_whole_one_does() {
    let config = SimulationConfig::preset(Preset::Building, 2, 0.5);
    let mut whole = Simulation::new(config.clone());
    let entry = config.start + 300_000_000;
    let mut late = Simulation::new(config);
    late.skip_to(entry);
    let mut compared = 0;
    while let Some(packet) = whole.next_packet() {
        if packet.stamp < entry {
            continue;
        }
        let expected = (packet.stamp, packet.port, packet.bytes);
        let got = late.next_packet().unwrap();
        assert_eq!((got.stamp, got.port, got.bytes), expected);
        compared += 1;
    }
    assert!(late.next_packet().is_none());
    // 0.2 s of packets 1.327 ms apart, and those of every fourteenth.
    assert!((150..165).contains(&compared), "{compared}");
}

#[test]
fn seeds_lay_out_different_worlds_and_the_same_seed_the_same() {
    for preset in [Preset::Building, Preset::Campus, Preset::CampusLong] {
        let bytes = |seed: u64| {
            let mut simulation = Simulation::new(SimulationConfig::preset(preset, seed, 0.11));
            let mut bytes = Vec::new();
            while let Some(packet) = simulation.next_packet() {
                bytes.extend_from_slice(packet.bytes);
            }
            bytes
        };
        let first = bytes(1);
        assert!(first == bytes(1), "{preset:?}");
        assert!(first != bytes(2), "{preset:?}");
    }
}

#[test]
fn stray_returns_come_in_their_share_anywhere_on_the_beam() {
    for (name, noise) in NoiseConfig::LEVELS {
        for sensor in [SensorKind::Vlp16, SensorKind::Vlp16Dual] {
            let mut config = SimulationConfig::preset(Preset::Building, 1, 1.0);
            config.noise = noise;
            config.sensor = sensor;
            let mut clean = config.clone();
            clean.noise = NoiseConfig::NONE;
            let (noisy, clean) = (points_from(&config, 0.0), points_from(&clean, 0.0));
            let strays = noisy
                .iter()
                .filter(|(_, _, truth)| truth.label == ReturnLabel::Stray);
            let share = strays.clone().count() as f64 / noisy.len() as f64;
            let off = (share - noise.stray_share).abs();
            assert!(off < 0.1 * noise.stray_share + 1e-12, "{name}: {share}");
            if noise.stray_share > 0.0 {
                // Half before what is there, half behind.
                let mean = strays.map(|(_, _, t)| f64::from(t.distance_m)).sum::<f64>()
                    / (share * noisy.len() as f64);
                let there = clean
                    .iter()
                    .map(|(_, _, t)| f64::from(t.distance_m))
                    .sum::<f64>()
                    / clean.len() as f64;
                assert!(
                    (mean / there - 1.0).abs() < 0.2,
                    "{name}: {mean} and {there}"
                );
            }
            assert_eq!(noisy, points_from(&config, 0.0));
        }
    }
}

#[test]
fn the_look_alike_rooms_of_a_building_look_alike_from_their_corridors() {
    // Rays from the same place of the first and the third block's lower corridor.
    let world = Preset::Building.world(5);
    let config = SimulationConfig::new(Preset::Building.world(5), 5, 300.0);
    let along = (0..3000)
        .map(|i| config.map_from_footprint(config.start + i * 100_000_000))
        .map(|pose| pose.translation.vector.x)
        .fold(0.0, f64::max);
    let mut best = 0;
    // They are two columns apart; how wide those are is the seed's affair: all widths are tried.
    for shift in (200..500).map(|cm| f64::from(cm) * 0.1) {
        if shift > along {
            break;
        }
        let alike = (0..360)
            .filter(|k| {
                let azimuth = f64::from(*k).to_radians();
                let direction = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
                let [a, b] = [3.0, 3.0 + shift].map(|x| {
                    let from = Vector3::new(x, 0.0, 0.6);
                    world.scene.distance(from, direction, 6.0)
                });
                matches!((a, b), (Some(a), Some(b)) if (a - b).abs() < 0.11)
            })
            .count();
        best = best.max(alike);
    }
    assert!(best > 250, "{best} of 360");
}
