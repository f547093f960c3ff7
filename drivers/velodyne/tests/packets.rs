//! The decoder against numbers from elsewhere: points worked out by hand from the manual's rules,
//! the byte layout written out here, and its own inverse.

use hachi_hal::{Point, ReturnKind};
use hachi_velodyne::encode::{
    Block, Echo, Firing, PacketWriter, blocks_of, data_packet, position_packet,
};
use hachi_velodyne::packet::nmea::{NmeaError, Sentence};
use hachi_velodyne::packet::{
    Decoder, DecoderConfig, Model, PacketError, PacketKind, PointBatch, PositionError,
    PositionPacket, Pps, ReturnMode, Thermal, recognise,
};

/// Blocks whose azimuth grows by `step` counts from `first`, or by pairs in dual mode.
fn turning(first: u16, step: u16, stride: u16) -> [Block; 12] {
    core::array::from_fn(|k| Block {
        azimuth: (first + k as u16 / stride * step) % 36_000,
        ..Block::default()
    })
}

fn decode(packet: &[u8]) -> Result<Vec<Point>, PacketError> {
    decode_with(DecoderConfig::default(), packet)
}

fn decode_with(config: DecoderConfig, packet: &[u8]) -> Result<Vec<Point>, PacketError> {
    let mut batch = PointBatch::new();
    Decoder::new(config).decode(packet, 0, &mut batch)?;
    Ok(batch.as_slice().to_vec())
}

/// The one point of a strongest-return packet with one return.
fn one_point(first: u16, step: u16, channel: usize, raw: u16) -> Point {
    let mut blocks = turning(first, step, 1);
    blocks[0].echoes[channel] = Echo {
        distance: raw,
        reflectivity: 77,
    };
    let points = decode(&data_packet(
        &blocks,
        0,
        ReturnMode::Strongest,
        Model::Vlp16,
    ))
    .unwrap();
    assert_eq!(points.len(), 1);
    points[0]
}

#[track_caller]
fn assert_at(point: &Point, expected: [f64; 3]) {
    for (got, want) in point.position().iter().zip(expected) {
        assert!(
            (f64::from(*got) - want).abs() < 5e-6,
            "{point:?} {expected:?}"
        );
    }
}

#[test]
fn worked_points_of_a_single_return_packet() {
    let ahead = one_point(0, 40, 0, 5_000);
    assert_at(&ahead, [9.659258, 0.0, -2.588190]);
    assert_eq!((ahead.ring, ahead.azimuth_deg), (0, 0.0));
    assert_eq!((ahead.range_m, ahead.intensity), (10.0, 77.0));
    assert_eq!(ahead.returned, ReturnKind::Strongest);

    let right = one_point(9_000, 40, 17, 5_000);
    assert_at(&right, [-0.036355, -9.998411, 0.174524]);
    assert!((right.azimuth_deg - 90.208333).abs() < 1e-5);
    assert_eq!(right.ring, 8);

    let across_zero = one_point(35_990, 40, 31, 2_500);
    assert_at(&across_zero, [4.829592, -0.018966, 1.294095]);
    assert!((across_zero.azimuth_deg - 0.225).abs() < 1e-5);
    assert_eq!(across_zero.ring, 15);
}

#[test]
fn every_laser_has_the_manuals_angle_and_ring() {
    let expected = [
        (-15, 0),
        (1, 8),
        (-13, 1),
        (3, 9),
        (-11, 2),
        (5, 10),
        (-9, 3),
        (7, 11),
        (-7, 4),
        (9, 12),
        (-5, 5),
        (11, 13),
        (-3, 6),
        (13, 14),
        (-1, 7),
        (15, 15),
    ];
    for (laser, (degrees, ring)) in expected.into_iter().enumerate() {
        let point = one_point(0, 40, laser, 10_000);
        let elevation = f64::from(point.z / point.range_m).asin().to_degrees();
        assert!((elevation - f64::from(degrees)).abs() < 1e-4, "{laser}");
        assert_eq!(point.ring, ring);
    }
}

#[test]
fn firing_times_are_those_of_the_manual() {
    let mut blocks = turning(0, 40, 1);
    blocks[11].echoes[31].distance = 1_000;
    let single = decode(&data_packet(&blocks, 0, ReturnMode::Last, Model::Vlp16)).unwrap();
    assert_eq!(single[0].time_offset_ns, 1_306_368);
    assert_eq!(single[0].returned, ReturnKind::Last);

    let mut blocks = turning(0, 40, 2);
    blocks[11].echoes[31].distance = 1_000;
    let dual = decode(&data_packet(&blocks, 0, ReturnMode::Dual, Model::Vlp16)).unwrap();
    assert_eq!(dual[0].time_offset_ns, 642_816);
}

#[test]
fn a_base_offset_is_added_to_every_point() {
    let mut blocks = turning(0, 40, 1);
    blocks[2].echoes[3].distance = 1_000;
    let packet = data_packet(&blocks, 5, ReturnMode::Strongest, Model::Vlp16);
    let mut batch = PointBatch::new();
    let decoder = Decoder::new(DecoderConfig::default());
    let info = decoder.decode(&packet, 1_000_000, &mut batch).unwrap();
    let shot = 2 * 110_592 + 3 * 2_304;
    assert_eq!(batch.as_slice()[0].time_offset_ns, 1_000_000 + shot);
    assert_eq!((info.hour_us, info.last_shot_ns), (5, 1_306_368));
    // The rotor turns 0.40° in 110.592 µs: 3617° a second, 603 rpm.
    assert!((info.rate_deg_per_s - 3_616.9).abs() < 0.1);
}

#[test]
fn dual_echoes_are_told_apart_and_an_identical_one_is_dropped() {
    let mut blocks = turning(100, 40, 2);
    let pairs = [
        // (last, strongest) as (distance, reflectivity), then what they are.
        ((1_000, 20), (1_000, 20), vec![ReturnKind::StrongestAndLast]),
        (
            (2_000, 10),
            (1_500, 60),
            vec![ReturnKind::Last, ReturnKind::Strongest],
        ),
        (
            (2_000, 60),
            (1_500, 10),
            vec![ReturnKind::StrongestAndLast, ReturnKind::SecondStrongest],
        ),
        (
            (1_500, 10),
            (2_000, 60),
            vec![ReturnKind::SecondStrongest, ReturnKind::StrongestAndLast],
        ),
        ((0, 0), (1_500, 60), vec![ReturnKind::Strongest]),
        ((1_500, 60), (0, 0), vec![ReturnKind::Last]),
        ((0, 0), (0, 9), vec![]),
    ];
    let echo = |(distance, reflectivity)| Echo {
        distance,
        reflectivity,
    };
    for (channel, (last, strongest, _)) in pairs.iter().enumerate() {
        blocks[2].echoes[channel] = echo(*last);
        blocks[3].echoes[channel] = echo(*strongest);
    }
    let points = decode(&data_packet(&blocks, 0, ReturnMode::Dual, Model::Vlp16)).unwrap();
    let kinds: Vec<_> = points.iter().map(|p| p.returned).collect();
    let expected: Vec<_> = pairs
        .iter()
        .flat_map(|(_, _, kinds)| kinds.clone())
        .collect();
    assert_eq!(kinds, expected);
    let times: Vec<_> = points.iter().map(|p| p.time_offset_ns).collect();
    assert!(times.is_sorted(), "{times:?}");
    assert_eq!(times[1], times[2], "two echoes of one shot have one time");
}

#[test]
fn the_manuals_vertical_correction_is_a_switch() {
    let mut blocks = turning(0, 40, 1);
    blocks[0].echoes[0].distance = 5_000;
    blocks[0].echoes[15].distance = 5_000;
    let packet = data_packet(&blocks, 0, ReturnMode::Strongest, Model::Vlp16);
    let plain = decode(&packet).unwrap();
    let config = DecoderConfig {
        vertical_correction: true,
        ..DecoderConfig::default()
    };
    let corrected = decode_with(config, &packet).unwrap();
    assert!((corrected[0].z - plain[0].z - 0.0112).abs() < 1e-6);
    assert!((corrected[1].z - plain[1].z + 0.0112).abs() < 1e-6);
}

#[test]
fn the_hi_res_has_its_own_fan() {
    let mut blocks = turning(0, 40, 1);
    blocks[0].echoes[0].distance = 5_000;
    blocks[0].echoes[1].distance = 5_000;
    let points = decode(&data_packet(
        &blocks,
        0,
        ReturnMode::Strongest,
        Model::HiRes,
    ))
    .unwrap();
    let elevation = |p: &Point| f64::from(p.z / p.range_m).asin().to_degrees();
    assert!((elevation(&points[0]) + 10.0).abs() < 1e-4);
    assert!((elevation(&points[1]) - 0.67).abs() < 1e-4);
}

/// A good packet with one byte changed.
fn damaged(at: usize, byte: u8) -> Result<Vec<Point>, PacketError> {
    let blocks = turning(10_000, 40, 1);
    let mut packet = data_packet(&blocks, 0, ReturnMode::Strongest, Model::Vlp16);
    packet[at] = byte;
    decode(&packet)
}

#[test]
fn packets_that_are_not_what_they_should_be_are_refused_with_what_was_seen() {
    assert_eq!(decode(&[0; 1205]), Err(PacketError::Length { got: 1205 }));
    assert_eq!(damaged(1205, 0x21), Err(PacketError::Product { got: 0x21 }));
    assert_eq!(damaged(1204, 0), Err(PacketError::ReturnMode { got: 0 }));
    let flag = PacketError::BlockFlag {
        block: 3,
        got: 0xDDFF,
    };
    assert_eq!(damaged(301, 0xDD), Err(flag));
    let azimuth = PacketError::Azimuth {
        block: 2,
        got: 0xFF60,
    };
    assert_eq!(damaged(203, 0xFF), Err(azimuth));
    assert_eq!(
        damaged(1203, 0xFF),
        Err(PacketError::Stamp {
            got_us: 0xFF00_0000
        })
    );
    let step = damaged(503, 0x00).unwrap_err();
    assert!(
        matches!(step, PacketError::AzimuthStep { block: 5, .. }),
        "{step}"
    );
}

#[test]
fn a_refused_product_is_named() {
    let error = damaged(1205, 0x28).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("0x28 (VLP-32C)"), "{text}");
}

#[test]
fn a_rotor_that_stands_still_is_refused() {
    let packet = data_packet(&turning(7, 0, 1), 0, ReturnMode::Strongest, Model::Vlp16);
    assert_eq!(
        decode(&packet),
        Err(PacketError::RotorStopped { azimuth: 7 })
    );
}

#[test]
fn dual_blocks_with_different_azimuths_are_refused() {
    let mut blocks = turning(0, 40, 2);
    blocks[5].azimuth += 1;
    let packet = data_packet(&blocks, 0, ReturnMode::Dual, Model::Vlp16);
    let expected = PacketError::PairAzimuth {
        block: 4,
        first: 80,
        second: 81,
    };
    assert_eq!(decode(&packet), Err(expected));
}

#[test]
fn the_edge_of_a_limited_view_is_one_jump_and_only_if_expected() {
    let mut blocks = turning(9_000, 40, 1);
    for (k, block) in blocks.iter_mut().enumerate().skip(6) {
        block.azimuth = 27_000 + 40 * k as u16;
    }
    blocks[5].echoes[16].distance = 1_000;
    let packet = data_packet(&blocks, 0, ReturnMode::Strongest, Model::Vlp16);
    assert!(matches!(
        decode(&packet),
        Err(PacketError::AzimuthStep { block: 6, .. })
    ));
    let config = DecoderConfig {
        limited_view: true,
        ..DecoderConfig::default()
    };
    let points = decode_with(config, &packet).unwrap();
    // Half a block after 92.00°, at 0.40° a block.
    assert!((points[0].azimuth_deg - 92.2).abs() < 1e-4);
}

#[test]
fn rotors_from_300_to_1200_rpm_are_decoded() {
    for rpm in [300.0, 600.0, 900.0, 1_200.0_f64] {
        let step = rpm / 60.0 * 36_000.0 * 110.592e-6;
        let blocks = core::array::from_fn(|k| Block {
            azimuth: (k as f64 * step).round() as u16,
            ..Block::default()
        });
        let packet = data_packet(&blocks, 0, ReturnMode::Strongest, Model::Vlp16);
        assert!(decode(&packet).is_ok(), "{rpm}");
    }
}

#[test]
fn the_writer_is_the_inverse_of_the_decoder() {
    for mode in [ReturnMode::Strongest, ReturnMode::Dual] {
        let mut writer = PacketWriter::new(mode, Model::Vlp16);
        let mut packets = Vec::new();
        for n in 0..24_u16 {
            let echoes = core::array::from_fn(|laser| Echo {
                distance: 1_000 + n * 100 + laser as u16,
                reflectivity: laser as u8,
            });
            let firing = Firing {
                azimuth_deg: 359.5 + 0.2 * f64::from(n),
                time_us: 3_600_000_000 * 7 + 12 + u64::from(n) * 55,
                echoes,
                strongest: echoes,
            };
            packets.extend(writer.push(&firing));
        }
        assert_eq!(packets.len(), if mode == ReturnMode::Dual { 2 } else { 1 });
        let blocks = blocks_of(&packets[0]).unwrap();
        let again = data_packet(&blocks, 12, mode, Model::Vlp16);
        assert_eq!(again, packets[0]);
        let points: Vec<_> = packets.iter().flat_map(|p| decode(p).unwrap()).collect();
        assert_eq!(points.len(), 24 * 16);
        for (index, point) in points.iter().enumerate() {
            let raw = 1_000 + index / 16 * 100 + index % 16;
            assert!((f64::from(point.range_m) - 0.002 * raw as f64).abs() < 1e-5);
            let shot_deg = 0.2 * (index / 16) as f64 + 0.2 * (index % 16) as f64 * 2.304 / 55.296;
            let expected = (359.5 + shot_deg) % 360.0;
            assert!((f64::from(point.azimuth_deg) - expected).abs() < 1e-3);
        }
    }
}

#[test]
fn distances_are_rounded_to_counts_and_out_of_range_is_no_return() {
    assert_eq!(Echo::from_metres(1.0009, 3).distance, 500);
    assert_eq!(Echo::from_metres(1.0011, 3).distance, 501);
    for none in [0.0, -1.0, 131.1, f32::INFINITY, f32::NAN] {
        assert_eq!(Echo::from_metres(none, 3), Echo::default());
    }
}

const SENTENCE: &[u8] = b"$GPRMC,120000.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B\r\n";

/// A position packet laid out by hand from the manual's table.
fn position_bytes() -> [u8; 512] {
    let mut bytes = [0; 512];
    bytes[187] = 0x45;
    bytes[190..192].copy_from_slice(&[0xFE, 0xFF]);
    bytes[192..196].copy_from_slice(&[0x10, 0x27, 0, 0]);
    bytes[198..202].copy_from_slice(&[0x71, 0x3A, 0x83, 0x40]);
    bytes[202] = 2;
    bytes[205] = 0x44;
    bytes[206..206 + SENTENCE.len()].copy_from_slice(SENTENCE);
    bytes
}

#[test]
fn a_position_packet_is_read_field_by_field_and_written_back() {
    let position = PositionPacket::decode(&position_bytes()).unwrap();
    assert_eq!(position.top_temperature, 0x45);
    assert_eq!(position.temperature_change, -2);
    assert_eq!(position.calibration_age_s, 10_000);
    assert_eq!(position.hour_us, 1_082_342_001);
    assert_eq!(position.pps, Pps::Locked);
    assert_eq!(position.thermal, Thermal::Ok);
    assert_eq!(position.power_up_temperature, 0x44);
    assert_eq!(position.nmea(), SENTENCE);
    assert!(position.is_utc());
    assert_eq!(position_packet(&position), position_bytes());
}

#[test]
fn position_packets_of_the_wrong_size_or_time_are_refused() {
    let short = PositionPacket::decode(&[0; 511]).unwrap_err();
    assert_eq!(short, PositionError::Length { got: 511 });
    let mut bytes = position_bytes();
    bytes[201] = 0xFF;
    assert!(PositionPacket::decode(&bytes).is_err());
}

#[test]
fn a_sensor_without_a_receiver_is_not_on_utc() {
    let silent = PositionPacket::new(5, Pps::Absent, b"");
    assert_eq!(silent.sentence(), None);
    assert!(!silent.is_utc());
    let no_pulse = PositionPacket::new(5, Pps::Absent, SENTENCE);
    assert!(!no_pulse.is_utc());
}

#[test]
fn an_rmc_sentence_is_read_in_degrees_metres_and_unix_time() {
    // From a receiver in the field; place by hand: 36 + 49.7478558/60, 2 + 24.4542928/60.
    let text =
        b"$GPRMC,081802.00,A,3649.7478558,N,00224.4542928,W,0.034,212.5,210116,0.0,E,A*2E\r\n";
    let sentence = Sentence::parse(text).unwrap();
    let Sentence::Rmc {
        valid,
        place: Some(place),
        speed_m_s: Some(speed),
        ..
    } = sentence
    else {
        panic!("{sentence:?}");
    };
    assert!(valid);
    assert!((place.latitude_deg - 36.829130930).abs() < 1e-8);
    assert!((place.longitude_deg + 2.407571547).abs() < 1e-8);
    assert!((speed - 0.017491).abs() < 1e-6);
    // `date -u -d '2016-01-21 08:18:02' +%s`
    assert_eq!(
        sentence.unix_time().unwrap().as_nanos(),
        1_453_364_282 * 1_000_000_000
    );
}

#[test]
fn a_gga_sentence_is_read_too() {
    let text = b"$GPGGA,123519.5,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*";
    let sum = text[1..text.len() - 1].iter().fold(0, |a, b| a ^ b);
    let text = [&text[..], format!("{sum:02X}").as_bytes()].concat();
    let Ok(Sentence::Gga {
        time: Some(time),
        quality,
        satellites,
        altitude_m,
        ..
    }) = Sentence::parse(&text)
    else {
        panic!("not read");
    };
    assert_eq!((time.hour, time.second, time.nanos), (12, 19, 500_000_000));
    assert_eq!((quality, satellites, altitude_m), (1, Some(8), Some(545.4)));
}

#[test]
fn broken_sentences_say_what_is_broken() {
    assert_eq!(Sentence::parse(b""), Err(NmeaError::Start { got: 0 }));
    assert_eq!(
        Sentence::parse(b"$GPRMC,1"),
        Err(NmeaError::NoChecksum { len: 8 })
    );
    let flipped =
        Sentence::parse(b"$GPRMC,120001.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B");
    let expected = NmeaError::Checksum {
        computed: 0x5A,
        stated: 0x5B,
    };
    assert_eq!(flipped, Err(expected));
    assert_eq!(Sentence::parse(b"$GPZDA*48"), Err(NmeaError::Kind));
    assert_eq!(
        Sentence::parse(b"$GPRMC,2520*62").err(),
        Some(NmeaError::Field { index: 1 })
    );
}

#[test]
fn payloads_are_recognised_by_length_and_markers() {
    let packet = data_packet(&turning(0, 40, 1), 0, ReturnMode::Strongest, Model::Vlp16);
    assert_eq!(recognise(&packet), Some(PacketKind::Data));
    assert_eq!(recognise(&position_bytes()), Some(PacketKind::Position));
    assert_eq!(recognise(&packet[1..]), None);
    assert_eq!(recognise(&[0; 1206]), None);
}
