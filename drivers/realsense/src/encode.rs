//! The other direction: what a camera says, as its own bytes.
//!
//! In: pictures, times, calibration. Out: buffers, tables and answers that the decoders read back,
//! byte for byte what a camera would send. The simulated camera, tests and fuzz targets share
//! this; pictures come as bytes from whoever renders them.

use hachi_hal::{Distortion, Intrinsics, Pose};

use crate::calibration::{CRC, ColorCalibration, DepthCalibration, TABLE_HEAD, color, depth};
use crate::frame::metadata::{
    CONTROL_AT, DEPTH_CONTROL, HAS_DEVICE_TIME, HAS_SOURCE_CLOCK, HEADER_AT, TIMING, TIMING_AT,
};
use crate::frame::{FrameMetadata, METADATA_COLOR_LEN, METADATA_DEPTH_LEN};
use crate::monitor::{DeviceInfo, LENGTH_AT, MONITOR_LEN, Opcode, PAYLOAD_AT};

/// Counts as the bytes of a packed Z16 image; what does not fit on either side is left out.
pub fn z16(counts: &[u16], bytes: &mut [u8]) {
    for (pixel, count) in bytes.chunks_exact_mut(2).zip(counts) {
        pixel.copy_from_slice(&count.to_le_bytes());
    }
}

/// Luma and differences of a colour in ITU-R BT.601 studio range.
pub fn yuv_of_rgb([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(|c| f64::from(c) / 255.0);
    let luma = 0.299 * r + 0.587 * g + 0.114 * b;
    let blue = (b - luma) / 1.772;
    let red = (r - luma) / 1.402;
    // The results lie within 16 to 240.
    [
        16.0 + 219.0 * luma,
        128.0 + 224.0 * blue,
        128.0 + 224.0 * red,
    ]
    .map(|v| libm::round(v) as u8)
}

/// Colours (three bytes a pixel) as the bytes of a packed YUYV image: two neighbours share the mean
/// of their differences. What does not fit on either side is left out.
pub fn yuyv(rgb: &[u8], bytes: &mut [u8]) {
    for (pair, colors) in bytes.chunks_exact_mut(4).zip(rgb.chunks_exact(6)) {
        let [y0, u0, v0] = yuv_of_rgb([colors[0], colors[1], colors[2]]);
        let [y1, u1, v1] = yuv_of_rgb([colors[3], colors[4], colors[5]]);
        pair.copy_from_slice(&[y0, u0.midpoint(u1), y1, v0.midpoint(v1)]);
    }
}

/// A metadata buffer of the depth or colour stream and how many of its bytes are used.
pub fn metadata(said: &FrameMetadata) -> ([u8; METADATA_COLOR_LEN], usize) {
    let mut bytes = [0; METADATA_COLOR_LEN];
    let len = match said.depth {
        Some(_) => METADATA_DEPTH_LEN,
        None => METADATA_COLOR_LEN,
    };
    bytes[..8].copy_from_slice(&said.host_ns.to_le_bytes());
    let header = &mut bytes[HEADER_AT..len];
    header[0] = header.len() as u8;
    header[1] = HAS_SOURCE_CLOCK | if said.damaged { 0x40 } else { 0 };
    if let Some(us) = said.device_us {
        header[1] |= HAS_DEVICE_TIME;
        header[2..6].copy_from_slice(&us.to_le_bytes());
    }
    let timing = &said.timing;
    block(
        &mut header[TIMING_AT..TIMING_AT + 40],
        TIMING,
        &[
            timing.frame_counter,
            timing.sensor_us,
            timing.readout_us,
            timing.exposure_us,
            timing.interval_us,
            timing.latency_us,
        ],
    );
    if let Some(depth) = &said.depth {
        let control = &mut header[CONTROL_AT..CONTROL_AT + 60];
        block(
            control,
            DEPTH_CONTROL,
            &[
                depth.gain,
                depth.exposure_us,
                depth.laser_power_mw,
                depth.auto_exposure.map(u32::from),
            ],
        );
        if let Some(emitter) = depth.emitter {
            control[12] |= 0x80;
            control[56] = emitter;
        }
    }
    (bytes, len)
}

fn block(bytes: &mut [u8], kind: u32, values: &[Option<u32>]) {
    let size = bytes.len() as u32;
    let mut put = |at: usize, value: u32| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    put(0, kind);
    put(4, size);
    put(8, 1);
    let mut mask = 0;
    for (index, value) in values.iter().enumerate() {
        if let Some(value) = value {
            mask |= 1 << index;
            put(16 + 4 * index, *value);
        }
    }
    put(12, mask);
}

/// An answer of the hardware monitor. A payload longer than it can carry is cut.
pub fn answer(opcode: Opcode, payload: &[u8]) -> [u8; MONITOR_LEN] {
    let mut bytes = [0; MONITOR_LEN];
    let payload = &payload[..payload.len().min(LENGTH_AT - PAYLOAD_AT)];
    bytes[..4].copy_from_slice(&opcode.number().to_le_bytes());
    bytes[PAYLOAD_AT..PAYLOAD_AT + payload.len()].copy_from_slice(payload);
    bytes[LENGTH_AT..].copy_from_slice(&(payload.len() as u32).to_le_bytes());
    bytes
}

/// A refusal of the hardware monitor.
pub fn refusal(code: i32) -> [u8; MONITOR_LEN] {
    let mut bytes = [0; MONITOR_LEN];
    bytes[..4].copy_from_slice(&code.to_le_bytes());
    bytes
}

/// What the camera says of itself, as the payload of an answer.
pub fn device_info(info: &DeviceInfo) -> [u8; DeviceInfo::NEEDED] {
    let mut bytes = [0; DeviceInfo::NEEDED];
    for (i, part) in info.firmware.iter().enumerate() {
        bytes[DeviceInfo::FIRMWARE_AT + 3 - i] = *part;
    }
    bytes[DeviceInfo::SERIAL_AT..].copy_from_slice(&info.serial);
    bytes
}

/// Calibration table 25 of a stereo pair with this baseline and these pictures' intrinsics. Sizes
/// that the table has no place for are left out.
pub fn depth_table(baseline_m: f64, pictures: &[Intrinsics]) -> [u8; 576] {
    let mut bytes = [0; 576];
    let mut put = |at: usize, value: f64| {
        bytes[at..at + 4].copy_from_slice(&(value as f32).to_le_bytes());
    };
    put(depth::BASELINE_AT, baseline_m * -1e3);
    for picture in pictures {
        let size = (picture.width, picture.height);
        if let Some(index) = depth::SIZES.iter().position(|&s| s == size) {
            let entry = picture.focal.iter().chain(&picture.centre);
            for (i, value) in entry.enumerate() {
                put(depth::ENTRIES_AT + 16 * index + 4 * i, *value);
            }
        }
    }
    seal(&mut bytes, DepthCalibration::TABLE);
    bytes
}

/// Calibration table 32 of a colour camera with these intrinsics, at this place.
pub fn color_table(picture: &Intrinsics, depth_from_color: &Pose) -> [u8; 256] {
    let mut bytes = [0; 256];
    let mut put = |at: usize, value: f64| {
        bytes[at..at + 4].copy_from_slice(&(value as f32).to_le_bytes());
    };
    let half = [picture.width, picture.height].map(|v| f64::from(v) / 2.0);
    let [focal, centre] = [picture.focal, picture.centre];
    for (index, value) in [
        (0, focal[0] / half[0]),
        (2, centre[0] / half[0] - 1.0),
        (4, focal[1] / half[1]),
        (5, centre[1] / half[1] - 1.0),
        (8, 1.0),
    ] {
        put(color::INTRINSIC_AT + 4 * index, value);
    }
    if let Distortion::BrownConrady(k) = picture.distortion {
        for (i, value) in k.iter().enumerate() {
            put(color::DISTORTION_AT + 4 * i, *value);
        }
    }
    let rotation = depth_from_color.rotation.to_rotation_matrix();
    for (i, value) in rotation.matrix().iter().enumerate() {
        put(color::ROTATION_AT + 4 * i, *value);
    }
    for (i, value) in depth_from_color.translation.vector.iter().enumerate() {
        put(color::TRANSLATION_AT + 4 * i, value * -1e3);
    }
    for (i, value) in [picture.width, picture.height].into_iter().enumerate() {
        let at = color::SIZE_AT + 2 * i;
        bytes[at..at + 2].copy_from_slice(&(value as u16).to_le_bytes());
    }
    seal(&mut bytes, ColorCalibration::TABLE);
    bytes
}

/// Writes a table's header over its contents.
pub fn seal(bytes: &mut [u8], table: u16) {
    let contents = bytes.len() - TABLE_HEAD;
    let checksum = CRC.checksum(&bytes[TABLE_HEAD..]);
    // The version, the one big-endian number: 3.3.
    bytes[..2].copy_from_slice(&[3, 3]);
    bytes[2..4].copy_from_slice(&table.to_le_bytes());
    bytes[4..8].copy_from_slice(&(contents as u32).to_le_bytes());
    bytes[12..16].copy_from_slice(&checksum.to_le_bytes());
}
