//! Frames of a real RealSense D435 through the driver: its depth images, their times, and the
//! alignment to its colour camera against librealsense's.
//!
//! Reads `rgbd/realsense_single.bag` under `HACHI_DATA` and says that it skips where that is unset.
#![allow(clippy::print_stdout, reason = "says what is skipped")]

mod ros1;

use hachi_hal::{
    Distortion, Intrinsics, Pose, RgbdCamera, RgbdGeometry, RgbdHeader, RgbdImages, Stamp,
};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::controls::{Query, Selector};
use hachi_realsense::device::simulated::Firmware;
use hachi_realsense::device::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream, StreamFormat,
};
use hachi_realsense::frame::{CaptureTiming, DepthState, FrameMetadata, Layout};
use hachi_realsense::monitor::DeviceInfo;
use hachi_realsense::{Model, RealSense, RealSenseConfig, encode};
use ros1::Message;

const PIXELS: usize = 640 * 480;
const INFO: DeviceInfo = DeviceInfo {
    firmware: [5, 9, 14, 0],
    serial: [0x72, 0x86, 0x12, 0x07, 0x02, 0x59],
};

/// The recording, or `None` with a word about it.
fn recording() -> Option<Vec<Message>> {
    let Some(folder) = std::env::var_os("HACHI_DATA") else {
        println!("HACHI_DATA is not set: skipped");
        return None;
    };
    let path = std::path::Path::new(&folder).join("rgbd/realsense_single.bag");
    Some(ros1::messages(&std::fs::read(path).unwrap()))
}

/// Numbers of one of the recording's cameras.
fn intrinsics(messages: &[Message], topic: &str) -> Intrinsics {
    let message = ros1::one(messages, topic, "camera_info");
    // Header, then height and width, then the model's name, five coefficients, and K.
    let mut reader = ros1::Reader::after_header(&message.data);
    let (height, width) = (reader.u32(), reader.u32());
    reader.string();
    let coefficients: Vec<f64> = (0..reader.u32()).map(|_| reader.f64()).collect();
    assert_eq!(coefficients, [0.0; 5]);
    let k: [f64; 9] = std::array::from_fn(|_| reader.f64());
    Intrinsics {
        width,
        height,
        focal: [k[0], k[4]],
        centre: [k[2], k[5]],
        distortion: Distortion::None,
    }
}

fn geometry(messages: &[Message]) -> RgbdGeometry {
    let tf = ros1::one(messages, "Color_0/tf", "");
    let mut reader = ros1::Reader::new(&tf.data);
    let t: [f64; 3] = std::array::from_fn(|_| reader.f64());
    let q: [f64; 4] = std::array::from_fn(|_| reader.f64());
    let rotation = nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]);
    let unit = ros1::one(messages, "Depth Units", "value");
    RgbdGeometry {
        depth: intrinsics(messages, "Depth_0"),
        color: intrinsics(messages, "Color_0"),
        color_from_depth: Pose::from_parts(
            nalgebra::Translation3::new(t[0], t[1], t[2]),
            nalgebra::UnitQuaternion::from_quaternion(rotation),
        ),
        depth_unit_m: f64::from(f32::from_le_bytes(unit.data[..4].try_into().unwrap())),
    }
}

/// The pixels of a stream's images.
fn images(messages: &[Message], topic: &str) -> Vec<Vec<u8>> {
    let of = messages
        .iter()
        .filter(|m| m.topic.contains(topic) && m.topic.ends_with("image/data"));
    of.map(|m| {
        let mut reader = ros1::Reader::after_header(&m.data);
        let size = (reader.u32(), reader.u32());
        assert_eq!(size, (480, 640));
        reader.string();
        reader.skip(5);
        reader.bytes()
    })
    .collect()
}

/// The metadata of a stream's images as the camera sent them, from the values that were recorded.
fn metadata(messages: &[Message], topic: &str) -> Vec<FrameMetadata> {
    let mut frames: Vec<FrameMetadata> = Vec::new();
    let of = messages
        .iter()
        .filter(|m| m.topic.contains(topic) && m.topic.ends_with("image/metadata"));
    for message in of {
        let mut reader = ros1::Reader::new(&message.data);
        let (key, value) = (reader.string(), reader.string());
        if key == "system_time" {
            frames.push(FrameMetadata {
                depth: topic.contains("Depth").then(DepthState::default),
                ..FrameMetadata::default()
            });
        }
        let frame = frames.last_mut().unwrap();
        let number = value.parse().ok();
        let slot: &mut CaptureTiming = &mut frame.timing;
        match key.as_str() {
            "Frame Timestamp" => frame.device_us = number,
            "Sensor Timestamp" => slot.sensor_us = number,
            "Frame Counter" => slot.frame_counter = number,
            "Actual Exposure" => slot.exposure_us = number,
            _ => {}
        }
    }
    frames
}

#[test]
fn real_depth_seen_from_the_colour_camera_is_where_librealsense_puts_it() {
    /// Column, row and median depth (mm, along the depth camera's axis) of nine by nine pixels of
    /// the first depth image, aligned to colour by librealsense 2.59 (`rs.align`), where nine
    /// tenths of them lie within 2 %.
    const PLACES: [(usize, usize, f64); 106] = [
        (12, 12, 1756.0),
        (92, 12, 1806.0),
        (132, 12, 1796.0),
        (172, 12, 1796.0),
        (212, 12, 1806.0),
        (252, 12, 1844.0),
        (292, 12, 1844.0),
        (572, 12, 624.0),
        (612, 12, 564.0),
        (12, 52, 1776.0),
        (52, 52, 1756.0),
        (92, 52, 1771.0),
        (132, 52, 1812.0),
        (172, 52, 1786.0),
        (212, 52, 1812.0),
        (252, 52, 1849.0),
        (292, 52, 1860.0),
        (532, 52, 711.0),
        (52, 92, 1741.0),
        (92, 92, 1736.0),
        (132, 92, 1801.0),
        (212, 92, 1822.0),
        (252, 92, 1806.0),
        (532, 92, 708.0),
        (612, 92, 569.0),
        (12, 132, 1766.0),
        (52, 132, 1741.0),
        (92, 132, 1791.0),
        (172, 132, 1756.0),
        (212, 132, 1827.0),
        (252, 132, 1860.0),
        (292, 132, 1866.0),
        (412, 132, 1100.0),
        (532, 132, 704.0),
        (612, 132, 573.0),
        (12, 172, 1732.0),
        (52, 172, 1756.0),
        (92, 172, 1796.0),
        (132, 172, 1801.0),
        (172, 172, 1751.0),
        (212, 172, 1838.0),
        (252, 172, 1838.0),
        (332, 172, 1503.0),
        (532, 172, 705.0),
        (572, 172, 636.0),
        (12, 212, 1751.0),
        (92, 212, 1766.0),
        (172, 212, 1791.0),
        (212, 212, 1786.0),
        (252, 212, 1801.0),
        (332, 212, 1438.0),
        (532, 212, 704.0),
        (612, 212, 566.0),
        (12, 252, 1741.0),
        (52, 252, 1703.0),
        (172, 252, 1796.0),
        (212, 252, 1801.0),
        (252, 252, 1827.0),
        (12, 292, 1756.0),
        (52, 292, 1736.0),
        (92, 292, 1766.0),
        (132, 292, 1761.0),
        (172, 292, 1776.0),
        (212, 292, 1822.0),
        (252, 292, 1806.0),
        (292, 292, 1694.0),
        (332, 292, 1603.0),
        (492, 292, 731.0),
        (572, 292, 596.0),
        (12, 332, 1727.0),
        (92, 332, 1741.0),
        (132, 332, 1761.0),
        (172, 332, 1781.0),
        (212, 332, 1806.0),
        (252, 332, 1786.0),
        (292, 332, 1587.0),
        (332, 332, 1529.0),
        (492, 332, 727.0),
        (572, 332, 584.0),
        (12, 372, 1699.0),
        (52, 372, 1732.0),
        (92, 372, 1766.0),
        (132, 372, 1736.0),
        (172, 372, 1776.0),
        (212, 372, 1766.0),
        (292, 372, 1475.0),
        (612, 372, 513.0),
        (12, 412, 1766.0),
        (52, 412, 1717.0),
        (92, 412, 1761.0),
        (132, 412, 1756.0),
        (212, 412, 1676.0),
        (252, 412, 1533.0),
        (292, 412, 1434.0),
        (492, 412, 814.0),
        (532, 412, 715.0),
        (12, 452, 1717.0),
        (52, 452, 1727.0),
        (92, 452, 1727.0),
        (132, 452, 1786.0),
        (212, 452, 1412.0),
        (252, 452, 1399.0),
        (292, 452, 1409.0),
        (332, 452, 1441.0),
        (492, 452, 812.0),
        (612, 452, 570.0),
    ];
    let Some(messages) = recording() else { return };
    let geometry = geometry(&messages);
    let depth: Vec<u16> = images(&messages, "Depth_0")[0]
        .chunks_exact(2)
        .map(|b| u16::from_le_bytes([b[0], b[1]]))
        .collect();
    let mut aligned = vec![0; PIXELS];
    depth_to_color(&geometry, &depth, &mut aligned).unwrap();
    let depth_from_color = geometry.color_from_depth.inverse();
    let mut worst: f64 = 0.0;
    for (column, row, theirs) in PLACES {
        let mut counts: Vec<u16> = (row - 4..row + 5)
            .flat_map(|r| aligned[r * 640 + column - 4..r * 640 + column + 5].to_vec())
            .filter(|&count| count != 0)
            .collect();
        assert!(counts.len() > 60, "{column} {row}: {} of 81", counts.len());
        counts.sort_unstable();
        // librealsense keeps the depth along the depth camera's axis.
        let ours = f64::from(counts[counts.len() / 2]) * geometry.depth_unit_m;
        let point = geometry.color.deproject([column as f64, row as f64], ours);
        let ours = (depth_from_color.rotation * point + depth_from_color.translation.vector).z;
        worst = worst.max((ours / (theirs * 1e-3) - 1.0).abs());
    }
    println!("largest difference to librealsense: {:.2} %", worst * 1e2);
    assert!(worst < 0.01, "{worst}");
}

/// The recording as a camera.
struct Recorded {
    buffers: std::vec::IntoIter<(Stream, Part, u32, i64, Vec<u8>)>,
    firmware: Firmware,
}

struct Once(Option<Recorded>);

impl CameraPort for Once {
    type Link = Recorded;
    fn open(&mut self, _: &CameraRequest, _: Stamp) -> Result<Option<Recorded>, LinkError> {
        Ok(self.0.take())
    }
}

impl CameraLink for Recorded {
    fn model(&self) -> Model {
        Model::D435
    }
    fn layout(&self, _: Stream) -> Layout {
        Layout::packed(640, 480)
    }
    fn has_metadata(&self, _: Stream) -> bool {
        true
    }
    fn set_unit(&mut self, selector: Selector, bytes: &[u8]) -> Result<(), LinkError> {
        self.firmware.set(selector, bytes);
        Ok(())
    }
    fn get_unit(&mut self, _: Selector, query: Query, bytes: &mut [u8]) -> Result<(), LinkError> {
        self.firmware.get(query, bytes);
        Ok(())
    }
    fn set_video(&mut self, _: Stream, _: u32, _: i32) -> Result<(), LinkError> {
        Ok(())
    }
    fn start(&mut self) -> Result<(), LinkError> {
        Ok(())
    }
    fn dequeue(&mut self, _: Stamp, take: &mut dyn FnMut(Buffer<'_>)) -> Result<bool, LinkError> {
        let Some((stream, part, sequence, received, bytes)) = self.buffers.next() else {
            return Ok(false);
        };
        take(Buffer {
            stream,
            part,
            sequence,
            received: Stamp::from_nanos(received),
            damaged: false,
            bytes: &bytes,
        });
        Ok(true)
    }
}

/// Six frames a second: half a period is 83 ms, and the recording's colour image was exposed 98 ms
/// before its first depth image. It is given the second's time for the second half of the test.
#[test]
fn real_frames_pair_by_the_cameras_own_clock() {
    let Some(messages) = recording() else { return };
    let geometry = geometry(&messages);
    let depth_said = metadata(&messages, "Depth_0");
    let color_said = metadata(&messages, "Color_0");
    assert_eq!((depth_said.len(), color_said.len()), (2, 1));
    let depth_images = images(&messages, "Depth_0");
    let mut yuyv = vec![0; 2 * PIXELS];
    encode::yuyv(&images(&messages, "Color_0")[0], &mut yuyv);
    let play = |color: &[FrameMetadata]| {
        let mut buffers = Vec::new();
        let mut push = |stream, sequence, said: &FrameMetadata, picture: &[u8]| {
            let received = i64::from(said.device_us.unwrap()) * 1_000;
            let (bytes, len) = encode::metadata(said);
            let metadata = bytes[..len].to_vec();
            buffers.push((stream, Part::Picture, sequence, received, picture.to_vec()));
            buffers.push((stream, Part::Metadata, sequence, received, metadata));
        };
        for (i, said) in color.iter().enumerate() {
            push(Stream::Color, i as u32, said, &yuyv);
        }
        for (i, (said, image)) in depth_said.iter().zip(&depth_images).enumerate() {
            push(Stream::Depth, i as u32, said, image);
        }
        let recorded = Recorded {
            buffers: buffers.into_iter(),
            firmware: Firmware::new(INFO, geometry),
        };
        let config = RealSenseConfig {
            depth: StreamFormat::new(640, 480, 6),
            color: StreamFormat::new(640, 480, 6),
            ..RealSenseConfig::default()
        };
        let mut camera = RealSense::new(Once(Some(recorded)), config);
        let (mut counts, mut rgb) = (vec![0; PIXELS], vec![0; 3 * PIXELS]);
        let mut headers: Vec<RgbdHeader> = Vec::new();
        loop {
            let images = RgbdImages {
                depth: &mut counts,
                color: &mut rgb,
            };
            match camera.read_frame(images, Stamp::from_nanos(i64::MAX)) {
                Ok(Some(header)) => headers.push(header),
                Ok(None) => break,
                Err(error) => panic!("{error}"),
            }
        }
        assert!((camera.geometry().unwrap().depth.focal[0] - 390.431).abs() < 1e-3);
        let bytes: Vec<u8> = counts.iter().flat_map(|c| c.to_le_bytes()).collect();
        (headers, bytes, camera.counters())
    };
    let (headers, _, counters) = play(&color_said);
    assert!(headers.is_empty(), "98 ms apart is no pair: {headers:?}");
    assert_eq!(counters.color.unpaired, 1);

    let mut later = color_said.clone();
    later[0].timing.sensor_us = depth_said[1].timing.sensor_us.map(|us| us - 20_000);
    later[0].device_us = later[0].timing.sensor_us;
    let (headers, bytes, _) = play(&later);
    assert_eq!(headers.len(), 1);
    assert_eq!(bytes, depth_images[1], "counts are the camera's");
    assert_eq!(headers[0].depth_sensor_ns, Some(360_978_539_000));
    // Read out 3.226 ms after the middle of 6.452 ms of exposure.
    assert_eq!(headers[0].depth_exposure_us, Some(6_452));
    assert_eq!(headers[0].stamp.as_nanos(), 360_978_539_000);
}
