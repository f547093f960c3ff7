//! The camera's clock: 32 bits of microseconds that wrap every 71.6 minutes, made into one that
//! does not and moved onto the robot's.

use hachi_hal::Stamp;
use hachi_turns::ClockMap;

use super::lane::Frame;
use crate::frame::FrameMetadata;

/// A step of the camera's clock beyond this is a new clock rather than a pause, µs: a camera that
/// pauses for longer is opened anew.
const JUMP_US: i64 = 10_000_000;

/// When a frame was exposed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exposed {
    /// On the camera's clock, ns, unwrapped.
    pub sensor_ns: Option<i64>,
    /// On the robot's clock.
    pub stamp: Stamp,
    /// For how long, µs, where the camera says.
    pub exposure_us: Option<u32>,
}

/// The clock of one camera. Both streams are on it.
#[derive(Debug, Default)]
pub(super) struct CameraClock {
    /// The last reading and what it was taken for, µs.
    last: Option<(u32, i64)>,
    map: ClockMap,
    pub jumps: u64,
}

impl CameraClock {
    /// A reading, unwrapped: the moment nearest to the last one that it can mean, µs.
    fn unwrap(&mut self, reading: u32) -> i64 {
        let us = match self.last {
            None => i64::from(reading),
            Some((before, us)) => {
                let step = i64::from(reading.wrapping_sub(before).cast_signed());
                if step.abs() > JUMP_US {
                    self.jumps += 1;
                    self.map.reset();
                }
                us + step
            }
        };
        self.last = Some((reading, us));
        us
    }

    /// Learns from a frame how the camera's clock lies to the robot's. One stream is enough, and
    /// better: the other's way to the computer takes another time.
    pub fn learn(&mut self, frame: &Frame) {
        let sent = |m: FrameMetadata| m.device_us.or(m.timing.sensor_us);
        if let Some(reading) = frame.metadata.and_then(sent) {
            let us = self.unwrap(reading);
            self.map.observe(us.saturating_mul(1_000), frame.received);
        }
    }

    /// When a frame was exposed. Without the camera's word the kernel's stamp is all there is.
    pub fn exposed(&mut self, frame: &Frame) -> Exposed {
        let reading = frame.metadata.and_then(|m| m.exposed_us());
        let sensor_ns = reading.map(|us| self.unwrap(us).saturating_mul(1_000));
        let on_robot = |ns: i64| Some(Stamp::from_nanos(ns) + self.map.offset_ns()?);
        Exposed {
            sensor_ns,
            stamp: sensor_ns.and_then(on_robot).unwrap_or(frame.received),
            exposure_us: frame.metadata.and_then(|m| m.timing.exposure_us),
        }
    }

    pub fn set_back(&self) -> u64 {
        self.map.steps()
    }
}
