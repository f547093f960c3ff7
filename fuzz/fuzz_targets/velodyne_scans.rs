//! Any stream of packets through the VLP-16 driver: turns that keep the promise of `LidarScans`.
#![no_main]

#[path = "support/stream.rs"]
mod stream;

use hachi_hal::conformance::ScanPromise;
use hachi_hal::{LidarScans, Stamp};
use hachi_velodyne::encode::{Block, Echo, data_packet};
use hachi_velodyne::packet::{DATA_LEN, DecoderConfig, Model, ReturnMode};
use hachi_velodyne::{StampSource, VelodyneConfig, VelodyneScans};
use libfuzzer_sys::fuzz_target;

/// Moves the twelve azimuths and the stamp of a data packet on by one packet.
fn advance(packet: &mut [u8]) {
    if packet.len() != DATA_LEN {
        return;
    }
    for block in packet[..1_200].chunks_exact_mut(100) {
        let azimuth = u16::from_le_bytes([block[2], block[3]]);
        let next = (u32::from(azimuth) + 480) % 36_000;
        block[2..4].copy_from_slice(&(next as u16).to_le_bytes());
    }
    let stamp = u32::from_le_bytes([packet[1_200], packet[1_201], packet[1_202], packet[1_203]]);
    let next = stamp.wrapping_add(1_327) % 3_600_000_000;
    packet[1_200..1_204].copy_from_slice(&next.to_le_bytes());
}

fuzz_target!(|data: &[u8]| {
    let Some((&[switches, cut], bytes)) = data.split_first_chunk() else {
        return;
    };
    let blocks = core::array::from_fn(|k| Block {
        azimuth: k as u16 * 40,
        echoes: [Echo {
            distance: 2_500,
            reflectivity: 40,
        }; 32],
    });
    let mode = if switches & 1 != 0 {
        ReturnMode::Last
    } else {
        ReturnMode::Strongest
    };
    let template = data_packet(&blocks, 3_599_900_000, mode, Model::Vlp16).to_vec();
    let config = VelodyneConfig {
        decoder: DecoderConfig {
            limited_view: switches & 2 != 0,
            ..DecoderConfig::default()
        },
        cut_angle_deg: f32::from(cut) * 1.5,
        stamps: if switches & 4 != 0 {
            StampSource::SensorUtc
        } else {
            StampSource::Arrival
        },
    };
    let source = stream::Turning::new(bytes, template, advance);
    let mut lidar = VelodyneScans::new(source, config);
    let (mut points, mut promise) = (Vec::new(), ScanPromise::default());
    while !lidar.at_end() {
        let Ok(header) = lidar.read_scan(&mut points, Stamp::from_nanos(i64::MAX));
        if let Some(header) = header {
            promise.check(&header, &points).unwrap();
        }
    }
});
