//! The worlds and the robot in them: free paths, glass, inertial samples, odometry, files.

use std::collections::HashMap;

use etherparse::{NetSlice, SlicedPacket, TransportSlice};
use hachi_hal::{Imu, Pose, Vector3};
use hachi_world::{
    GRAVITY, ImuConfig, OdometryConfig, Preset, ReturnLabel, Simulation, SimulationConfig,
    write_pcap, write_tum,
};
use nalgebra::UnitQuaternion;

fn walk_round(preset: Preset, seed: u64, step_s: f64) {
    let world = preset.world(seed);
    let mut time = 0.0;
    while time < world.trajectory.period_s() {
        let footprint = world.trajectory.map_from_footprint(time);
        for height in [0.3, 0.7, 1.2] {
            let from = footprint * nalgebra::Point3::new(0.0, 0.0, height);
            for k in 0..16 {
                let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_8).sin_cos();
                let direction = footprint.rotation * Vector3::new(cos, sin, 0.0);
                let free = world.scene.distance(from.coords, direction, 5.0);
                assert!(
                    free.is_none_or(|distance| distance > 0.35),
                    "{preset:?} {seed}: {free:?} m at {time} s, {from}"
                );
            }
        }
        // And the floor is under its feet.
        let above = footprint * nalgebra::Point3::new(0.0, 0.0, 0.3);
        let down = world
            .scene
            .distance(above.coords, -Vector3::z(), 5.0)
            .unwrap();
        assert!(
            (down - 0.3).abs() < 0.02,
            "{preset:?} {seed}: {down} at {time}"
        );
        time += step_s;
    }
}

#[test]
fn the_robot_never_walks_into_anything() {
    for preset in Preset::ALL {
        let (seeds, step_s) = match preset {
            Preset::CampusLong => (2, 0.45),
            Preset::Campus => (6, 0.45),
            Preset::Building => (12, 0.37),
            _ => (12, 0.37),
        };
        for seed in 0..seeds {
            walk_round(preset, seed, step_s);
        }
    }
}

#[test]
fn every_patrol_starts_at_the_origin_and_repeats() {
    for preset in Preset::ALL {
        let world = preset.world(4);
        let first = world.trajectory.map_from_footprint(0.0);
        assert!((first.to_homogeneous() - Pose::identity().to_homogeneous()).norm() < 1e-9);
        let period = world.trajectory.period_s();
        let (a, b) = (
            world.trajectory.map_from_footprint(17.0),
            world.trajectory.map_from_footprint(17.0 + 20.0 * period),
        );
        assert!((a.translation.vector - b.translation.vector).norm() < 1e-6);
    }
}

#[test]
fn the_stress_preset_turns_fast_but_not_absurdly() {
    let world = Preset::Stress.world(1);
    let fastest = (0..8000)
        .map(|i| {
            let twist = world.trajectory.twist(f64::from(i) * 0.01);
            twist.angular_velocity_in_base.norm().to_degrees()
        })
        .fold(0.0, f64::max);
    assert!((100.0..260.0).contains(&fastest), "{fastest} degrees/s");
}

#[test]
fn glass_answers_weakly_and_leaves_ghosts_that_are_dark_too() {
    for seed in 1..4 {
        let config = SimulationConfig::preset(Preset::GlassCorridor, seed, 8.0);
        let mut simulation = Simulation::new(config);
        let mut count: HashMap<ReturnLabel, (u32, u32)> = HashMap::new();
        while let Some(packet) = simulation.next_packet() {
            let channels = packet.bytes[..packet.truth.len() / 32 * 100]
                .chunks(100)
                .flat_map(|block| block[4..].chunks(3));
            for (channel, truth) in channels.zip(packet.truth) {
                let (all, suspect) = count.entry(truth.label).or_default();
                *all += 1;
                *suspect += u32::from(channel[2] <= 15);
                let raw = f32::from(u16::from_le_bytes([channel[0], channel[1]]));
                assert_eq!(raw == 0.0, truth.label == ReturnLabel::None);
                assert!((raw * 0.002 - truth.distance_m).abs() < 0.1); // 6 sigma
            }
        }
        let of = |label| count.get(&label).copied().unwrap_or_default();
        let returns: u32 = ReturnLabel::RETURNS.iter().map(|label| of(*label).0).sum();
        let share = |label| f64::from(of(label).0) / f64::from(returns);
        let suspect = |label| f64::from(of(label).1) / f64::from(of(label).0);
        let shares = ReturnLabel::RETURNS.map(|label| (label, share(label), suspect(label)));
        assert_eq!(suspect(ReturnLabel::GlassSurface), 1.0, "{shares:?}");
        assert_eq!(suspect(ReturnLabel::Floor), 1.0, "{shares:?}");
        // At grazing angles a pane mirrors nearly all.
        assert!(suspect(ReturnLabel::Ghost) > 0.75, "{shares:?}");
        assert!(share(ReturnLabel::Ghost) > 0.03, "{shares:?}");
        assert!(share(ReturnLabel::FloorGhost) > 0.001, "{shares:?}");
        assert!(share(ReturnLabel::GlassSurface) > 0.03, "{shares:?}");
        assert!(share(ReturnLabel::Direct) > 0.15, "{shares:?}");
    }
}

#[test]
fn a_perfect_inertial_sensor_integrates_to_the_trajectory() {
    let mut config = SimulationConfig::preset(Preset::Office, 1, 20.0);
    config.imu = ImuConfig::NONE;
    let first = config.map_from_base(config.start);
    let mut rotation = first.rotation;
    let mut position = first.translation.vector;
    let mut velocity = config.trajectory.twist(0.0).velocity_in_map;
    let step = 0.005;
    let mut last: Option<(Vector3, Vector3)> = None;
    let mut samples = 0;
    let mut end = config.start;
    for sample in config.imu() {
        if let Some((rate, force)) = last {
            // Trapezoids: rate and force half-way between two samples.
            let rate = (rate + sample.angular_velocity) / 2.0;
            let next = rotation * UnitQuaternion::from_scaled_axis(rate * step);
            let pull = (rotation * force + next * sample.specific_force) / 2.0;
            let acceleration = pull - Vector3::z() * GRAVITY;
            position += velocity * step + acceleration * (step * step / 2.0);
            velocity += acceleration * step;
            rotation = next;
        }
        last = Some((sample.angular_velocity, sample.specific_force));
        samples += 1;
        end = sample.stamp;
    }
    assert_eq!(samples, 4001);
    let truth = config.map_from_base(end);
    let off = (position - truth.translation.vector).norm();
    assert!(off < 0.02, "{off} m after 20 s");
    assert!(rotation.angle_to(&truth.rotation) < 1e-3);
}

#[test]
fn inertial_samples_are_there_by_their_deadline_and_err_as_configured() {
    let config = SimulationConfig::preset(Preset::Corridor, 3, 1.0);
    let mut imu = config.imu();
    assert!(imu.read(config.start + -1).unwrap().is_none());
    let sample = imu.read(config.start).unwrap().unwrap();
    assert_eq!(sample.stamp, config.start);
    assert!(imu.read(config.start + 4_999_999).unwrap().is_none());
    // Standing still for a second: gravity upwards, within bias and noise.
    let samples: Vec<_> = imu.take_while(|s| s.stamp <= config.end()).collect();
    assert_eq!(samples.len(), 200);
    let mean = samples.iter().map(|s| s.specific_force).sum::<Vector3>() / 200.0;
    assert!((mean - Vector3::z() * GRAVITY).norm() < 0.1, "{mean}");
    let spread = samples
        .iter()
        .map(|s| (s.specific_force - mean).x.powi(2))
        .sum::<f64>()
        / 200.0;
    assert!((0.025..0.035).contains(&spread.sqrt()), "{spread}");
}

#[test]
fn leg_odometry_drifts_by_a_few_percent_of_the_way_and_not_in_roll_or_pitch() {
    let mut drifts = Vec::new();
    for seed in 0..8 {
        let config = SimulationConfig::preset(Preset::Corridor, seed, 60.0);
        let mut way = 0.0;
        let mut last: Option<Vector3> = None;
        let mut end = None;
        for sample in config.odometry() {
            let truth = config.map_from_base(sample.stamp);
            way += last.map_or(0.0, |last| (truth.translation.vector - last).norm());
            last = Some(truth.translation.vector);
            let up = sample.odom_from_base.rotation.inverse() * Vector3::z();
            assert!((up - truth.rotation.inverse() * Vector3::z()).norm() < 1e-9);
            end = Some((sample.odom_from_base, truth));
        }
        let (odom, truth) = end.unwrap();
        let moved =
            truth.translation.vector - config.map_from_base(config.start).translation.vector;
        drifts.push((odom.translation.vector - moved).norm() / way);
    }
    let mean = drifts.iter().sum::<f64>() / drifts.len() as f64;
    assert!((0.005..0.025).contains(&mean), "{drifts:?}");
}

#[test]
fn perfect_odometry_is_the_truth_seen_from_the_start() {
    let mut config = SimulationConfig::preset(Preset::Office, 2, 30.0);
    config.odometry = OdometryConfig::NONE;
    let first = config.map_from_base(config.start);
    for sample in config.odometry() {
        let truth = config.map_from_base(sample.stamp);
        let moved = truth.translation.vector - first.translation.vector;
        assert!((sample.odom_from_base.translation.vector - moved).norm() < 1e-9);
        assert!(sample.odom_from_base.rotation.angle_to(&truth.rotation) < 1e-9);
    }
}

#[test]
fn the_footprint_is_under_the_tilted_body() {
    let config = SimulationConfig::preset(Preset::Office, 1, 60.0);
    for i in 0..600 {
        let stamp = config.start + i * 100_000_000;
        let footprint = config.footprint_from_lidar(stamp);
        // 0.45 + 0.2 high, 0.15 forward, bobbing 1.5 cm and tilting 1.8 degrees at most.
        let v = footprint.translation.vector;
        assert!(
            (v.z - 0.65).abs() < 0.021 && (v.x - 0.15).abs() < 0.01,
            "{v}"
        );
        assert!(footprint.rotation.angle() < 2f64.to_radians());
    }
}

#[test]
fn a_capture_holds_the_same_payloads_as_the_stream() {
    let config = SimulationConfig::preset(Preset::Corridor, 1, 0.1);
    let mut file = Vec::new();
    let written = write_pcap(&mut Simulation::new(config.clone()), &mut file).unwrap();
    let mut reader = pcap_file::pcap::PcapReader::new(&file[..]).unwrap();
    let mut stream = Simulation::new(config);
    let mut read = 0;
    while let Some(frame) = reader.next_packet() {
        let frame = frame.unwrap();
        let expected = stream.next_packet().unwrap();
        assert_eq!(frame.timestamp.as_nanos() as i64, expected.stamp.as_nanos());
        let sliced = SlicedPacket::from_ethernet(&frame.data).unwrap();
        let Some(NetSlice::Ipv4(ip)) = sliced.net else {
            panic!("not IPv4")
        };
        let header = ip.header().to_header();
        assert_eq!(header.header_checksum, header.calc_header_checksum());
        assert_eq!(header.source, [192, 168, 1, 201]);
        let Some(TransportSlice::Udp(udp)) = sliced.transport else {
            panic!("not UDP")
        };
        assert_eq!(udp.destination_port(), expected.port);
        assert_eq!(udp.payload(), expected.bytes);
        read += 1;
    }
    assert_eq!((read, stream.next_packet().is_none()), (written, true));
}

#[test]
fn the_truth_is_written_in_tum_format() {
    let config = SimulationConfig::preset(Preset::Corridor, 1, 0.02);
    let mut text = Vec::new();
    write_tum(config.truth(10_000_000), &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(
        lines[0],
        "1700000000.000000000 0.150000 0.000000 0.650000 \
         0.000000000 0.000000000 0.000000000 1.000000000"
    );
    assert!(lines[1].starts_with("1700000000.010000000 "));
}
