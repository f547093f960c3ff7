//! The DIFOP packet: calibration and state, about once a second.

use core::net::Ipv4Addr;

use super::calibration::{Calibration, CalibrationError};
use super::{DIFOP_MAGIC, LASER_COUNT, PACKET_LEN, PacketError, ReturnMode, time_ns_at, u16_at};

/// Where the sensor takes its time from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SyncSource {
    /// GPS sentence and pulse.
    Gps,
    /// PTP, end to end.
    PtpEndToEnd,
    /// PTP, peer to peer.
    PtpPeerToPeer,
    /// gPTP.
    Gptp,
    /// A value that the manual does not name.
    Unknown(u8),
}

impl SyncSource {
    const fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Gps,
            1 => Self::PtpEndToEnd,
            2 => Self::PtpPeerToPeer,
            3 => Self::Gptp,
            other => Self::Unknown(other),
        }
    }

    /// DIFOP byte 301.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Gps => 0,
            Self::PtpEndToEnd => 1,
            Self::PtpPeerToPeer => 2,
            Self::Gptp => 3,
            Self::Unknown(other) => other,
        }
    }
}

/// Whether the sensor's time follows its source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SyncStatus {
    /// It counts by itself.
    Unsynchronised,
    /// It follows GPS.
    Gps,
    /// It follows PTP.
    Ptp,
    /// A value that the manual does not name.
    Unknown(u8),
}

impl SyncStatus {
    const fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Unsynchronised,
            1 => Self::Gps,
            2 => Self::Ptp,
            other => Self::Unknown(other),
        }
    }

    /// DIFOP byte 302.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Unsynchronised => 0,
            Self::Gps => 1,
            Self::Ptp => 2,
            Self::Unknown(other) => other,
        }
    }
}

pub(crate) const VERTICAL_OFFSET: usize = 468;
pub(crate) const HORIZONTAL_OFFSET: usize = 564;
pub(crate) const GPRMC_OFFSET: usize = 382;
pub(crate) const GPRMC_LEN: usize = 86;

/// What a DIFOP packet says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difop {
    /// Speed that the rotor was told to keep.
    pub configured_rpm: u16,
    /// Speed that it has.
    pub actual_rpm: u16,
    /// Address of the sensor.
    pub sensor_address: Ipv4Addr,
    /// Address that it sends to.
    pub host_address: Ipv4Addr,
    /// Port that MSOP packets are sent to.
    pub msop_port: u16,
    /// Port that DIFOP packets are sent to.
    pub difop_port: u16,
    /// Beginning and end of the field of view, clockwise, 0.01°.
    pub view: (u16, u16),
    /// Serial number.
    pub serial: [u8; 6],
    /// Which echoes the sensor reports.
    pub return_mode: ReturnMode,
    /// Where it takes its time from.
    pub sync_source: SyncSource,
    /// Whether its time follows that.
    pub sync_status: SyncStatus,
    /// Its time, ns.
    pub time_ns: u64,
    /// Where its lasers point.
    pub calibration: Result<Calibration, CalibrationError>,
    gprmc: [u8; GPRMC_LEN],
}

impl Difop {
    /// Reads the UDP payload of a DIFOP packet. Its tail is not looked at, as in the maker's driver.
    pub fn decode(payload: &[u8]) -> Result<Self, PacketError> {
        let got = payload.len();
        let bytes: &[u8; PACKET_LEN] = payload
            .try_into()
            .map_err(|_| PacketError::Length { got })?;
        let magic: [u8; 8] = core::array::from_fn(|at| bytes[at]);
        if magic != DIFOP_MAGIC {
            return Err(PacketError::Magic { got: magic });
        }
        let mode = bytes[300];
        let address = |at: usize| Ipv4Addr::from([0, 1, 2, 3].map(|n| bytes[at + n]));
        Ok(Self {
            configured_rpm: u16_at(bytes, 8),
            // The fault block at 342 has five temperatures, then the speed.
            actual_rpm: u16_at(bytes, 352),
            sensor_address: address(10),
            host_address: address(14),
            msop_port: u16_at(bytes, 26),
            difop_port: u16_at(bytes, 30),
            view: (u16_at(bytes, 32), u16_at(bytes, 34)),
            serial: core::array::from_fn(|n| bytes[292 + n]),
            return_mode: ReturnMode::from_byte(mode)
                .ok_or(PacketError::ReturnMode { got: mode })?,
            sync_source: SyncSource::from_byte(bytes[301]),
            sync_status: SyncStatus::from_byte(bytes[302]),
            time_ns: time_ns_at(bytes, 303)?,
            calibration: Calibration::from_tables(
                &bytes[VERTICAL_OFFSET..VERTICAL_OFFSET + 3 * LASER_COUNT],
                &bytes[HORIZONTAL_OFFSET..HORIZONTAL_OFFSET + 3 * LASER_COUNT],
            ),
            gprmc: core::array::from_fn(|n| bytes[GPRMC_OFFSET + n]),
        })
    }

    /// The last GPRMC sentence that the sensor heard, without the fill; empty without a receiver.
    pub fn gprmc(&self) -> &[u8] {
        let len = self.gprmc.iter().position(|&b| b == 0);
        &self.gprmc[..len.unwrap_or(GPRMC_LEN)]
    }
}
