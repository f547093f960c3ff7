//! Any bytes as what a RealSense says: every decoder, and the driver over a camera whose buffers,
//! tables and answers are the fuzzer's. Frames keep the promise of `RgbdCamera`.
#![no_main]

use hachi_hal::conformance::FramePromise;
use hachi_hal::{RgbdCamera, RgbdImages, Stamp};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::calibration::{ColorCalibration, DepthCalibration};
use hachi_realsense::controls::{self, Query, Selector};
use hachi_realsense::device::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream,
};
use hachi_realsense::frame::{
    CaptureTiming, DepthState, FrameMetadata, Layout, YuyvImage, Z16Image,
};
use hachi_realsense::monitor::{Command, DeviceInfo, MONITOR_LEN, Opcode, depth_unit_m};
use hachi_realsense::{Model, RealSense, RealSenseConfig, encode};
use libfuzzer_sys::fuzz_target;

const WIDTH: u32 = 16;
const HEIGHT: u32 = 8;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// Every decoder on the same bytes.
fn decode(bytes: &[u8]) {
    let _ = (controls::decode(bytes), depth_unit_m(bytes));
    if let Ok(info) = DeviceInfo::decode(bytes) {
        assert_eq!(DeviceInfo::decode(&encode::device_info(&info)), Ok(info));
    }
    for command in [
        Command::DEVICE_INFO,
        Command::DEPTH_TABLE,
        Command::calibration(25),
    ] {
        let _ = command.answer(bytes);
    }
    if let Ok(metadata) = FrameMetadata::decode(bytes) {
        let (again, len) = encode::metadata(&metadata);
        let again = FrameMetadata::decode(&again[..len]).unwrap();
        assert_eq!(again.exposed_us(), metadata.exposed_us());
        assert_eq!(again.depth, metadata.depth);
    }
    if let Some((head, picture)) = bytes.split_first_chunk::<6>() {
        let value = |at: usize| u32::from(u16::from_le_bytes([head[at], head[at + 1]]));
        let layout = Layout {
            width: value(0) % 64,
            height: value(2) % 64,
            stride: value(4) % 256,
        };
        if let Ok(image) = Z16Image::new(picture, layout) {
            image.copy_to(&mut vec![0; layout.pixels()]).unwrap();
        }
        if let Ok(image) = YuyvImage::new(picture, layout) {
            image.to_rgb(&mut vec![0; 3 * layout.pixels()]).unwrap();
        }
    }
    calibration(bytes);
}

/// Tables as they are, and with a checksum that is right.
fn calibration(bytes: &[u8]) {
    for table in [DepthCalibration::TABLE, ColorCalibration::TABLE] {
        let mut sealed = bytes.to_vec();
        if sealed.len() >= 16 {
            encode::seal(&mut sealed, table);
        }
        for bytes in [bytes, &sealed] {
            let depth = DepthCalibration::decode(bytes).ok();
            let color = ColorCalibration::decode(bytes).ok();
            for (width, height) in [(848, 480), (848, 100), (256, 144), (424, 240), (960, 270)] {
                let depth = depth.and_then(|d| d.intrinsics(width, height).ok());
                let color = color.and_then(|c| c.intrinsics(width, height).ok());
                assert!(depth.into_iter().chain(color).all(|i| i.is_sound()));
            }
        }
    }
}

/// A camera that says what the fuzzer wants it to.
struct Fuzzed {
    bytes: Vec<u8>,
    at: usize,
    /// Where a table is changed, and to what.
    change: (usize, u8),
    asked: (u32, u32),
    sequence: [u32; 2],
    us: u32,
    now_ns: i64,
}

impl Fuzzed {
    fn next(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied();
        self.at += 1;
        byte
    }
}

struct Socket(Option<Fuzzed>);

impl CameraPort for Socket {
    type Link = Fuzzed;
    fn open(&mut self, _: &CameraRequest, _: Stamp) -> Result<Option<Fuzzed>, LinkError> {
        Ok(self.0.take())
    }
}

impl CameraLink for Fuzzed {
    fn model(&self) -> Model {
        Model::D415
    }
    fn layout(&self, _: Stream) -> Layout {
        Layout::packed(WIDTH, HEIGHT)
    }
    fn has_metadata(&self, _: Stream) -> bool {
        self.change.1 & 1 == 0
    }
    fn set_unit(&mut self, selector: Selector, bytes: &[u8]) -> Result<(), LinkError> {
        if selector == Selector::Monitor {
            let value = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            self.asked = (value(4), value(8));
        }
        Ok(())
    }
    fn get_unit(&mut self, _: Selector, query: Query, bytes: &mut [u8]) -> Result<(), LinkError> {
        if bytes.len() != MONITOR_LEN {
            bytes.fill(if query == Query::Maximum { 0xFF } else { 0 });
            return Ok(());
        }
        let mut table = vec![0; 576];
        let opcode = match self.asked {
            (0x10, _) => Opcode::DeviceInfo,
            (0x2C, _) => {
                table[..4].copy_from_slice(&1_000_u32.to_le_bytes());
                Opcode::ReadAdvanced
            }
            (_, kind) => {
                // Half a metre of lens in each number that matters, then the fuzzer's change.
                for (i, number) in table.chunks_exact_mut(4).enumerate() {
                    let value = [0.9_f32, 0.0, 0.01, 0.0, 0.8, 0.02][i % 6];
                    number.copy_from_slice(&value.to_le_bytes());
                }
                table[160..164].copy_from_slice(&55.0_f32.to_le_bytes());
                for index in 0..9 {
                    let value = if index % 4 == 0 { 1.0_f32 } else { 0.0 };
                    table[184 + 4 * index..188 + 4 * index].copy_from_slice(&value.to_le_bytes());
                }
                for (i, number) in table[256..512].chunks_exact_mut(4).enumerate() {
                    let value = [900.0_f32, 910.0, 960.0, 540.0][i % 4];
                    number.copy_from_slice(&value.to_le_bytes());
                }
                let (at, value) = self.change;
                table[at % 576] ^= value >> 1;
                encode::seal(&mut table, kind as u16);
                Opcode::ReadCalibration
            }
        };
        bytes.copy_from_slice(&encode::answer(opcode, &table));
        Ok(())
    }
    fn set_video(&mut self, _: Stream, _: u32, _: i32) -> Result<(), LinkError> {
        Ok(())
    }
    fn start(&mut self) -> Result<(), LinkError> {
        Ok(())
    }
    fn dequeue(&mut self, _: Stamp, take: &mut dyn FnMut(Buffer<'_>)) -> Result<bool, LinkError> {
        let (Some(command), Some(value)) = (self.next(), self.next()) else {
            return Ok(false);
        };
        let stream = Stream::BOTH[usize::from(command & 1)];
        let part = if command & 2 == 0 {
            Part::Picture
        } else {
            Part::Metadata
        };
        let sequence = &mut self.sequence[stream.index()];
        match command >> 2 & 7 {
            0 => *sequence = sequence.wrapping_add(u32::from(value)),
            1 => self.us = self.us.wrapping_add(u32::from(value) << 24),
            2 => self.now_ns += (i64::from(value) - 128) * 50_000_000,
            _ if part == Part::Picture => *sequence = sequence.wrapping_add(1),
            _ => {}
        }
        self.us = self.us.wrapping_add(u32::from(value) * 100);
        self.now_ns += i64::from(value) * 100_000;
        let mut bytes = match part {
            Part::Picture => vec![value; 2 * PIXELS],
            Part::Metadata => {
                let said = FrameMetadata {
                    device_us: (value & 1 == 0).then_some(self.us),
                    timing: CaptureTiming {
                        sensor_us: (value & 2 == 0).then_some(self.us),
                        exposure_us: (value & 4 == 0).then_some(u32::MAX),
                        ..CaptureTiming::default()
                    },
                    depth: (stream == Stream::Depth).then(DepthState::default),
                    ..FrameMetadata::default()
                };
                let (bytes, len) = encode::metadata(&said);
                bytes[..len].to_vec()
            }
        };
        if command & 0x20 != 0 {
            bytes.truncate(usize::from(value));
        }
        take(Buffer {
            stream,
            part,
            sequence: self.sequence[stream.index()],
            received: Stamp::from_nanos(self.now_ns),
            damaged: command & 0xC0 == 0xC0,
            bytes: &bytes,
        });
        Ok(true)
    }
}

fn stream(at: u16, change: u8, bytes: &[u8]) {
    let camera = Fuzzed {
        bytes: bytes.to_vec(),
        at: 0,
        change: (usize::from(at), change),
        asked: (0, 0),
        sequence: [0; 2],
        us: u32::MAX - 100_000,
        now_ns: 1_700_000_000_000_000_000,
    };
    let mut camera = RealSense::new(Socket(Some(camera)), RealSenseConfig::default());
    let (mut depth, mut color) = (vec![0; PIXELS], vec![0; 3 * PIXELS]);
    let mut aligned = vec![0; PIXELS];
    let mut promise = FramePromise::default();
    loop {
        let images = RgbdImages {
            depth: &mut depth,
            color: &mut color,
        };
        match camera.read_frame(images, Stamp::from_nanos(i64::MAX)) {
            Ok(Some(header)) => {
                let geometry = camera.geometry().copied();
                promise
                    .check(&header, geometry.as_ref(), [PIXELS, 3 * PIXELS])
                    .unwrap();
                depth_to_color(&geometry.unwrap(), &depth, &mut aligned).unwrap();
            }
            Ok(None) | Err(_) => return,
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&[switch, high, low, change], bytes)) = data.split_first_chunk() else {
        return;
    };
    if switch & 1 == 0 {
        decode(&data[1..]);
    } else {
        stream(u16::from_be_bytes([high, low]), change, bytes);
    }
});
