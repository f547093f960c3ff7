//! Any stream of packets through the RS-Helios-16P driver: turns that keep the promise of
//! `LidarScans`.
#![no_main]

#[path = "support/stream.rs"]
mod stream;

use hachi_hal::conformance::ScanPromise;
use hachi_hal::{LidarScans, Stamp};
use hachi_robosense::encode::{Block, Echo, msop_packet};
use hachi_robosense::packet::{Calibration, MSOP_MAGIC, PACKET_LEN, ReturnMode};
use hachi_robosense::{CalibrationSource, RobosenseConfig, RobosenseScans};
use libfuzzer_sys::fuzz_target;

/// Moves azimuths, counter and stamp of an MSOP packet on by one packet.
fn advance(packet: &mut [u8]) {
    if packet.len() != PACKET_LEN || !packet.starts_with(&MSOP_MAGIC) {
        return;
    }
    for block in packet[42..1_242].chunks_exact_mut(100) {
        let azimuth = u16::from_be_bytes([block[2], block[3]]);
        let next = (u32::from(azimuth) + 240) % 36_000;
        block[2..4].copy_from_slice(&(next as u16).to_be_bytes());
    }
    for (at, step) in [(12, 1_u32), (26, 667)] {
        let word = [packet[at], packet[at + 1], packet[at + 2], packet[at + 3]];
        let next = u32::from_be_bytes(word).wrapping_add(step);
        packet[at..at + 4].copy_from_slice(&next.to_be_bytes());
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&[switches, cut], bytes)) = data.split_first_chunk() else {
        return;
    };
    let blocks = core::array::from_fn(|k| Block {
        azimuth: k as u16 * 20,
        echoes: [Echo {
            distance: 2_000,
            intensity: 40,
        }; 32],
    });
    let config = RobosenseConfig {
        calibration: if switches & 1 != 0 {
            CalibrationSource::Fixed(Calibration::nominal())
        } else {
            CalibrationSource::Difop
        },
        return_mode: (switches & 2 != 0).then_some(ReturnMode::Dual),
        limited_view: switches & 4 != 0,
        cut_angle_deg: f32::from(cut) * 1.5,
        ..RobosenseConfig::default()
    };
    let template = msop_packet(&blocks, 7, 1_483_724_884_000_000).to_vec();
    let source = stream::Turning::new(bytes, template, advance);
    let mut lidar = RobosenseScans::new(source, config);
    let (mut points, mut promise) = (Vec::new(), ScanPromise::default());
    while !lidar.at_end() {
        let Ok(header) = lidar.read_scan(&mut points, Stamp::from_nanos(i64::MAX));
        if let Some(header) = header {
            promise.check(&header, &points).unwrap();
        }
    }
});
