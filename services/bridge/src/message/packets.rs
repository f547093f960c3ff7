//! Messages that carry a LiDAR's own packets: `VelodyneScan`, `RobosenseScan`, `RslidarPacket`.
//!
//! | message | a packet in it |
//! |---|---|
//! | `velodyne_msgs/VelodyneScan` | stamp, 1206 bytes |
//! | `robosense_msgs/RobosenseScan` | stamp, u8 is_difop, 1500 bytes, u32 how many of them count |
//! | `rslidar_msg/RslidarPacket` | (header's stamp), u8 is_difop, u8 is_frame_begin, a sequence of bytes |
//!
//! The second row was settled on a recording: 1516 bytes from packet to packet, the first byte
//! behind the stamp 1 for the one DIFOP packet and 0 for all others, the last four bytes 1248.

use hachi_hal::Stamp;

use super::MessageKind;
use super::wire::Wire;
use crate::error::DecodeError;

/// Where Velodyne sends data packets (VLP-16 manual 63-9243, Ethernet packets).
pub const VELODYNE_DATA_PORT: u16 = 2368;
/// Where RoboSense sends point packets by default (RS-Helios-16P manual, MSOP).
pub const ROBOSENSE_MSOP_PORT: u16 = 6699;
/// Where RoboSense sends device information by default (RS-Helios-16P manual, DIFOP).
pub const ROBOSENSE_DIFOP_PORT: u16 = 7788;

const VELODYNE_BYTES: usize = 1206;
const ROBOSENSE_CAPACITY: usize = 1500;
/// What a DIFOP packet begins with (RS-Helios-16P manual, DIFOP header).
const DIFOP_MAGIC: [u8; 8] = [0xa5, 0xff, 0x00, 0x5a, 0x11, 0x11, 0x55, 0x55];

/// Whose packets they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sensor {
    /// Velodyne data packets.
    Velodyne,
    /// RoboSense MSOP and DIFOP packets.
    Robosense,
}

/// The packets of one message, checked to be all there.
#[derive(Debug, Clone)]
pub struct Packets<'a> {
    kind: MessageKind,
    sensor: Sensor,
    header_stamp: Stamp,
    count: usize,
    /// At the first packet.
    wire: Wire<'a>,
}

/// One packet as it was on the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// When it was received, as the recording has it.
    pub stamp: Stamp,
    /// The UDP payload.
    pub payload: &'a [u8],
    /// The UDP port such packets are sent to by default, which tells data from information.
    pub port: u16,
}

impl<'a> Packets<'a> {
    /// Whose packets they are.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The message's own stamp.
    pub fn stamp(&self) -> Stamp {
        self.header_stamp
    }

    /// The packets, in the order of the message.
    pub fn iter(&self) -> impl Iterator<Item = Packet<'a>> + use<'a> {
        let mut wire = self.wire.clone();
        let (kind, header_stamp) = (self.kind, self.header_stamp);
        // `parse` has walked the same path: no packet fails here.
        (0..self.count).map_while(move |index| next(kind, header_stamp, index, &mut wire).ok())
    }
}

pub(super) fn parse(kind: MessageKind, mut wire: Wire<'_>) -> Result<Packets<'_>, DecodeError> {
    let header_stamp = wire.header()?.stamp;
    let (sensor, count) = match kind {
        MessageKind::RobosenseScan => (Sensor::Robosense, wire.length(ROBOSENSE_CAPACITY)?),
        MessageKind::RslidarPacket => (Sensor::Robosense, 1),
        _ => (Sensor::Velodyne, wire.length(VELODYNE_BYTES)?),
    };
    let first = wire.clone();
    for index in 0..count {
        next(kind, header_stamp, index, &mut wire)?;
    }
    Ok(Packets {
        kind,
        sensor,
        header_stamp,
        count,
        wire: first,
    })
}

fn next<'a>(
    kind: MessageKind,
    header_stamp: Stamp,
    index: usize,
    wire: &mut Wire<'a>,
) -> Result<Packet<'a>, DecodeError> {
    let (stamp, payload, is_difop) = match kind {
        MessageKind::RslidarPacket => {
            let is_difop = wire.u8()? != 0;
            wire.u8()?;
            (header_stamp, wire.byte_sequence()?, is_difop)
        }
        MessageKind::RobosenseScan => {
            let stamp = wire.stamp()?;
            let is_difop = wire.u8()? != 0;
            let buffer = wire.take(ROBOSENSE_CAPACITY)?;
            let claimed = wire.u32()?;
            let payload = buffer
                .get(..claimed as usize)
                .ok_or(DecodeError::PacketLength {
                    index,
                    claimed: u64::from(claimed),
                    capacity: buffer.len(),
                })?;
            (stamp, payload, is_difop)
        }
        _ => (wire.stamp()?, wire.take(VELODYNE_BYTES)?, false),
    };
    let port = match kind {
        MessageKind::VelodyneScan => VELODYNE_DATA_PORT,
        // The packet itself knows best; the flag is for packets of other models.
        _ if payload.starts_with(&DIFOP_MAGIC) || is_difop => ROBOSENSE_DIFOP_PORT,
        _ => ROBOSENSE_MSOP_PORT,
    };
    Ok(Packet {
        // Some drivers stamp the scan alone.
        stamp: if stamp.as_nanos() == 0 {
            header_stamp
        } else {
            stamp
        },
        payload,
        port,
    })
}
