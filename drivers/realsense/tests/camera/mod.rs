//! A D455 in bytes: what is plugged in when, what the camera sends, and what was written to it.

use std::cell::RefCell;
use std::rc::Rc;

use hachi_hal::{Distortion, Intrinsics, Pose, Stamp};
use hachi_realsense::Model;
use hachi_realsense::controls::{self, Query, Selector};
use hachi_realsense::device::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream,
};
use hachi_realsense::encode;
use hachi_realsense::frame::{CaptureTiming, DepthState, FrameMetadata, Layout};
use hachi_realsense::monitor::{DeviceInfo, Opcode};

pub const WIDTH: u32 = 848;
pub const HEIGHT: u32 = 480;
pub const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// What the camera does next.
#[derive(Debug, Clone)]
pub enum Act {
    Buffer {
        stream: Stream,
        part: Part,
        sequence: u32,
        received: i64,
        damaged: bool,
        bytes: Vec<u8>,
    },
    Unplug,
}

/// The picture with this number: depth counts it in its first pixel, colour is white.
pub fn frame_bytes(stream: Stream, sequence: u32) -> Vec<u8> {
    let mut bytes = vec![0; 2 * PIXELS];
    match stream {
        Stream::Depth => encode::z16(&[sequence as u16 + 1, 1_000, 1_001], &mut bytes),
        Stream::Color => encode::yuyv(&[255; 6], &mut bytes),
    }
    bytes
}

/// Metadata of a picture read out at `us`, 3 ms after the middle of its exposure.
pub fn metadata_bytes(stream: Stream, sequence: u32, us: u32) -> Vec<u8> {
    let said = FrameMetadata {
        device_us: Some(us),
        timing: CaptureTiming {
            frame_counter: Some(sequence),
            sensor_us: Some(us.wrapping_sub(3_000)),
            exposure_us: Some(6_000),
            ..CaptureTiming::default()
        },
        depth: (stream == Stream::Depth).then(DepthState::default),
        ..FrameMetadata::default()
    };
    let (bytes, len) = encode::metadata(&said);
    bytes[..len].to_vec()
}

/// A camera that can be plugged in.
#[derive(Debug)]
pub struct Camera {
    acts: std::vec::IntoIter<Act>,
    log: Rc<RefCell<Vec<String>>>,
    pub has_metadata: bool,
    pub color_table: Vec<u8>,
    pub depth_table: Option<u32>,
    /// The last command to the firmware.
    command: Vec<u8>,
}

impl Camera {
    pub fn new(acts: Vec<Act>) -> Self {
        let color = Intrinsics {
            width: 1_280,
            height: 800,
            focal: [636.45, 635.62],
            centre: [648.58, 398.82],
            distortion: Distortion::BrownConrady([-0.05698, 0.06602, 0.00021, 0.00069, -0.02085]),
        };
        let depth_from_color = Pose::translation(0.0591, 0.0001, -0.0002);
        Self {
            acts: acts.into_iter(),
            log: Rc::default(),
            has_metadata: true,
            color_table: encode::color_table(&color, &depth_from_color).to_vec(),
            depth_table: Some(1_000),
            command: Vec::new(),
        }
    }

    /// What is written to it, as text.
    pub fn log(&self) -> Rc<RefCell<Vec<String>>> {
        Rc::clone(&self.log)
    }

    fn answer(&self) -> Vec<u8> {
        let number = |at: usize| u32::from_le_bytes(self.command[at..at + 4].try_into().unwrap());
        let info = DeviceInfo {
            firmware: [5, 16, 0, 1],
            serial: [1, 2, 3, 4, 5, 6],
        };
        let depth = Intrinsics {
            width: 848,
            height: 480,
            focal: [424.23, 424.23],
            centre: [423.43, 236.05],
            distortion: Distortion::None,
        };
        match (number(4), number(8)) {
            (0x10, _) => encode::answer(Opcode::DeviceInfo, &encode::device_info(&info)),
            (0x15, 25) => {
                let table = encode::depth_table(0.095, &[depth]);
                encode::answer(Opcode::ReadCalibration, &table)
            }
            (0x15, 32) => encode::answer(Opcode::ReadCalibration, &self.color_table),
            (0x2C, 9) => match self.depth_table {
                Some(unit) => encode::answer(Opcode::ReadAdvanced, &unit.to_le_bytes()),
                None => encode::refusal(-1),
            },
            other => panic!("the driver asked {other:x?}"),
        }
        .to_vec()
    }
}

impl CameraLink for Camera {
    fn model(&self) -> Model {
        Model::D455
    }

    fn layout(&self, _: Stream) -> Layout {
        Layout::packed(WIDTH, HEIGHT)
    }

    fn has_metadata(&self, _: Stream) -> bool {
        self.has_metadata
    }

    fn set_unit(&mut self, selector: Selector, bytes: &[u8]) -> Result<(), LinkError> {
        if selector == Selector::Monitor {
            assert_eq!((bytes.len(), &bytes[2..4]), (1_024, &[0xAB, 0xCD][..]));
            self.command = bytes.to_vec();
        } else {
            let value = controls::decode(bytes).unwrap();
            let line = format!("unit {} = {value}", selector.number());
            self.log.borrow_mut().push(line);
        }
        Ok(())
    }

    fn get_unit(
        &mut self,
        selector: Selector,
        query: Query,
        bytes: &mut [u8],
    ) -> Result<(), LinkError> {
        let range = match selector {
            Selector::Monitor => {
                bytes.copy_from_slice(&self.answer());
                return Ok(());
            }
            Selector::Emitter => [0, 2],
            Selector::Exposure => [1, 200_000],
            Selector::LaserPower => [0, 360],
            Selector::AutoExposure => [0_u32, 1],
        };
        let value = match query {
            Query::Minimum => range[0],
            Query::Maximum => range[1],
            other => panic!("the driver asked for {other:?}"),
        };
        let len = bytes.len();
        bytes.copy_from_slice(&value.to_le_bytes()[..len]);
        Ok(())
    }

    fn set_video(&mut self, stream: Stream, control: u32, value: i32) -> Result<(), LinkError> {
        let line = format!("{} {control:#x} = {value}", stream.name());
        self.log.borrow_mut().push(line);
        Ok(())
    }

    fn start(&mut self) -> Result<(), LinkError> {
        self.log.borrow_mut().push("start".to_owned());
        Ok(())
    }

    fn dequeue(&mut self, _: Stamp, take: &mut dyn FnMut(Buffer<'_>)) -> Result<bool, LinkError> {
        match self.acts.next() {
            Some(Act::Buffer {
                stream,
                part,
                sequence,
                received,
                damaged,
                bytes,
            }) => {
                take(Buffer {
                    stream,
                    part,
                    sequence,
                    received: Stamp::from_nanos(received),
                    damaged,
                    bytes: &bytes,
                });
                Ok(true)
            }
            Some(Act::Unplug) => Err(LinkError::Unplugged),
            None => Ok(false),
        }
    }
}

/// What is plugged in each time the driver looks.
#[derive(Debug)]
pub struct Plugged(std::vec::IntoIter<Option<Camera>>);

impl Plugged {
    pub fn once(camera: Camera) -> Self {
        Self::script(vec![Some(camera)])
    }

    pub fn script(script: Vec<Option<Camera>>) -> Self {
        Self(script.into_iter())
    }
}

impl CameraPort for Plugged {
    type Link = Camera;

    fn open(&mut self, _: &CameraRequest, _: Stamp) -> Result<Option<Camera>, LinkError> {
        Ok(self.0.next().flatten())
    }
}
