//! The metadata buffer that the kernel hands out beside each frame (format `D4XX`, or `UVCH` with
//! the header alone): when the frame was exposed on the camera's own clock, and how.
//!
//! Layout: host time (u64, ns), USB frame number (u16), then the frame's UVC payload header as the
//! camera sent it: two bytes, device time, source clock, and blocks at fixed places, each with its
//! kind and a mask of what is valid in it.

use crate::bytes::{u16_at, u32_at};

/// Bytes of a depth stream's buffer: ten of the kernel's and the camera's 232.
pub const METADATA_DEPTH_LEN: usize = HEADER_AT + 232;
/// Bytes of a colour stream's buffer.
pub const METADATA_COLOR_LEN: usize = HEADER_AT + 244;

/// Where the UVC payload header begins.
pub(crate) const HEADER_AT: usize = 10;
/// Shortest header: its length and its flags.
const SHORTEST_HEADER: usize = 2;
/// Header flags (UVC 1.5, section 2.4.3.3).
pub(crate) const HAS_DEVICE_TIME: u8 = 0x04;
pub(crate) const HAS_SOURCE_CLOCK: u8 = 0x08;
const ERROR: u8 = 0x40;

/// Offsets from the header's start, and the kinds that stand there.
pub(crate) const TIMING_AT: usize = 12;
pub(crate) const TIMING: u32 = 0x8000_0001;
const TIMING_LEN: usize = 40;
pub(crate) const CONTROL_AT: usize = 132;
pub(crate) const DEPTH_CONTROL: u32 = 0x8000_0000;
const DEPTH_CONTROL_LEN: usize = 60;

/// Why a metadata buffer was refused, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetadataError {
    /// Too short for a header.
    #[error("{got} bytes of metadata, at least 12 are a header")]
    Short {
        /// Bytes of the buffer.
        got: usize,
    },
    /// The header says that it is longer than the buffer, or shorter than itself.
    #[error("a header of {said} bytes in {room}")]
    HeaderLength {
        /// What it says.
        said: u8,
        /// Bytes there.
        room: usize,
    },
}

/// What the camera says of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameMetadata {
    /// When the kernel saw the frame begin, ns on its monotonic clock; 0 if it did not say.
    pub host_ns: u64,
    /// The camera says that the frame is damaged.
    pub damaged: bool,
    /// When the frame was read out, µs on the camera's clock, 32 bits that wrap every 71.6 minutes.
    pub device_us: Option<u32>,
    /// When and how long it was exposed.
    pub timing: CaptureTiming,
    /// How the depth camera was set; `None` for the colour stream.
    pub depth: Option<DepthState>,
}

/// When a frame was exposed. Each value is there only if the camera marks it as valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CaptureTiming {
    /// Counts frames.
    pub frame_counter: Option<u32>,
    /// The middle of the exposure, µs on the camera's clock.
    pub sensor_us: Option<u32>,
    /// How long reading out took, µs.
    pub readout_us: Option<u32>,
    /// How long it was exposed, µs.
    pub exposure_us: Option<u32>,
    /// Time between frames, µs.
    pub interval_us: Option<u32>,
    /// From the sensor to the USB, µs.
    pub latency_us: Option<u32>,
}

/// How the depth camera was set when it took a frame. Each value is there only if the camera marks
/// it as valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DepthState {
    /// Gain of the imagers.
    pub gain: Option<u32>,
    /// Exposure that was asked for, µs.
    pub exposure_us: Option<u32>,
    /// Power of the projector, mW.
    pub laser_power_mw: Option<u32>,
    /// Whether exposure was automatic.
    pub auto_exposure: Option<bool>,
    /// What the projector did: 0 off, 1 laser, 2 automatic, 3 LED.
    pub emitter: Option<u8>,
}

impl FrameMetadata {
    /// Reads a buffer.
    ///
    /// # Errors
    /// The buffer has no whole header. Blocks that are missing or of another kind are left out.
    pub fn decode(bytes: &[u8]) -> Result<Self, MetadataError> {
        if bytes.len() < HEADER_AT + SHORTEST_HEADER {
            return Err(MetadataError::Short { got: bytes.len() });
        }
        let (kernel, header) = bytes.split_at(HEADER_AT);
        let (said, flags) = (header[0], header[1]);
        let in_order = (SHORTEST_HEADER..=header.len()).contains(&usize::from(said));
        if !in_order {
            return Err(MetadataError::HeaderLength {
                said,
                room: header.len(),
            });
        }
        let header = &header[..usize::from(said)];
        let device_us =
            (flags & HAS_DEVICE_TIME != 0 && header.len() >= 6).then(|| u32_at(header, 2));
        // The blocks' places hold only behind a whole header.
        let whole = flags & HAS_DEVICE_TIME != 0 && flags & HAS_SOURCE_CLOCK != 0;
        let block = |at: usize, kind: u32, len: usize| {
            let block = header.get(at..at + len).filter(|_| whole)?;
            (u32_at(block, 0) == kind).then_some(block)
        };
        Ok(Self {
            host_ns: u64::from(u32_at(kernel, 0)) | u64::from(u32_at(kernel, 4)) << 32,
            damaged: flags & ERROR != 0,
            device_us,
            timing: block(TIMING_AT, TIMING, TIMING_LEN)
                .map(CaptureTiming::decode)
                .unwrap_or_default(),
            depth: block(CONTROL_AT, DEPTH_CONTROL, DEPTH_CONTROL_LEN).map(DepthState::decode),
        })
    }

    /// When the frame was exposed (the middle of it), µs on the camera's clock: as the camera says,
    /// else half the exposure before it was read out.
    pub fn exposed_us(&self) -> Option<u32> {
        let half = self.timing.exposure_us.unwrap_or(0) / 2;
        let from_readout = || self.device_us.map(|us| us.wrapping_sub(half));
        self.timing.sensor_us.or_else(from_readout)
    }
}

/// A block's values, each behind a bit of its mask, in the order of the mask.
struct Masked<'a>(&'a [u8]);

impl Masked<'_> {
    const MASK_AT: usize = 12;
    const VALUES_AT: usize = 16;

    fn value(&self, index: usize) -> Option<u32> {
        let valid = u32_at(self.0, Self::MASK_AT) >> index & 1 != 0;
        valid.then(|| u32_at(self.0, Self::VALUES_AT + 4 * index))
    }
}

impl CaptureTiming {
    fn decode(block: &[u8]) -> Self {
        let masked = Masked(block);
        Self {
            frame_counter: masked.value(0),
            sensor_us: masked.value(1),
            readout_us: masked.value(2),
            exposure_us: masked.value(3),
            interval_us: masked.value(4),
            latency_us: masked.value(5),
        }
    }
}

impl DepthState {
    fn decode(block: &[u8]) -> Self {
        /// The region of interest is one bit for its four values, so what follows it has other
        /// places than its bits say; only these stand before it.
        const EMITTER_AT: usize = 56;
        const EMITTER_BIT: u32 = 1 << 7;
        let masked = Masked(block);
        let emitter_valid = u32_at(block, Masked::MASK_AT) & EMITTER_BIT != 0;
        Self {
            gain: masked.value(0),
            exposure_us: masked.value(1),
            laser_power_mw: masked.value(2),
            auto_exposure: masked.value(3).map(|mode| mode != 0),
            emitter: emitter_valid.then(|| u16_at(block, EMITTER_AT) as u8),
        }
    }
}
