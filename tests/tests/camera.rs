//! The simulated camera through the RealSense driver: its bytes, tables and metadata over the
//! driver's link, and what comes out against the world's truth.

use hachi_hal::{Pose, RgbdCamera, RgbdGeometry, RgbdImages, Stamp, Vector3};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::controls::{Query, Selector};
use hachi_realsense::device::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream, StreamFormat,
};
use hachi_realsense::frame::{CaptureTiming, DepthState, FrameMetadata, Layout};
use hachi_realsense::monitor::DeviceInfo;
use hachi_realsense::{CameraError, Model, RealSense, RealSenseConfig, encode};
use hachi_tests::firmware::Firmware;
use hachi_world::{
    CameraConfig, CameraFrame, Outfit, Person, Preset, SimulatedCamera, SimulationConfig, Visit,
};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

const WIDTH: u32 = 424;
const HEIGHT: u32 = 240;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;
/// Frames until the camera is pulled out for a moment, and all of them.
const UNPLUGGED_AFTER: usize = 4;
const FRAMES: usize = 8;
const EXPOSURE_US: u32 = 8_000;
const INFO: DeviceInfo = DeviceInfo {
    firmware: [5, 16, 0, 1],
    serial: [9; 6],
};
/// From the middle of an exposure to the kernel's stamp, ns.
const WAY_NS: i64 = 6_000_000;

/// What the world showed, for the test to look at.
type Shown = Rc<RefCell<Vec<CameraFrame>>>;

/// A D455 that sees the simulated world.
struct Simulated {
    camera: Rc<RefCell<SimulatedCamera>>,
    start: Stamp,
    shown: Shown,
    sequence: u32,
    frames_left: usize,
    waiting: VecDeque<(Stream, Part, Vec<u8>)>,
    received: Stamp,
    firmware: Firmware,
}

impl Simulated {
    /// Puts the next frame's four buffers in line.
    fn expose(&mut self) -> bool {
        let mut camera = self.camera.borrow_mut();
        let Some(frame) = camera.next_frame() else {
            return false;
        };
        // The camera's clock, 32 bits of microseconds, wraps after the fifth frame.
        let since_us = frame.stamp.nanos_since(self.start) / 1_000;
        let exposed_us = (u32::MAX - 150_000).wrapping_add(since_us as u32);
        let metadata = |depth: Option<DepthState>| {
            let said = FrameMetadata {
                device_us: Some(exposed_us.wrapping_add(EXPOSURE_US / 2)),
                timing: CaptureTiming {
                    sensor_us: Some(exposed_us),
                    exposure_us: Some(EXPOSURE_US),
                    ..CaptureTiming::default()
                },
                depth,
                ..FrameMetadata::default()
            };
            let (bytes, len) = encode::metadata(&said);
            bytes[..len].to_vec()
        };
        self.waiting.extend([
            (Stream::Depth, Part::Picture, frame.depth.clone()),
            (Stream::Color, Part::Metadata, metadata(None)),
            (Stream::Color, Part::Picture, frame.color.clone()),
            (
                Stream::Depth,
                Part::Metadata,
                metadata(Some(DepthState::default())),
            ),
        ]);
        self.received = frame.stamp + WAY_NS;
        self.shown.borrow_mut().push(frame.clone());
        self.sequence += 1;
        true
    }
}

impl CameraLink for Simulated {
    fn model(&self) -> Model {
        Model::D455
    }
    fn layout(&self, _: Stream) -> Layout {
        Layout::packed(WIDTH, HEIGHT)
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
        if self.waiting.is_empty() {
            let Some(left) = self.frames_left.checked_sub(1) else {
                return Err(LinkError::Unplugged);
            };
            self.frames_left = left;
            if !self.expose() {
                return Ok(false);
            }
        }
        let Some((stream, part, bytes)) = self.waiting.pop_front() else {
            return Ok(false);
        };
        take(Buffer {
            stream,
            part,
            sequence: self.sequence,
            received: self.received,
            damaged: false,
            bytes: &bytes,
        });
        Ok(true)
    }
}

/// The same camera each time it is plugged in, for so many frames.
struct Plugs {
    camera: Rc<RefCell<SimulatedCamera>>,
    start: Stamp,
    shown: Shown,
    frames: VecDeque<usize>,
}

impl CameraPort for Plugs {
    type Link = Simulated;
    fn open(&mut self, _: &CameraRequest, _: Stamp) -> Result<Option<Simulated>, LinkError> {
        Ok(self.frames.pop_front().map(|frames_left| Simulated {
            camera: Rc::clone(&self.camera),
            start: self.start,
            shown: Rc::clone(&self.shown),
            sequence: 0,
            frames_left,
            waiting: VecDeque::new(),
            received: self.start,
            firmware: Firmware::new(INFO, self.camera.borrow().config().geometry),
        }))
    }
}

const OUTFIT: Outfit = Outfit {
    top: [190, 40, 40],
    trousers: [40, 50, 120],
    shoes: [30, 30, 30],
};

/// Somebody who walks away down the corridor, in front of the robot.
fn walker() -> Person {
    Person {
        id: 42,
        height_m: 1.8,
        skin: [220, 180, 150],
        hair: [50, 40, 30],
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![[2.6, 0.2], [9.0, -0.3]],
            speed_m_s: 1.2,
            stays_s: 0.0,
            outfit: OUTFIT,
        }],
    }
}

/// Where the driver's depth puts whom a mask shows: the median of the mask's points, in the map.
fn place(
    frame: &CameraFrame,
    geometry: &RgbdGeometry,
    aligned: &[u16],
    map_from_color: &Pose,
) -> Vector3 {
    let mut points: Vec<Vector3> = (0..PIXELS)
        .filter(|&index| frame.masks[index] == 1 && aligned[index] != 0)
        .map(|index| {
            let pixel = [index % WIDTH as usize, index / WIDTH as usize].map(|v| v as f64);
            let depth_m = f64::from(aligned[index]) * geometry.depth_unit_m;
            let point = geometry.color.deproject(pixel, depth_m);
            (map_from_color * nalgebra::Point3::from(point)).coords
        })
        .collect();
    assert!(points.len() > 200, "{} points", points.len());
    Vector3::from_fn(|axis, _| {
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        points[points.len() / 2][axis]
    })
}

/// Mean colour of the shirt: the upper middle of the person's box, where the mask says so.
fn shirt(frame: &CameraFrame, rgb: &[u8]) -> [f64; 3] {
    let whole = frame.people[0].whole.unwrap();
    let rows = whole.top + whole.height() / 4..whole.top + whole.height() * 2 / 5;
    let columns = whole.left + whole.width() * 2 / 5..whole.left + whole.width() * 3 / 5;
    let pixels: Vec<usize> = rows
        .flat_map(|row| {
            columns
                .clone()
                .map(move |column| (row * WIDTH + column) as usize)
        })
        .filter(|&index| frame.masks[index] == 1)
        .collect();
    let mean = |channel: usize| {
        let sum: f64 = pixels
            .iter()
            .map(|&i| f64::from(rgb[3 * i + channel]))
            .sum();
        sum / pixels.len() as f64
    };
    [mean(0), mean(1), mean(2)]
}

#[test]
fn a_person_in_the_simulated_world_is_where_the_driver_says() {
    let simulation = SimulationConfig {
        people: [walker()].into(),
        ..SimulationConfig::preset(Preset::Corridor, 1, 10.0)
    };
    let config = CameraConfig::d455(WIDTH, HEIGHT, 0.2);
    let expected = config.geometry;
    let base_from_color = config.base_from_depth * expected.color_from_depth.inverse();
    let camera = SimulatedCamera::new(&simulation, config);
    let shown = Shown::default();
    let plugs = Plugs {
        camera: Rc::new(RefCell::new(camera)),
        start: simulation.start,
        shown: Rc::clone(&shown),
        frames: [UNPLUGGED_AFTER, FRAMES - UNPLUGGED_AFTER].into(),
    };
    let format = StreamFormat::new(WIDTH, HEIGHT, 30);
    let settings = RealSenseConfig {
        depth: format,
        color: format,
        ..RealSenseConfig::default()
    };
    let mut driver = RealSense::new(plugs, settings);
    let (mut depth, mut color) = (vec![0; PIXELS], vec![0; 3 * PIXELS]);
    let mut aligned = vec![0; PIXELS];
    let (mut frames, mut unplugged) = (0, 0);
    while frames < FRAMES {
        let images = RgbdImages {
            depth: &mut depth,
            color: &mut color,
        };
        let header = match driver.read_frame(images, Stamp::from_nanos(i64::MAX)) {
            Ok(Some(header)) => header,
            Err(CameraError::Link(LinkError::Unplugged)) => {
                unplugged += 1;
                continue;
            }
            other => panic!("{other:?}"),
        };
        let shown = shown.borrow();
        let truth = &shown[frames];
        assert_eq!(header.sequence as usize, frames);
        // The driver takes the way to the kernel for the least that it has seen: all but the half
        // exposure between the two readings of the camera's clock.
        let late_ns = header.stamp.nanos_since(truth.stamp);
        let expected_ns = WAY_NS - i64::from(EXPOSURE_US / 2) * 1_000;
        assert!((late_ns - expected_ns).abs() < 2_000, "{late_ns}");
        assert_eq!(header.color_stamp, header.stamp);
        let geometry = *driver.geometry().unwrap();
        for (got, want) in [
            (geometry.depth, expected.depth),
            (geometry.color, expected.color),
        ] {
            assert!(
                (got.focal[0] - want.focal[0]).abs() < 1e-3,
                "{got:?} {want:?}"
            );
            assert!(
                (got.centre[1] - want.centre[1]).abs() < 1e-3,
                "{got:?} {want:?}"
            );
        }
        let counts = truth.depth.chunks_exact(2);
        assert!(
            counts
                .zip(&depth)
                .all(|(b, &c)| u16::from_le_bytes([b[0], b[1]]) == c)
        );

        let person = &truth.people[0];
        assert_eq!(person.id, 42);
        depth_to_color(&geometry, &depth, &mut aligned).unwrap();
        let map_from_color = simulation.map_from_base(truth.stamp) * base_from_color;
        let found = place(truth, &geometry, &aligned, &map_from_color);
        let off = (found - person.map_from_person.translation.vector).xy();
        // The front of a body is some centimetres before its middle.
        assert!(off.norm() < 0.2, "{off} at {}", truth.stamp);
        // Under the light of the corridor, a shirt is between half and all as bright as its cloth.
        let [r, g, b] = shirt(truth, &color);
        assert!(
            (85.0..195.0).contains(&r) && r > 2.5 * g && r > 2.5 * b,
            "{r} {g} {b}"
        );
        frames += 1;
    }
    assert_eq!(unplugged, 1);
    let counters = driver.counters();
    assert_eq!(
        (counters.pairs, counters.opened, counters.unplugged),
        (8, 2, 1)
    );
    assert_eq!(
        counters.dropped().map(|(_, n)| n).sum::<u64>(),
        1,
        "{counters:?}"
    );
}
