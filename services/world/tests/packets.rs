//! The bytes, judged by a decoder of the tests' own and by scenes worked out by hand.

mod decoder;

use hachi_hal::{PacketSource, Stamp};
use hachi_world::{
    BodyMotion, Floor, Gait, Material, NoiseConfig, Preset, ReturnLabel, Scene, SceneBuilder,
    SensorKind, SimulatedLidar, SimulatedLidarError, Simulation, SimulationConfig,
    TrajectoryBuilder, World,
};

/// A robot that stands at the origin, its sensor 0.65 m over the floor and 0.15 m before it.
fn standing_in(scene: Scene) -> SimulationConfig {
    let gait = Gait {
        body: BodyMotion::none(),
        ..Gait::quadruped()
    };
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
        .stand(10.0)
        .build(Floor::default())
        .unwrap();
    let mut config = SimulationConfig::new(World { scene, trajectory }, 1, 0.11);
    config.noise = NoiseConfig::NONE;
    config
}

#[test]
fn a_flat_wall_gives_the_raw_counts_of_its_distance() {
    let mut builder = SceneBuilder::new();
    builder.cuboid([5.65, 0.0, 1.0], [1.0, 100.0, 40.0], 0.0, Material::WALL);
    // Its face is 5.15 - 0.15 = 5 m before the sensor.
    let mut simulation = Simulation::new(standing_in(builder.build()));
    let (mut index, mut hits) = (0u32, 0);
    while let Some(packet) = simulation.next_packet() {
        if packet.port != 2368 {
            continue;
        }
        let (channels, _) = decoder::vlp16(packet.bytes);
        for channel in &channels {
            // When it fired, counted from the manual's table: 3,600 degrees a second.
            let time_s = 1.327_104e-3 * f64::from(index) + channel.time_s;
            let azimuth = (3600.0 * time_s).to_radians();
            let elevation = [-15., 1., -13., 3., -11., 5., -9., 7.]
                .into_iter()
                .chain([-7., 9., -5., 11., -3., 13., -1., 15.])
                .nth(channel.laser)
                .map(f64::to_radians)
                .unwrap();
            let expected = 5.0 / (elevation.cos() * azimuth.cos()) / 0.002;
            if azimuth.cos() > 0.2 {
                let off = f64::from(channel.raw_distance) - expected;
                assert!(off.abs() < 0.51, "{channel:?} and {expected}");
                hits += 1;
            } else if azimuth.cos() < 0.0 {
                assert_eq!((channel.raw_distance, channel.intensity), (0, 0));
            }
        }
        index += 1;
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn floor_rings_have_the_radius_of_their_elevation() {
    let mut builder = SceneBuilder::new();
    builder.floor_slab([-60.0, -60.0], [60.0, 60.0], 0.0, Material::FLOOR);
    let mut simulation = Simulation::new(standing_in(builder.build()));
    let mut seen = [0; 16];
    while let Some(packet) = simulation.next_packet() {
        if packet.port != 2368 {
            continue;
        }
        let (channels, _) = decoder::vlp16(packet.bytes);
        for (channel, truth) in channels.iter().zip(packet.truth) {
            if channel.raw_distance == 0 {
                assert_eq!(truth.label, ReturnLabel::None);
                continue;
            }
            seen[channel.laser] += 1;
            assert_eq!(truth.label, ReturnLabel::Floor);
            // Laser 0 looks down 15 degrees, laser 2 13 degrees, and so on to laser 14: 1 degree.
            let down = f64::from(15 - channel.laser as u32).to_radians();
            let radius = channel.x.hypot(channel.y);
            let expected = 0.65 / down.tan();
            assert!((radius - expected).abs() < 0.002, "{channel:?}, {expected}");
            assert!(channel.intensity <= 8, "{channel:?}"); // 30 sin 15
        }
    }
    assert!(seen[0] > 1800 && seen[12] > 1800, "{seen:?}");
    // At 1 degree too little comes back, and nothing from above.
    assert_eq!(seen[14], 0);
    assert!((0..8).all(|i| seen[2 * i + 1] == 0));
}

/// How far a place is from the nearest surface of the corridor preset, metres.
fn off_the_corridor(p: &nalgebra::Point3<f64>) -> f64 {
    [p.y.abs() - 1.2, p.z, p.z - 2.7, p.x + 5.0, p.x - 65.0]
        .into_iter()
        .map(f64::abs)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_firing_is_cast_from_where_the_sensor_is_at_that_moment() {
    for sensor in [
        SensorKind::Vlp16,
        SensorKind::Vlp16Dual,
        SensorKind::Helios16P,
    ] {
        let mut config = SimulationConfig::preset(Preset::Corridor, 1, 2.5);
        config.sensor = sensor;
        config.noise = NoiseConfig::NONE;
        let mut simulation = Simulation::new(config.clone());
        let mut angles = Vec::new();
        let (mut points, mut worst) = (0, 0.0f64);
        let mut waiting: Vec<(Vec<u8>, Stamp)> = Vec::new();
        while let Some(packet) = simulation.next_packet() {
            if packet.port == 7788 {
                angles = decoder::helios_angles(packet.bytes);
            }
            if packet.port == sensor.data_port() {
                waiting.push((packet.bytes.to_vec(), packet.stamp));
            }
            if sensor == SensorKind::Helios16P && angles.is_empty() {
                continue;
            }
            for (bytes, received) in waiting.drain(..) {
                // The packet's own clock: UTC, or the time past its hour.
                let hour_ns = 3_600_000_000_000;
                let (channels, begins) = if sensor == SensorKind::Helios16P {
                    let (channels, micros) = decoder::helios(&bytes, &angles);
                    (channels, Stamp::from_nanos(micros as i64 * 1000))
                } else {
                    let (channels, micros) = decoder::vlp16(&bytes);
                    let hour = received.as_nanos() / hour_ns * hour_ns;
                    (channels, Stamp::from_nanos(hour + i64::from(micros) * 1000))
                };
                let last = channels.iter().map(|c| c.time_s).fold(0.0, f64::max);
                let delay = received.secs_since(begins) - last;
                assert!((delay - 50e-6).abs() < 2e-6, "{delay}");
                for channel in channels.iter().filter(|c| c.raw_distance > 0) {
                    let fired = begins + (channel.time_s * 1e9) as i64;
                    let point = nalgebra::Point3::new(channel.x, channel.y, channel.z);
                    let in_map = config.map_from_lidar(fired) * point;
                    let range = f64::from(channel.raw_distance) * 0.0025;
                    let off = off_the_corridor(&in_map) / (1.0 + range);
                    worst = worst.max(off);
                    points += 1;
                }
            }
        }
        // Half a count of distance, half of azimuth (0.005 degrees), and for the dual sensor
        // half of the beam, 0.04 degrees.
        let most = if sensor == SensorKind::Vlp16Dual {
            2e-3
        } else {
            1.2e-3
        };
        assert!(worst < most, "{sensor:?}: {worst}");
        assert!(points > 200_000, "{sensor:?}: {points}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_with_one_thread_and_with_two() {
    let stream = |seed: u64, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut simulation =
                Simulation::new(SimulationConfig::preset(Preset::GlassCorridor, seed, 0.3));
            let mut bytes = Vec::new();
            let mut labels = Vec::new();
            while let Some(packet) = simulation.next_packet() {
                bytes.extend_from_slice(packet.bytes);
                labels.extend(packet.truth.iter().map(|truth| truth.label));
            }
            (bytes, labels)
        })
    };
    let once = stream(5, 1);
    assert!(once.0.len() > 200 * 1206);
    assert!(once == stream(5, 2));
    assert!(once != stream(6, 2));
}

#[test]
fn a_leap_in_time_changes_nothing_of_what_is_sent_after_it() {
    let config = SimulationConfig::preset(Preset::Corridor, 1, 0.2);
    let mut simulation = Simulation::new(config.clone());
    let mut sent = Vec::new();
    while let Some(packet) = simulation.next_packet() {
        sent.push((packet.stamp, packet.bytes.to_vec()));
    }
    for leap in [
        config.start,
        sent[40].0,
        sent[100].0,
        config.start + 150_000_000,
    ] {
        simulation.seek(leap);
        let first = sent.iter().position(|(stamp, _)| *stamp >= leap).unwrap();
        // Position packets come with the data packet before them: a leap may pass one by.
        for (stamp, bytes) in sent[first..].iter().filter(|(_, b)| b.len() == 1206) {
            let packet = loop {
                let packet = simulation.next_packet().unwrap();
                if packet.bytes.len() == 1206 {
                    break packet;
                }
            };
            assert_eq!((packet.stamp, packet.bytes), (*stamp, &bytes[..]));
        }
        assert!(simulation.next_packet().is_none());
    }
}

#[test]
fn position_packets_come_one_to_fourteen_with_the_time_in_both_forms() {
    let mut config = SimulationConfig::preset(Preset::Corridor, 1, 2.0);
    config.start = Stamp::from_nanos(1_795_348_799_000_000_000); // 2026-11-22 11:59:59 UTC
    let mut simulation = Simulation::new(config);
    let (mut data, mut position, mut last) = (0, 0, Stamp::from_nanos(0));
    let mut sentences = Vec::new();
    while let Some(packet) = simulation.next_packet() {
        assert!(packet.stamp > last);
        last = packet.stamp;
        match packet.port {
            2368 => data += 1,
            8308 => {
                position += 1;
                assert_eq!(packet.bytes.len(), 512);
                assert_eq!(packet.bytes[202], 2);
                let micros = u32::from_le_bytes(packet.bytes[198..202].try_into().unwrap());
                let of_hour = packet.stamp.as_nanos() / 1000 % 3_600_000_000;
                assert_eq!(i64::from(micros), of_hour);
                let text = &packet.bytes[206..];
                let end = text.windows(2).position(|pair| pair == b"\r\n").unwrap();
                sentences.push(String::from_utf8(text[..end].to_vec()).unwrap());
            }
            port => panic!("port {port}"),
        }
    }
    assert_eq!(data, simulation.data_packets());
    assert_eq!(position, data.div_ceil(14));
    assert_eq!(data, (2_000_000_000 - 1_306_368 - 50_000) / 1_327_104 + 1);
    assert!(sentences[0].starts_with("$GPRMC,115959.00,A,"));
    assert!(sentences.last().unwrap().contains(",221126,,,A*"));
    assert!(sentences.last().unwrap().starts_with("$GPRMC,120000.00,A,"));
}

#[test]
fn a_dual_return_packet_holds_last_and_strongest_of_the_same_firings() {
    let mut config = SimulationConfig::preset(Preset::Office, 2, 1.0);
    config.sensor = SensorKind::Vlp16Dual;
    config.noise = NoiseConfig::NONE;
    let mut simulation = Simulation::new(config);
    let (mut alike, mut apart, mut packets) = (0, 0, 0);
    while let Some(packet) = simulation.next_packet() {
        if packet.port != 2368 {
            continue;
        }
        packets += 1;
        for pair in packet.bytes[..1200].chunks(200) {
            assert_eq!(pair[..4], pair[100..104]);
        }
        let (channels, _) = decoder::vlp16(packet.bytes);
        for pair in channels.chunks(64) {
            for (last, strongest) in pair[..32].iter().zip(&pair[32..]) {
                let apart_by = i32::from(last.raw_distance) - i32::from(strongest.raw_distance);
                match apart_by {
                    0 => alike += 1,
                    // The second echo is a metre or more behind the first.
                    500.. => apart += 1,
                    _ => panic!("{last:?} {strongest:?}"),
                }
            }
        }
    }
    assert_eq!(packets, 1506); // (1 s - 0.64282 ms) / 0.663552 ms
    assert!(apart > 300 && alike > 50 * apart, "{apart} of {alike}");
}

#[test]
fn a_source_of_packets_keeps_its_deadline_and_survives_a_small_buffer() {
    let config = SimulationConfig::preset(Preset::Corridor, 1, 0.02);
    let start = config.start;
    let mut lidar = SimulatedLidar::new(Simulation::new(config));
    let mut buffer = [0; 1300];
    assert_eq!(lidar.receive(&mut buffer, start + 1_000_000), Ok(None));
    let first = lidar
        .receive(&mut buffer, start + 1_356_368)
        .unwrap()
        .unwrap();
    assert_eq!(first.stamp, start + 1_356_368);
    assert_eq!((first.len, first.port), (1206, 2368));
    assert_eq!(
        lidar.receive(&mut [0; 100], start + 1_376_368),
        Err(SimulatedLidarError::BufferTooSmall {
            needed: 512,
            got: 100
        })
    );
    let mut rest = 0;
    while !lidar.at_end() {
        assert!(
            lidar
                .receive(&mut buffer, start + 20_000_000)
                .unwrap()
                .is_some()
        );
        rest += 1;
    }
    // 15 data packets in 20 ms, one of them taken; the position packet with the 15th.
    assert_eq!(rest, 15);
    assert_eq!(lidar.receive(&mut buffer, start + 30_000_000), Ok(None));
}
