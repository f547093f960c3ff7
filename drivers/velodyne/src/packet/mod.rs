//! Decodes what a VLP-16 sends, with no allocation and no clock.
//!
//! In: the UDP payload of a data packet (1206 bytes) or a position packet (512 bytes). Out: at
//! most 384 points in ROS axes (x forward, y left, z up, metres), oldest first; or time, GPS and
//! PPS state. Elsewhere: turning many packets into turns (`device`).
//!
//! Anything that is not what it should be is refused whole, with a [`PacketError`] that carries
//! what was seen.

mod data;
mod error;
mod lasers;
pub mod nmea;
mod position;
mod sine;
mod time;

pub use data::{DataInfo, Decoder, DecoderConfig, PointBatch};
pub use error::{PacketError, product_name};
pub use lasers::{LASERS, Laser, LaserTable};
pub use position::{PositionError, PositionPacket, Pps, Thermal};
pub use time::{HOUR_US, utc_from_hour_stamp};

/// UDP payload of a data packet, bytes (manual, section "Data packet").
pub const DATA_LEN: usize = 1206;
/// UDP payload of a position packet, bytes.
pub const POSITION_LEN: usize = 512;
/// Destination port of data packets unless configured otherwise.
pub const DATA_PORT: u16 = 2368;
/// Destination port of position packets unless configured otherwise.
pub const POSITION_PORT: u16 = 8308;

/// Data blocks in a packet.
pub const BLOCKS: usize = 12;
/// Returns in a block: two firings of sixteen lasers.
pub const CHANNELS: usize = 32;
/// Lasers of the sensor.
pub const LASER_COUNT: usize = 16;
/// Most points that one packet can hold.
pub const MAX_POINTS: usize = BLOCKS * CHANNELS;

/// Time from one laser's firing to the next, ns (2.304 µs).
pub const LASER_PERIOD_NS: u32 = 2_304;
/// Time from one firing of all lasers to the next, ns (55.296 µs: 16 firings and the recharge).
pub const FIRING_PERIOD_NS: u32 = 55_296;
/// Time that a block covers, ns.
pub const BLOCK_PERIOD_NS: u32 = 2 * FIRING_PERIOD_NS;

/// A distance count, metres.
pub const DISTANCE_UNIT_M: f32 = 0.002;
/// Counts of azimuth in a full turn (0.01° each).
pub const AZIMUTH_COUNTS: u16 = 36_000;

/// First two bytes of every block, read as little-endian.
const BLOCK_FLAG: u16 = 0xEEFF;
/// Bytes from one block to the next.
const BLOCK_LEN: usize = 100;
/// Where the stamp stands.
const STAMP_OFFSET: usize = BLOCKS * BLOCK_LEN;

/// Which echoes the sensor was told to report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReturnMode {
    /// The strongest.
    Strongest,
    /// The last.
    Last,
    /// Both, in pairs of blocks.
    Dual,
}

impl ReturnMode {
    /// The mode that a factory byte stands for.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x37 => Some(Self::Strongest),
            0x38 => Some(Self::Last),
            0x39 => Some(Self::Dual),
            _ => None,
        }
    }

    /// The factory byte.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Strongest => 0x37,
            Self::Last => 0x38,
            Self::Dual => 0x39,
        }
    }

    /// Time from the first firing of a packet to the first firing of the next, ns.
    pub const fn packet_period_ns(self) -> u32 {
        match self {
            Self::Strongest | Self::Last => BLOCKS as u32 * BLOCK_PERIOD_NS,
            Self::Dual => BLOCKS as u32 / 2 * BLOCK_PERIOD_NS,
        }
    }
}

/// Which sensor sent a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Model {
    /// VLP-16 and Puck LITE: ±15° in steps of 2°.
    Vlp16,
    /// Puck Hi-Res: ±10° in steps of 1.33°.
    HiRes,
}

impl Model {
    /// The sensor that a product byte stands for, of those decoded here.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x22 => Some(Self::Vlp16),
            0x24 => Some(Self::HiRes),
            _ => None,
        }
    }

    /// The product byte.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Vlp16 => 0x22,
            Self::HiRes => 0x24,
        }
    }
}

/// What a payload looks like, without decoding it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PacketKind {
    /// A data packet of a VLP-16 or a Hi-Res.
    Data,
    /// A position packet.
    Position,
}

/// Says whether a payload is one of this sensor's, by its length and markers: what a program that
/// was handed an unknown capture asks first.
pub fn recognise(payload: &[u8]) -> Option<PacketKind> {
    match payload.len() {
        DATA_LEN => {
            let flagged = u16_at(payload, 0) == BLOCK_FLAG;
            let known = Model::from_byte(payload[DATA_LEN - 1]).is_some();
            (flagged && known).then_some(PacketKind::Data)
        }
        POSITION_LEN => Some(PacketKind::Position),
        _ => None,
    }
}

/// Little-endian u16 at an offset that the caller has checked.
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// Little-endian u32 at an offset that the caller has checked.
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
