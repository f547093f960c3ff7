//! A camera inside the program: pictures go in as its bytes, and come out of a [`CameraPort`] as from a
//! cable, with the firmware's answers, its clock and its metadata.
//!
//! In: Z16 and YUYV bytes of one exposure, when it was and when it came. Out: the buffers of both
//! streams. For simulated robots and tests; the driver above it is the real one.

mod firmware;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::vec::Vec;

use hachi_hal::{RgbdGeometry, Stamp};

pub use firmware::Firmware;

use super::link::{Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream};
use crate::Model;
use crate::controls::{Query, Selector};
use crate::encode;
use crate::frame::{CaptureTiming, DepthState, FrameMetadata, Layout};
use crate::monitor::DeviceInfo;

/// What the firmware says of itself.
const INFO: DeviceInfo = DeviceInfo {
    firmware: [5, 16, 0, 1],
    serial: [9; 6],
};
/// Both cameras expose for so long, µs.
const EXPOSURE_US: u32 = 8_000;
/// The camera's clock (32 bits of microseconds) at the first exposure: it wraps soon after.
const FIRST_US: u32 = u32::MAX - 150_000;
/// Exposures that wait to be fetched, as the kernel keeps buffers; the oldest goes.
const MOST_WAITING: usize = 4;

/// One stream's picture with its metadata.
#[derive(Debug, Default)]
struct Exposure {
    sequence: u32,
    exposed_us: u32,
    received: Stamp,
    /// Depth, colour.
    pictures: [Vec<u8>; 2],
}

#[derive(Debug)]
struct Cable {
    geometry: RgbdGeometry,
    plugged: bool,
    /// Counts how often it was pulled out: a link that was open then is dead.
    pulled: u32,
    first: Option<Stamp>,
    sequence: u32,
    waiting: VecDeque<Exposure>,
    spare: Vec<Exposure>,
}

/// The camera, plugged in. Clones are the same one.
#[derive(Debug, Clone)]
pub struct SimulatedPort(Arc<Mutex<Cable>>);

impl SimulatedPort {
    /// A D455 with these optics.
    pub fn new(geometry: RgbdGeometry) -> Self {
        Self(Arc::new(Mutex::new(Cable {
            geometry,
            plugged: true,
            pulled: 0,
            first: None,
            sequence: 0,
            waiting: VecDeque::new(),
            spare: Vec::new(),
        })))
    }

    fn lock(&self) -> MutexGuard<'_, Cable> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Plugs it in, or pulls it out.
    pub fn plug(&self, is_in: bool) {
        let mut cable = self.lock();
        if cable.plugged && !is_in {
            cable.pulled += 1;
            cable.waiting.clear();
        }
        cable.plugged = is_in;
    }

    /// Both cameras were exposed, the middle of it at `exposed`; the pictures were `received` by the
    /// computer later.
    pub fn expose(&self, exposed: Stamp, received: Stamp, depth: &[u8], color: &[u8]) {
        let mut cable = self.lock();
        if !cable.plugged {
            return;
        }
        let first = *cable.first.get_or_insert(exposed);
        // The clock wraps, as the real one does.
        let since_us = (exposed.nanos_since(first) / 1_000) as u32;
        cable.sequence = cable.sequence.wrapping_add(1);
        let mut exposure = match cable.waiting.len() < MOST_WAITING {
            true => cable.spare.pop().unwrap_or_default(),
            false => cable.waiting.pop_front().unwrap_or_default(),
        };
        exposure.sequence = cable.sequence;
        exposure.exposed_us = FIRST_US.wrapping_add(since_us);
        exposure.received = received;
        for (kept, picture) in exposure.pictures.iter_mut().zip([depth, color]) {
            kept.clear();
            kept.extend_from_slice(picture);
        }
        cable.waiting.push_back(exposure);
    }
}

impl CameraPort for SimulatedPort {
    type Link = SimulatedLink;

    fn open(&mut self, _: &CameraRequest, _: Stamp) -> Result<Option<SimulatedLink>, LinkError> {
        let cable = self.lock();
        Ok(cable.plugged.then(|| SimulatedLink {
            cable: self.clone(),
            geometry: cable.geometry,
            firmware: Firmware::new(INFO, cable.geometry),
            pulled: cable.pulled,
            current: Exposure::default(),
            left: 0,
        }))
    }
}

/// The camera, open.
#[derive(Debug)]
pub struct SimulatedLink {
    cable: SimulatedPort,
    geometry: RgbdGeometry,
    firmware: Firmware,
    pulled: u32,
    current: Exposure,
    /// Buffers of the current exposure that are to be handed out.
    left: usize,
}

/// Buffers of an exposure in the order in which they come.
const BUFFERS: [(Stream, Part); 4] = [
    (Stream::Depth, Part::Picture),
    (Stream::Color, Part::Metadata),
    (Stream::Color, Part::Picture),
    (Stream::Depth, Part::Metadata),
];

impl CameraLink for SimulatedLink {
    fn model(&self) -> Model {
        Model::D455
    }

    fn layout(&self, stream: Stream) -> Layout {
        let optics = match stream {
            Stream::Depth => &self.geometry.depth,
            Stream::Color => &self.geometry.color,
        };
        Layout::packed(optics.width, optics.height)
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
        {
            let mut cable = self.cable.lock();
            if cable.pulled != self.pulled {
                return Err(LinkError::Unplugged);
            }
            if self.left == 0 {
                let Some(next) = cable.waiting.pop_front() else {
                    return Ok(false);
                };
                cable.spare.push(std::mem::replace(&mut self.current, next));
                self.left = BUFFERS.len();
            }
        }
        let (stream, part) = BUFFERS[BUFFERS.len() - self.left];
        self.left -= 1;
        let exposure = &self.current;
        let (metadata, len);
        let bytes = match part {
            Part::Picture => exposure.pictures[stream.index()].as_slice(),
            Part::Metadata => {
                (metadata, len) = encode::metadata(&said(stream, exposure.exposed_us));
                &metadata[..len]
            }
        };
        take(Buffer {
            stream,
            part,
            sequence: exposure.sequence,
            received: exposure.received,
            damaged: false,
            bytes,
        });
        Ok(true)
    }
}

/// What a camera says of a picture. It reads its clock a second time when the exposure is over.
fn said(stream: Stream, exposed_us: u32) -> FrameMetadata {
    FrameMetadata {
        device_us: Some(exposed_us.wrapping_add(EXPOSURE_US / 2)),
        timing: CaptureTiming {
            sensor_us: Some(exposed_us),
            exposure_us: Some(EXPOSURE_US),
            ..CaptureTiming::default()
        },
        depth: (stream == Stream::Depth).then(DepthState::default),
        ..FrameMetadata::default()
    }
}
