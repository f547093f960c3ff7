//! The decoder against numbers from elsewhere: points worked out by hand from the maker's rules,
//! bytes laid out from the manual's tables, and its own inverse.

use hachi_hal::{Point, ReturnKind};
use hachi_robosense::encode::{
    Block, DifopContents, Echo, Firing, PacketWriter, blocks_of, difop_packet, msop_packet,
};
use hachi_robosense::packet::{
    Calibration, CalibrationError, Decoder, DecoderConfig, Difop, LaserTiming, MsopHeader,
    PacketError, PacketKind, PointBatch, ReturnMode, SyncSource, SyncStatus, recognise,
};

/// Blocks whose azimuth grows by `step` counts from `first`.
fn turning(first: u16, step: u16) -> [Block; 12] {
    core::array::from_fn(|k| Block {
        azimuth: (u32::from(first) + k as u32 * u32::from(step)) as u16 % 36_000,
        ..Block::default()
    })
}

/// Angles of the worked examples: 7° and −4.06° for laser 4, +15° and 0° for the others.
fn example_angles() -> Calibration {
    let (mut vertical, mut horizontal) = ([15.0; 16], [0.0; 16]);
    vertical[4] = 7.0;
    horizontal[4] = -4.06;
    Calibration::new(vertical, horizontal).unwrap()
}

fn decode_with(config: DecoderConfig, packet: &[u8]) -> Result<Vec<Point>, PacketError> {
    let mut batch = PointBatch::new();
    Decoder::new(config, &example_angles()).decode(packet, 0, &mut batch)?;
    Ok(batch.as_slice().to_vec())
}

/// The maker's driver: 1.73 µs from laser to laser, also across the two firings of a block.
fn makers_timing(block_ns: u32) -> LaserTiming {
    LaserTiming {
        pitch_ns: 1_730,
        second_firing_ns: 27_680,
        block_ns,
    }
}

/// The point of a packet with one return.
fn one_point(mode: ReturnMode, block_ns: u32, first: u16, step: u16, channel: usize) -> Point {
    let mut blocks = turning(first, step);
    blocks[0].echoes[channel] = Echo {
        distance: 4_000,
        intensity: 50,
    };
    let config = DecoderConfig {
        return_mode: mode,
        timing: makers_timing(block_ns),
        limited_view: false,
    };
    let points = decode_with(config, &msop_packet(&blocks, 1, 0)).unwrap();
    assert_eq!(points.len(), 1);
    points[0]
}

#[track_caller]
fn assert_at(point: &Point, expected: [f64; 3], limit_m: f64) {
    for (got, want) in point.position().iter().zip(expected) {
        assert!(
            (f64::from(*got) - want).abs() < limit_m,
            "{point:?} {expected:?}"
        );
    }
}

#[test]
fn worked_points_of_the_makers_rules() {
    let ahead = one_point(ReturnMode::Strongest, 111_120, 0, 40, 0);
    assert_at(&ahead, [9.694238, 0.0, 2.588190], 5e-6);
    assert_eq!((ahead.intensity, ahead.range_m), (50.0, 10.0));

    // The examples cut the rotor's azimuth to whole hundredths of a degree, which at 10 m is up to
    // 1.7 mm.
    let single = one_point(ReturnMode::Strongest, 111_120, 9_000, 40, 20);
    assert_at(&single, [0.681923, -9.936983, 1.218693], 1.8e-3);
    assert!((single.azimuth_deg - (90.1245 - 4.06)).abs() < 1e-3);
    let dual = one_point(ReturnMode::Dual, 55_560, 9_000, 20, 20);
    assert_at(&dual, [0.699265, -9.935778, 1.218693], 1.8e-3);
    assert!((dual.azimuth_deg - (90.0249 - 4.06)).abs() < 1e-3);
}

#[test]
fn the_default_timing_is_that_of_the_recorded_sensor() {
    let mut blocks = turning(0, 20);
    for channel in [0, 15, 16, 31] {
        blocks[11].echoes[channel].distance = 1_000;
    }
    let packet = msop_packet(&blocks, 1, 0);
    let points = decode_with(DecoderConfig::default(), &packet).unwrap();
    let times: Vec<_> = points.iter().map(|p| p.time_offset_ns).collect();
    let block = 11 * 55_560;
    let expected = [0, 23_550, 27_780, 51_330].map(|ns| block + ns);
    assert_eq!(times, expected);
    // Half a block of 0.20° on.
    assert!((points[2].azimuth_deg - points[0].azimuth_deg - 0.10).abs() < 1e-4);
}

#[test]
fn rings_rank_the_lasers_by_elevation() {
    let mut vertical = [0.0; 16];
    for (laser, angle) in vertical.iter_mut().enumerate() {
        // Odd lasers first, then even ones, upwards.
        *angle = if laser % 2 == 1 { -10.0 } else { 5.0 } + laser as f32 * 0.1;
    }
    let rings = Calibration::new(vertical, [0.0; 16]).unwrap().rings();
    assert_eq!(rings[1], 0);
    assert_eq!(rings[15], 7);
    assert_eq!(rings[0], 8);
    assert_eq!(rings[14], 15);
    assert_eq!(Calibration::nominal().rings()[0], 15);
}

#[test]
fn dual_returns_are_told_apart_by_distance_and_brightness() {
    let mut blocks = turning(0, 20);
    let echo = |distance, intensity| Echo {
        distance,
        intensity,
    };
    let pairs = [
        (echo(1_000, 9), echo(1_000, 9)),
        (echo(1_000, 50), echo(2_000, 9)),
        (echo(2_000, 50), echo(1_000, 9)),
        (echo(0, 0), echo(1_000, 9)),
        (echo(0, 0), echo(0, 0)),
    ];
    for (laser, (first, second)) in pairs.into_iter().enumerate() {
        blocks[0].echoes[laser] = first;
        blocks[0].echoes[16 + laser] = second;
    }
    let config = DecoderConfig {
        return_mode: ReturnMode::Dual,
        ..DecoderConfig::default()
    };
    let points = decode_with(config, &msop_packet(&blocks, 1, 0)).unwrap();
    let kinds: Vec<_> = points.iter().map(|p| p.returned).collect();
    let expected = [
        ReturnKind::StrongestAndLast,
        ReturnKind::Strongest,
        ReturnKind::Last,
        ReturnKind::StrongestAndLast,
        ReturnKind::SecondStrongest,
        ReturnKind::StrongestAndLast,
    ];
    assert_eq!(kinds, expected);
}

#[test]
fn packets_that_are_not_what_they_should_be_are_refused_with_what_was_seen() {
    let good = msop_packet(&turning(0, 20), 1, 0);
    let damaged = |at: usize, byte: u8| {
        let mut packet = good;
        packet[at] = byte;
        decode_with(DecoderConfig::default(), &packet).unwrap_err()
    };
    let short = decode_with(DecoderConfig::default(), &good[1..]).unwrap_err();
    assert_eq!(short, PacketError::Length { got: 1_247 });
    assert!(matches!(damaged(0, 0), PacketError::Magic { .. }));
    let flag = PacketError::BlockFlag {
        block: 2,
        got: 0x00EE,
    };
    assert_eq!(damaged(242, 0), flag);
    assert!(matches!(
        damaged(144, 0xFF),
        PacketError::Azimuth { block: 1, .. }
    ));
    assert!(matches!(
        damaged(244, 0x40),
        PacketError::AzimuthStep { block: 2, .. }
    ));
    let stopped = msop_packet(&turning(77, 0), 1, 0);
    let error = decode_with(DecoderConfig::default(), &stopped).unwrap_err();
    assert_eq!(error, PacketError::RotorStopped { azimuth: 77 });
}

#[test]
fn the_head_is_read_in_big_endian() {
    let mut packet = msop_packet(&turning(0, 20), 0x0102_0304, 0);
    packet[20..30].copy_from_slice(&[0, 0, 0x58, 0x6F, 0xD8, 0x54, 0, 3, 0x13, 0x65]);
    let header = MsopHeader::decode(&packet).unwrap();
    assert_eq!(header.counter, 0x0102_0304);
    assert_eq!(header.time_ns, 1_483_724_884_201_573_000);
    packet[26] = 0xFF;
    assert!(matches!(
        MsopHeader::decode(&packet),
        Err(PacketError::Stamp { .. })
    ));
}

#[test]
fn the_writer_is_the_inverse_of_the_decoder() {
    for (mode, packets) in [(ReturnMode::Strongest, 1), (ReturnMode::Dual, 2)] {
        let mut writer = PacketWriter::new(mode);
        let written: Vec<_> = (0..24_u16)
            .filter_map(|n| {
                let echo = |laser: usize| Echo {
                    distance: 1_000 + n * 100 + laser as u16,
                    intensity: laser as u8,
                };
                writer.push(&Firing {
                    azimuth_deg: 359.0 + 0.1 * f64::from(n),
                    time_us: 5_000_000 + u64::from(n) * 28,
                    echoes: core::array::from_fn(echo),
                    second: core::array::from_fn(echo),
                })
            })
            .collect();
        assert_eq!(written.len(), packets);
        let header = MsopHeader::decode(&written[0]).unwrap();
        assert_eq!((header.counter, header.time_ns), (1, 5_000_000_000));
        let blocks = blocks_of(&written[0]).unwrap();
        assert_eq!(msop_packet(&blocks, 1, 5_000_000), written[0]);
        let config = DecoderConfig {
            return_mode: mode,
            ..DecoderConfig::default()
        };
        let points: Vec<_> = written
            .iter()
            .flat_map(|packet| decode_with(config, packet).unwrap())
            .collect();
        assert_eq!(points.len(), 24 * 16);
        for (index, point) in points.iter().enumerate() {
            let raw = 1_000 + index / 16 * 100 + index % 16;
            assert!((f64::from(point.range_m) - 0.0025 * raw as f64).abs() < 1e-4);
        }
    }
}

fn contents() -> DifopContents {
    DifopContents {
        rpm: 600,
        return_mode: ReturnMode::Last,
        sync_source: SyncSource::PtpEndToEnd,
        sync_status: SyncStatus::Ptp,
        time_us: 1_483_724_884_500_000,
        calibration: Some(example_angles()),
    }
}

#[test]
fn a_difop_packet_is_read_field_by_field() {
    let mut packet = difop_packet(&contents());
    // Angles from the manual's example, and one below zero.
    packet[468..471].copy_from_slice(&[0x00, 0x05, 0xD6]);
    packet[564..567].copy_from_slice(&[0x01, 0x01, 0x96]);
    packet[292..298].copy_from_slice(&[1, 2, 3, 4, 5, 6]);
    let difop = Difop::decode(&packet).unwrap();
    assert_eq!((difop.configured_rpm, difop.actual_rpm), (600, 600));
    assert_eq!(difop.sensor_address.octets(), [192, 168, 1, 200]);
    assert_eq!((difop.msop_port, difop.difop_port), (6699, 7788));
    assert_eq!(difop.return_mode, ReturnMode::Last);
    assert_eq!(difop.sync_source, SyncSource::PtpEndToEnd);
    assert_eq!(difop.sync_status, SyncStatus::Ptp);
    assert_eq!(difop.serial, [1, 2, 3, 4, 5, 6]);
    assert_eq!(difop.time_ns, 1_483_724_884_500_000_000);
    assert!(difop.gprmc().is_empty());
    let calibration = difop.calibration.unwrap();
    assert!((calibration.vertical_deg()[0] - 14.94).abs() < 1e-5);
    assert!((calibration.horizontal_deg()[0] + 4.06).abs() < 1e-5);
    assert!((calibration.horizontal_deg()[4] + 4.06).abs() < 1e-5);
}

#[test]
fn a_calibration_with_one_unusable_entry_is_refused_whole() {
    let with = |at: usize, entry: [u8; 3]| {
        let mut packet = difop_packet(&contents());
        packet[at..at + 3].copy_from_slice(&entry);
        Difop::decode(&packet).unwrap().calibration.unwrap_err()
    };
    let missing = CalibrationError::NotCalibrated { laser: 2 };
    assert_eq!(with(474, [0xFF, 0, 0]), missing);
    let sign = CalibrationError::Sign { laser: 1, got: 7 };
    assert_eq!(with(567, [7, 0, 0]), sign);
    assert!(matches!(
        with(468, [0, 0x40, 0]),
        CalibrationError::Range { laser: 0, .. }
    ));
    let blank = DifopContents {
        calibration: None,
        ..contents()
    };
    let blank = Difop::decode(&difop_packet(&blank)).unwrap();
    let expected = CalibrationError::NotCalibrated { laser: 0 };
    assert_eq!(blank.calibration, Err(expected));
}

#[test]
fn difop_packets_that_are_something_else_are_refused() {
    assert_eq!(Difop::decode(&[0; 5]), Err(PacketError::Length { got: 5 }));
    let msop = msop_packet(&turning(0, 20), 1, 0);
    assert!(matches!(
        Difop::decode(&msop),
        Err(PacketError::Magic { .. })
    ));
    let mut packet = difop_packet(&contents());
    packet[300] = 0x99;
    assert_eq!(
        Difop::decode(&packet),
        Err(PacketError::ReturnMode { got: 0x99 })
    );
}

#[test]
fn payloads_are_recognised_by_length_and_markers() {
    let msop = msop_packet(&turning(0, 20), 1, 0);
    assert_eq!(recognise(&msop), Some(PacketKind::Msop));
    assert_eq!(
        recognise(&difop_packet(&contents())),
        Some(PacketKind::Difop)
    );
    assert_eq!(recognise(&msop[..1_247]), None);
    assert_eq!(recognise(&[0; 1_248]), None);
}
