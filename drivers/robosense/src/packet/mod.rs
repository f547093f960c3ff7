//! Decodes what an RS-Helios-16P sends, with no allocation and no clock.
//!
//! In: the UDP payload of an MSOP packet (points) or a DIFOP packet (calibration and state), 1248
//! bytes each, big-endian. Out: at most 384 points in ROS axes (x forward, y left, z up, metres),
//! oldest first; or a [`Difop`]. Elsewhere: turning many packets into turns (`device`).
//!
//! Anything that is not what it should be is refused whole, with a [`PacketError`] that carries
//! what was seen.

mod batch;
mod calibration;
mod difop;
mod error;
mod head;
mod msop;

pub use batch::{Firing, PointBatch};
pub use calibration::{Calibration, CalibrationError};
pub use difop::{Difop, SyncSource, SyncStatus};
pub use error::PacketError;
pub use head::MsopHeader;
pub use msop::{Decoder, DecoderConfig, LaserTiming, MsopInfo};

/// UDP payload of MSOP and DIFOP packets, bytes.
pub const PACKET_LEN: usize = 1248;
/// Destination port of MSOP packets unless configured otherwise.
pub const MSOP_PORT: u16 = 6699;
/// Destination port of DIFOP packets unless configured otherwise.
pub const DIFOP_PORT: u16 = 7788;
/// First bytes of an MSOP packet.
pub const MSOP_MAGIC: [u8; 4] = [0x55, 0xAA, 0x05, 0x5A];
/// First bytes of a DIFOP packet.
pub const DIFOP_MAGIC: [u8; 8] = [0xA5, 0xFF, 0x00, 0x5A, 0x11, 0x11, 0x55, 0x55];

/// Data blocks in an MSOP packet.
pub const BLOCKS: usize = 12;
/// Returns in a block: two firings of sixteen lasers, or two returns of one firing.
pub const CHANNELS: usize = 32;
/// Lasers of the sensor.
pub const LASER_COUNT: usize = 16;
/// Most points that one packet can hold.
pub const MAX_POINTS: usize = BLOCKS * CHANNELS;

/// A distance count, metres, whatever the resolution byte says: so in the maker's driver.
pub const DISTANCE_UNIT_M: f32 = 0.0025;
/// Counts of azimuth in a full turn (0.01° each).
pub const AZIMUTH_COUNTS: u16 = 36_000;
/// How far the lens stands from the axis of rotation, metres (maker's driver).
pub const LENS_OFFSET_M: f32 = 0.03498;

/// Time that a block covers, ns. The manual's 111.12 µs for two firings is not what the recorded
/// sensor does: its packets of twelve blocks are 666.7 µs apart.
pub const BLOCK_PERIOD_NS: u32 = 55_560;

/// Bytes before the first block.
const HEADER_LEN: usize = 42;
/// Bytes from one block to the next.
const BLOCK_LEN: usize = 100;
/// First two bytes of every block.
const BLOCK_FLAG: u16 = 0xFFEE;

/// Which echoes the sensor was told to report. Stands in the DIFOP packet only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ReturnMode {
    /// Two of each shot.
    Dual,
    /// The strongest.
    #[default]
    Strongest,
    /// The last.
    Last,
    /// The first, which is the nearest.
    First,
}

impl ReturnMode {
    /// The mode that DIFOP byte 300 stands for.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x00 => Some(Self::Dual),
            0x04 => Some(Self::Strongest),
            0x05 => Some(Self::Last),
            0x06 => Some(Self::First),
            _ => None,
        }
    }

    /// DIFOP byte 300.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Dual => 0x00,
            Self::Strongest => 0x04,
            Self::Last => 0x05,
            Self::First => 0x06,
        }
    }
}

/// What a payload looks like, without decoding it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PacketKind {
    /// Points.
    Msop,
    /// Calibration and state.
    Difop,
}

/// Says whether a payload is one of this sensor's, by its length and markers.
pub fn recognise(payload: &[u8]) -> Option<PacketKind> {
    if payload.len() != PACKET_LEN {
        return None;
    }
    if payload.starts_with(&MSOP_MAGIC) {
        Some(PacketKind::Msop)
    } else if payload.starts_with(&DIFOP_MAGIC) {
        Some(PacketKind::Difop)
    } else {
        None
    }
}

/// Big-endian u16 at an offset within a packet.
fn u16_at(bytes: &[u8; PACKET_LEN], at: usize) -> u16 {
    u16::from_be_bytes([bytes[at], bytes[at + 1]])
}

/// Big-endian u32 at an offset within a packet.
fn u32_at(bytes: &[u8; PACKET_LEN], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) << 16 | u32::from(u16_at(bytes, at + 2))
}

/// Six bytes of seconds and four of microseconds, as nanoseconds.
fn time_ns_at(bytes: &[u8; PACKET_LEN], at: usize) -> Result<u64, PacketError> {
    /// Year 2242: beyond it is no sensor's clock, and nanoseconds still fit.
    const MAX_SECONDS: u64 = 1 << 33;
    let seconds = u64::from(u16_at(bytes, at)) << 32 | u64::from(u32_at(bytes, at + 2));
    let micros = u32_at(bytes, at + 6);
    if seconds > MAX_SECONDS || micros >= 1_000_000 {
        return Err(PacketError::Stamp { seconds, micros });
    }
    Ok(seconds * 1_000_000_000 + u64::from(micros) * 1_000)
}
