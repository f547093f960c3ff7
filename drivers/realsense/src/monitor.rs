//! The hardware monitor: commands to the camera's firmware through control 1 of the depth
//! extension unit.
//!
//! In: a command, or the 1024 bytes that came back. Out: the 1024 bytes to set, or the answer's
//! payload. Elsewhere: setting and getting them (`device`). Commands that write to the camera's
//! flash are not known here, so that none can be sent by mistake.

use crate::bytes::u32_at;

/// Bytes of the control, both ways.
pub const MONITOR_LEN: usize = 1024;
/// Bytes of the command before its data.
pub(crate) const COMMAND_HEAD: usize = 24;
/// Most data that a command can carry.
pub const MOST_DATA: usize = MONITOR_LEN - COMMAND_HEAD;
/// Bytes 2 and 3 of every command.
const MAGIC: [u8; 2] = [0xAB, 0xCD];
/// The length field counts what follows the first four bytes.
const NOT_COUNTED: usize = 4;
/// Where the answer's payload begins, behind the echoed command.
pub(crate) const PAYLOAD_AT: usize = 4;
/// Where the answer's length stands: the last four bytes.
pub(crate) const LENGTH_AT: usize = MONITOR_LEN - 4;

/// What the firmware can be asked here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Opcode {
    /// What the camera is: firmware, serial number.
    DeviceInfo,
    /// A calibration table.
    ReadCalibration,
    /// Settings of advanced mode, the depth unit among them.
    ReadAdvanced,
    /// Start anew, as if plugged in.
    Reset,
}

impl Opcode {
    /// Its number.
    pub const fn number(self) -> u32 {
        match self {
            Self::DeviceInfo => 0x10,
            Self::ReadCalibration => 0x15,
            Self::ReadAdvanced => 0x2C,
            Self::Reset => 0x20,
        }
    }
}

/// A command with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command {
    /// What is asked.
    pub opcode: Opcode,
    /// What it is asked about.
    pub parameters: [u32; 4],
}

impl Command {
    /// Asks what the camera is.
    pub const DEVICE_INFO: Self = Self::new(Opcode::DeviceInfo, [0; 4]);

    /// Asks for the depth table's values: unit, clamps, disparity.
    pub const DEPTH_TABLE: Self = Self::new(Opcode::ReadAdvanced, [9, 0, 0, 0]);

    /// A command.
    pub const fn new(opcode: Opcode, parameters: [u32; 4]) -> Self {
        Self { opcode, parameters }
    }

    /// Asks for a calibration table.
    pub const fn calibration(table: u16) -> Self {
        Self::new(Opcode::ReadCalibration, [table as u32, 0, 0, 0])
    }

    /// The bytes to set.
    pub fn encode(&self) -> [u8; MONITOR_LEN] {
        let mut bytes = [0; MONITOR_LEN];
        let length = (COMMAND_HEAD - NOT_COUNTED) as u16;
        bytes[..2].copy_from_slice(&length.to_le_bytes());
        bytes[2..4].copy_from_slice(&MAGIC);
        bytes[4..8].copy_from_slice(&self.opcode.number().to_le_bytes());
        for (slot, parameter) in bytes[8..COMMAND_HEAD]
            .chunks_exact_mut(4)
            .zip(self.parameters)
        {
            slot.copy_from_slice(&parameter.to_le_bytes());
        }
        bytes
    }

    /// The payload of the answer to this command.
    ///
    /// # Errors
    /// The camera refused, or the bytes are no answer to this.
    pub fn answer<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], MonitorError> {
        if bytes.len() != MONITOR_LEN {
            return Err(MonitorError::Length { got: bytes.len() });
        }
        let (expected, got) = (self.opcode.number(), u32_at(bytes, 0));
        if got.cast_signed() < 0 {
            let code = got.cast_signed();
            return Err(MonitorError::Refused { expected, code });
        }
        if got != expected {
            return Err(MonitorError::OtherCommand { expected, got });
        }
        let length = u32_at(bytes, LENGTH_AT);
        let room = &bytes[PAYLOAD_AT..LENGTH_AT];
        let payload = usize::try_from(length).ok().and_then(|len| room.get(..len));
        payload.ok_or(MonitorError::PayloadLength { length })
    }
}

/// Why an answer was refused, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MonitorError {
    /// Not the size of the control.
    #[error("{got} bytes where the hardware monitor has 1024")]
    Length {
        /// Bytes there.
        got: usize,
    },
    /// The camera says no.
    #[error("the camera refuses command {expected:#04x} with code {code} ({})", refusal(*code))]
    Refused {
        /// The command's number.
        expected: u32,
        /// The camera's reason.
        code: i32,
    },
    /// The answer belongs to another command: another program talks to the camera too.
    #[error(
        "an answer to command {got:#x} instead of {expected:#04x}: is another program using the camera?"
    )]
    OtherCommand {
        /// The command's number.
        expected: u32,
        /// What was answered.
        got: u32,
    },
    /// The payload is said to be longer than there is room.
    #[error("a payload of {length} bytes in 1016")]
    PayloadLength {
        /// Its said length.
        length: u32,
    },
    /// No camera has such a depth unit.
    #[error("a depth unit of {micrometres} µm")]
    DepthUnit {
        /// The unit that was said.
        micrometres: u32,
    },
    /// The payload is too short for what was asked.
    #[error("a payload of {got} bytes, {needed} are needed")]
    PayloadShort {
        /// Bytes there.
        got: usize,
        /// Bytes needed.
        needed: usize,
    },
}

/// What a refusal's code means, of those that matter here.
const fn refusal(code: i32) -> &'static str {
    match code {
        -1 => "unknown command",
        -21 => "no data",
        -25 => "the table is empty",
        _ => "no name known",
    }
}

/// What a camera says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Version of its firmware, most significant first.
    pub firmware: [u8; 4],
    /// Its serial number, to be read as hexadecimal digits.
    pub serial: [u8; 6],
}

impl DeviceInfo {
    pub(crate) const FIRMWARE_AT: usize = 12;
    pub(crate) const SERIAL_AT: usize = 48;
    /// Bytes up to the end of what is read.
    pub(crate) const NEEDED: usize = Self::SERIAL_AT + 6;

    /// From the payload of [`Command::DEVICE_INFO`]'s answer.
    ///
    /// # Errors
    /// The payload is too short.
    pub fn decode(payload: &[u8]) -> Result<Self, MonitorError> {
        let (got, needed) = (payload.len(), Self::NEEDED);
        if got < needed {
            return Err(MonitorError::PayloadShort { got, needed });
        }
        let (f, s) = (Self::FIRMWARE_AT, Self::SERIAL_AT);
        Ok(Self {
            firmware: core::array::from_fn(|i| payload[f + 3 - i]),
            serial: core::array::from_fn(|i| payload[s + i]),
        })
    }

    /// The serial number as printed on the case: twelve digits.
    pub fn serial_digits(&self) -> [u8; 12] {
        const DIGITS: &[u8; 16] = b"0123456789abcdef";
        core::array::from_fn(|i| {
            let byte = self.serial[i / 2];
            let nibble = if i % 2 == 0 { byte >> 4 } else { byte & 15 };
            DIGITS[usize::from(nibble)]
        })
    }
}

/// What a count of the depth image is if the camera does not say, metres.
pub const USUAL_DEPTH_UNIT_M: f64 = 0.001;

/// The depth unit, metres, from the payload of [`Command::DEPTH_TABLE`]'s answer: µm in its first
/// four bytes.
///
/// # Errors
/// The payload is too short, or no unit that a camera can have (1 µm to 10 mm).
pub fn depth_unit_m(payload: &[u8]) -> Result<f64, MonitorError> {
    let (got, needed) = (payload.len(), 4);
    if got < needed {
        return Err(MonitorError::PayloadShort { got, needed });
    }
    match u32_at(payload, 0) {
        micrometres @ 1..=10_000 => Ok(f64::from(micrometres) / 1e6),
        micrometres => Err(MonitorError::DepthUnit { micrometres }),
    }
}
