//! The position packet: GPS sentence, PPS state, temperatures.
//!
//! Offsets from the manual; bytes 187 to 197 are zero in firmware before about 2018. Temperatures
//! are codes whose scale the manual does not give, so they are passed on as they stand.

use super::nmea::{NmeaError, Sentence};
use super::{HOUR_US, POSITION_LEN, u16_at, u32_at};

/// State of the pulse per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pps {
    /// No pulse.
    Absent,
    /// The sensor is aligning its clock with it.
    Synchronising,
    /// The sensor's clock follows it.
    Locked,
    /// The sensor reports an error.
    Error,
    /// A value that the manual does not name.
    Unknown(u8),
}

impl Pps {
    const fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Absent,
            1 => Self::Synchronising,
            2 => Self::Locked,
            3 => Self::Error,
            other => Self::Unknown(other),
        }
    }

    /// The byte that says so.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Absent => 0,
            Self::Synchronising => 1,
            Self::Locked => 2,
            Self::Error => 3,
            Self::Unknown(other) => other,
        }
    }
}

/// Whether the sensor shut itself down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Thermal {
    /// Within limits.
    Ok,
    /// Shut down for its temperature.
    Shutdown,
    /// A value that the manual does not name.
    Unknown(u8),
}

impl Thermal {
    const fn from_byte(byte: u8) -> Self {
        match byte {
            0 => Self::Ok,
            1 => Self::Shutdown,
            other => Self::Unknown(other),
        }
    }

    /// The byte that says so.
    pub const fn byte(self) -> u8 {
        match self {
            Self::Ok => 0,
            Self::Shutdown => 1,
            Self::Unknown(other) => other,
        }
    }
}

/// Why a position packet was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PositionError {
    /// Not the size of a position packet.
    #[error("expected 512 bytes, got {got}")]
    Length {
        /// Bytes of the payload.
        got: usize,
    },
    /// A stamp outside the hour.
    #[error("stamp {got_us} µs is not within an hour")]
    Stamp {
        /// The stamp, µs.
        got_us: u32,
    },
}

/// Room for the NMEA sentence in the packet, bytes.
pub(crate) const NMEA_LEN: usize = POSITION_LEN - NMEA_OFFSET;
/// Where the NMEA sentence starts.
pub(crate) const NMEA_OFFSET: usize = 206;

/// What a position packet says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PositionPacket {
    /// Temperature code of the top board.
    pub top_temperature: u8,
    /// Temperature code of the bottom board.
    pub bottom_temperature: u8,
    /// Temperature code at the last calibration of the converter.
    pub calibration_temperature: u8,
    /// Change of the temperature code since then.
    pub temperature_change: i16,
    /// Seconds since then.
    pub calibration_age_s: u32,
    /// Why it was calibrated, 0 to 4.
    pub calibration_reason: u8,
    /// Bits: calibration in progress, temperature change, period.
    pub calibration_flags: u8,
    /// µs since the top of the hour, on the clock of the data packets.
    pub hour_us: u32,
    /// State of the pulse per second.
    pub pps: Pps,
    /// Whether the sensor shut itself down.
    pub thermal: Thermal,
    /// Temperature code at the last shutdown.
    pub shutdown_temperature: u8,
    /// Temperature code at power-up.
    pub power_up_temperature: u8,
    nmea: [u8; NMEA_LEN],
    nmea_len: usize,
}

impl PositionPacket {
    /// Reads the UDP payload of a position packet. The sentence is not checked here: see
    /// [`Self::sentence`].
    pub fn decode(payload: &[u8]) -> Result<Self, PositionError> {
        let got = payload.len();
        let bytes: &[u8; POSITION_LEN] = payload
            .try_into()
            .map_err(|_| PositionError::Length { got })?;
        let hour_us = u32_at(bytes, 198);
        if hour_us >= HOUR_US {
            return Err(PositionError::Stamp { got_us: hour_us });
        }
        let text = &bytes[NMEA_OFFSET..];
        let nmea_len = text.iter().position(|&b| b == 0).unwrap_or(NMEA_LEN);
        // What stands behind the sentence's end is no part of it.
        let mut nmea = [0; NMEA_LEN];
        nmea[..nmea_len].copy_from_slice(&text[..nmea_len]);
        Ok(Self {
            top_temperature: bytes[187],
            bottom_temperature: bytes[188],
            calibration_temperature: bytes[189],
            temperature_change: u16_at(bytes, 190).cast_signed(),
            calibration_age_s: u32_at(bytes, 192),
            calibration_reason: bytes[196],
            calibration_flags: bytes[197],
            hour_us,
            pps: Pps::from_byte(bytes[202]),
            thermal: Thermal::from_byte(bytes[203]),
            shutdown_temperature: bytes[204],
            power_up_temperature: bytes[205],
            nmea,
            nmea_len,
        })
    }

    /// A packet with a time, a PPS state and a sentence, everything else zero. A sentence longer
    /// than the packet has room for is cut.
    pub fn new(hour_us: u32, pps: Pps, sentence: &[u8]) -> Self {
        let nmea_len = sentence.len().min(NMEA_LEN);
        let mut nmea = [0; NMEA_LEN];
        nmea[..nmea_len].copy_from_slice(&sentence[..nmea_len]);
        Self {
            top_temperature: 0,
            bottom_temperature: 0,
            calibration_temperature: 0,
            temperature_change: 0,
            calibration_age_s: 0,
            calibration_reason: 0,
            calibration_flags: 0,
            hour_us: hour_us % HOUR_US,
            pps,
            thermal: Thermal::Ok,
            shutdown_temperature: 0,
            power_up_temperature: 0,
            nmea,
            nmea_len,
        }
    }

    /// The text that stands in the packet, without the fill; empty without a GPS receiver.
    pub fn nmea(&self) -> &[u8] {
        &self.nmea[..self.nmea_len]
    }

    /// The sentence, checked and read; `None` without a GPS receiver.
    pub fn sentence(&self) -> Option<Result<Sentence, NmeaError>> {
        (self.nmea_len > 0).then(|| Sentence::parse(self.nmea()))
    }

    /// Whether the sensor's stamps count from the top of the UTC hour: its clock follows the pulse
    /// and the receiver says that it has a fix.
    pub fn is_utc(&self) -> bool {
        let fixed = self
            .sentence()
            .and_then(Result::ok)
            .is_some_and(|s| s.has_fix());
        self.pps == Pps::Locked && fixed
    }
}
