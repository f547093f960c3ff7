//! Writes the seed corpora: a few small inputs per target, made by our own encoders.
//!
//! `cargo run --example make_seeds` in this folder; the seeds lie in `seeds/TARGET`.

use std::fs;
use std::io::Result;
use std::path::Path;

use hachi_hal::{Distortion, Intrinsics, Pose};
use hachi_realsense::encode as d400;
use hachi_realsense::frame as d400_frame;
use hachi_robosense::encode as helios;
use hachi_robosense::packet as helios_packet;
use hachi_unitree::frame as unitree;
use hachi_velodyne::encode as vlp16;
use hachi_velodyne::packet as vlp16_packet;

const SENTENCE: &[u8] = b"$GPRMC,120000.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B\r\n";

fn vlp16_data(mode: vlp16_packet::ReturnMode) -> Vec<u8> {
    let stride = if mode == vlp16_packet::ReturnMode::Dual {
        2
    } else {
        1
    };
    let blocks = std::array::from_fn(|k| vlp16::Block {
        azimuth: (k / stride * 40) as u16,
        echoes: std::array::from_fn(|j| vlp16::Echo {
            distance: 1_000 + (k * 32 + j) as u16,
            reflectivity: j as u8,
        }),
    });
    vlp16::data_packet(&blocks, 3_599_999_000, mode, vlp16_packet::Model::Vlp16).to_vec()
}

fn helios_msop() -> Vec<u8> {
    let blocks = std::array::from_fn(|k| helios::Block {
        azimuth: k as u16 * 20,
        echoes: std::array::from_fn(|j| helios::Echo {
            distance: 1_000 + (k * 32 + j) as u16,
            intensity: j as u8,
        }),
    });
    helios::msop_packet(&blocks, 1, 1_483_724_884_000_000).to_vec()
}

fn helios_difop() -> Vec<u8> {
    helios::difop_packet(&helios::DifopContents {
        rpm: 600,
        return_mode: helios_packet::ReturnMode::Strongest,
        sync_source: helios_packet::SyncSource::Gps,
        sync_status: helios_packet::SyncStatus::Gps,
        time_us: 1_483_724_884_000_000,
        calibration: Some(helios_packet::Calibration::nominal()),
    })
    .to_vec()
}

/// An IPv4 datagram to port 2368 with four bytes, or one of two fragments of it.
fn ipv4(flags_and_offset: u16, part: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x45, 0, 0, 20 + part.len() as u8, 0, 9];
    bytes.extend(flags_and_offset.to_be_bytes());
    bytes.extend([64, 17, 0, 0, 192, 168, 1, 201, 255, 255, 255, 255]);
    bytes.extend(part);
    bytes
}

const UDP: [u8; 12] = [9, 64, 9, 64, 0, 12, 0, 0, 1, 2, 3, 4];

fn pcap(link: u32, frames: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = 0xA1B2_3C4D_u32.to_le_bytes().to_vec();
    bytes.extend([2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0]);
    bytes.extend(link.to_le_bytes());
    for frame in frames {
        for word in [100, 0, frame.len() as u32, frame.len() as u32] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(frame);
    }
    bytes
}

fn pcapng(frame: &[u8]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let mut padded = body.to_vec();
        padded.resize(body.len().next_multiple_of(4), 0);
        let len = (12 + padded.len() as u32).to_le_bytes();
        [&kind.to_le_bytes()[..], &len, &padded, &len].concat()
    };
    let mut section = vec![0x4D, 0x3C, 0x2B, 0x1A, 1, 0, 0, 0];
    section.extend([0xFF; 8]);
    let interface = [101, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0];
    let mut packet = [[0; 4], [0; 4], [5; 4]].concat();
    packet.extend((frame.len() as u32).to_le_bytes());
    packet.extend((frame.len() as u32).to_le_bytes());
    packet.extend(frame);
    [
        block(0x0A0D_0D0A, &section),
        block(1, &interface),
        block(6, &packet),
    ]
    .concat()
}

/// Commands for the scan targets: many unchanged packets 1.3 ms (0.7 ms) apart, then `packet`
/// whole, then some more.
fn stream(ticks: u8, packet: &[u8]) -> Vec<u8> {
    let go_on = [0, 32 + ticks].repeat(100);
    let len = (packet.len() as u16).to_be_bytes();
    let mut bytes = vec![0, 0];
    bytes.extend(&go_on);
    bytes.extend([0xFF, 32 + ticks]);
    bytes.extend(len);
    bytes.extend(packet);
    bytes.extend(&go_on);
    bytes
}

/// A robot that stands, as its states have it: high level, low level.
fn unitree_states(layout: &unitree::Layout) -> [Vec<u8>; 2] {
    let mut high = unitree::HighState::of(layout);
    high.body.imu.quaternion[0] = 1.0;
    high.body.imu.accelerometer[2] = 9.8;
    for (i, motor) in high.body.motors.iter_mut().enumerate() {
        motor.angle = [0.0, 0.9, -1.8][i % 3];
        motor.torque = [0.5, 1.0, 8.0][i % 3];
    }
    let mut low = unitree::LowState::of(layout);
    low.body = high.body.clone();
    low.tick_ms = 12_345;
    let form = unitree::CheckForm::Transformed;
    [
        high.encode(form).as_bytes().to_vec(),
        low.encode(layout).as_bytes().to_vec(),
    ]
}

/// A walking command and motors that are asked nothing.
fn unitree_commands(layout: &unitree::Layout) -> [Vec<u8>; 2] {
    let form = unitree::CheckForm::Plain;
    let high = unitree::HighCmd {
        mode: 2,
        gait: 1,
        velocity: [0.3, -0.1],
        ..unitree::HighCmd::default()
    };
    let high = high.encode(layout, form).expect("the numbers are finite");
    let low = unitree::LowCmd::default();
    let (low, _) = low.encode(layout, form).expect("the numbers are finite");
    [high.as_bytes().to_vec(), low.as_bytes().to_vec()]
}

/// A camera's tables, one answer, one metadata buffer, one picture; and commands for a stream of
/// pictures with their metadata.
fn realsense() -> Vec<Vec<u8>> {
    let optics = Intrinsics {
        width: 848,
        height: 480,
        focal: [424.2, 424.3],
        centre: [423.4, 236.1],
        distortion: Distortion::BrownConrady([-0.05, 0.06, 0.0, 0.001, -0.02]),
    };
    let timing = d400_frame::CaptureTiming {
        sensor_us: Some(7_000),
        exposure_us: Some(6_000),
        ..d400_frame::CaptureTiming::default()
    };
    let said = d400_frame::FrameMetadata {
        device_us: Some(10_000),
        timing,
        depth: Some(d400_frame::DepthState::default()),
        ..d400_frame::FrameMetadata::default()
    };
    let (metadata, len) = d400::metadata(&said);
    let mut picture = vec![8, 0, 4, 0, 16, 0];
    picture.extend([0xE8, 3].repeat(32));
    let opcode = hachi_realsense::monitor::Opcode::ReadCalibration;
    let decoded = [
        d400::depth_table(0.095, &[optics]).to_vec(),
        d400::color_table(&optics, &Pose::translation(0.06, 0.0, 0.0)).to_vec(),
        d400::answer(opcode, &[1, 2, 3]).to_vec(),
        metadata[..len].to_vec(),
        picture,
    ];
    // Depth, its metadata, colour, its metadata; 33 ms in four steps.
    let pair = [0x0C, 80, 0x0E, 80, 0x0D, 80, 0x0F, 80];
    let streamed = [vec![1, 0, 0, 0], pair.repeat(12)].concat();
    let inputs = decoded.into_iter().map(|bytes| with_switches(0, bytes));
    inputs.chain([streamed]).collect()
}

/// Numbers of a walk: bytes around the middle stand for joints near zero.
fn leg_numbers() -> Vec<u8> {
    (0..600_u32).map(|i| (90 + i * 37 % 75) as u8).collect()
}

fn with_switches(switches: u8, payload: Vec<u8>) -> Vec<u8> {
    [vec![switches], payload].concat()
}

fn main() -> Result<()> {
    use vlp16_packet::ReturnMode::{Dual, Strongest};
    let position = vlp16_packet::PositionPacket::new(77, vlp16_packet::Pps::Locked, SENTENCE);
    let position = vlp16::position_packet(&position).to_vec();
    let ethernet = [vec![1; 12], vec![8, 0], ipv4(0, &UDP)].concat();
    let fragments = [ipv4(0x2000, &UDP[..8]), ipv4(1, &UDP[8..])];
    let [go1_high, go1_low] = unitree_states(&unitree::Layout::GO1);
    let [b1_high, b1_low] = unitree_states(&unitree::Layout::B1);
    let [go1_walk, go1_idle] = unitree_commands(&unitree::Layout::GO1);
    let [b1_walk, _] = unitree_commands(&unitree::Layout::B1);
    let seeds: [(&str, Vec<Vec<u8>>); 14] = [
        ("realsense", realsense()),
        (
            "velodyne_packet",
            vec![
                with_switches(0, vlp16_data(Strongest)),
                with_switches(3, vlp16_data(Dual)),
            ],
        ),
        ("velodyne_position", vec![position.clone()]),
        (
            "velodyne_scans",
            vec![stream(13, &vlp16_data(Dual)), stream(13, &position)],
        ),
        ("robosense_msop", vec![with_switches(0, helios_msop())]),
        ("robosense_difop", vec![helios_difop()]),
        (
            "robosense_scans",
            vec![stream(7, &helios_difop()), stream(7, &helios_msop())],
        ),
        (
            "capture",
            vec![
                pcap(1, &[ethernet]),
                pcap(101, &fragments),
                pcapng(&ipv4(0, &UDP)),
            ],
        ),
        (
            "unitree_state",
            vec![
                with_switches(0, go1_high),
                with_switches(1, b1_high),
                with_switches(0, go1_low),
                with_switches(1, b1_low),
            ],
        ),
        (
            "unitree_command",
            vec![
                with_switches(0, go1_walk),
                with_switches(1, b1_walk),
                with_switches(0, go1_idle),
            ],
        ),
        ("leg_tracker", vec![leg_numbers()]),
        (
            "detector_outputs",
            (0..4)
                .map(|kind| with_switches(kind, leg_numbers()))
                .collect(),
        ),
        (
            "mot_text",
            vec![
                b"1,-1,10,20,30,60,0.9,-1,-1,-1\n2,-1,12,20,30,60,0.8\n3,-1,14,20,30,60,0.9\n"
                    .to_vec(),
                b"1 1 5 5 10 20 1 1 1\n1,2,40,5,10,20,0,7,0.5\n\n# end\n".to_vec(),
            ],
        ),
        (
            "nmea",
            vec![
                SENTENCE.to_vec(),
                b"GPGGA,123519.5,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,".to_vec(),
            ],
        ),
    ];
    for (target, inputs) in seeds {
        let folder = Path::new("seeds").join(target);
        fs::create_dir_all(&folder)?;
        for (number, bytes) in inputs.iter().enumerate() {
            fs::write(folder.join(number.to_string()), bytes)?;
        }
    }
    Ok(())
}
