//! The ROS messages that recordings are read for, from their bytes.
//!
//! In: a message's bytes as a bag or a bus carries them (CDR of either byte order, or ROS 1). Out:
//! a [`Body`] that borrows them. Deserialisers exist for exactly these types, written from the
//! message definitions of `sensor_msgs`, `nav_msgs`, `velodyne_msgs`, `robosense_msgs` and
//! `rslidar_msg`; nothing else is looked into.

mod motion;
mod packets;
mod point_cloud;
mod wire;

use hachi_hal::{ImuSample, OdometrySample};

pub use packets::{
    Packet, Packets, ROBOSENSE_DIFOP_PORT, ROBOSENSE_MSOP_PORT, Sensor, VELODYNE_DATA_PORT,
};
pub use point_cloud::{CloudReader, PointCloud2};

use crate::error::DecodeError;
use wire::Wire;

/// How a message became bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// ROS 2: CDR with its four bytes of encapsulation in front.
    Cdr,
    /// ROS 1: packed, little-endian.
    Ros1,
}

/// A message type that is read here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MessageKind {
    /// `sensor_msgs/PointCloud2`
    PointCloud,
    /// `velodyne_msgs/VelodyneScan`: the data packets of one turn.
    VelodyneScan,
    /// `robosense_msgs/RobosenseScan`: MSOP and DIFOP packets of one turn.
    RobosenseScan,
    /// `rslidar_msg/RslidarPacket`: one MSOP or DIFOP packet, as the maker's driver records it.
    RslidarPacket,
    /// `sensor_msgs/Imu`
    Imu,
    /// `nav_msgs/Odometry`
    Odometry,
}

impl MessageKind {
    /// The kind of a type name as ROS 1 (`package/Type`) or ROS 2 (`package/msg/Type`) writes it.
    pub fn from_type_name(name: &str) -> Option<Self> {
        let (package, kind) = name.split_once('/')?;
        let kind = kind.strip_prefix("msg/").unwrap_or(kind);
        Some(match (package, kind) {
            ("sensor_msgs", "PointCloud2") => Self::PointCloud,
            ("velodyne_msgs", "VelodyneScan") => Self::VelodyneScan,
            ("robosense_msgs", "RobosenseScan") => Self::RobosenseScan,
            ("rslidar_msg", "RslidarPacket") => Self::RslidarPacket,
            ("sensor_msgs", "Imu") => Self::Imu,
            ("nav_msgs", "Odometry") => Self::Odometry,
            _ => return None,
        })
    }

    /// Whose packets it carries, if it carries packets.
    pub const fn sensor(self) -> Option<Sensor> {
        match self {
            Self::VelodyneScan => Some(Sensor::Velodyne),
            Self::RobosenseScan | Self::RslidarPacket => Some(Sensor::Robosense),
            Self::PointCloud | Self::Imu | Self::Odometry => None,
        }
    }
}

/// What a message says.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Body<'a> {
    /// A cloud, to be turned into points by a [`CloudReader`].
    PointCloud(PointCloud2<'a>),
    /// Raw packets of a LiDAR.
    Packets(Packets<'a>),
    /// An inertial sample.
    Imu(ImuSample),
    /// A pose from another estimator.
    Odometry(OdometrySample),
}

/// Reads a message of a known kind.
///
/// # Errors
/// [`DecodeError`] where the bytes end too early or contradict themselves. Bytes behind the
/// message are ignored: CDR pads to a multiple of four.
pub fn decode(
    kind: MessageKind,
    encoding: Encoding,
    bytes: &[u8],
) -> Result<Body<'_>, DecodeError> {
    let wire = Wire::new(encoding, bytes)?;
    match kind {
        MessageKind::PointCloud => point_cloud::parse(wire).map(Body::PointCloud),
        MessageKind::VelodyneScan | MessageKind::RobosenseScan | MessageKind::RslidarPacket => {
            packets::parse(kind, wire).map(Body::Packets)
        }
        MessageKind::Imu => motion::parse_imu(wire).map(Body::Imu),
        MessageKind::Odometry => motion::parse_odometry(wire).map(Body::Odometry),
    }
}

#[cfg(test)]
mod tests;
