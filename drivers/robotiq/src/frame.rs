//! Modbus RTU frames of the gripper, the computer's side: requests out, answers in.
//!
//! A frame is the gripper's address, a function, its data, and a checksum. Registers are
//! big-endian, the checksum's low byte comes first.

use crc::{CRC_16_MODBUS, Crc};
use heapless::Vec;

/// The gripper's address unless it was given another.
pub const ADDRESS: u8 = 9;
/// Bits a second, eight data bits, no parity, one stop bit.
pub const BAUD: u32 = 115_200;

/// Where commands are written: three registers.
pub(crate) const COMMAND_REGISTER: u16 = 0x03E8;
/// Where the state is read: three registers.
pub(crate) const STATE_REGISTER: u16 = 0x07D0;
/// Registers of either.
pub(crate) const REGISTERS: u16 = 3;

pub(crate) const READ_HOLDING: u8 = 0x03;
pub(crate) const READ_INPUT: u8 = 0x04;
pub(crate) const WRITE: u8 = 0x10;
/// Set in the function of an answer that refuses.
pub(crate) const REFUSES: u8 = 0x80;

/// Address, function, count of bytes; or address, function, exception.
const SHORTEST_ANSWER: usize = 5;
const CHECKSUM_LEN: usize = 2;

/// A whole frame. The longest is a request that writes.
pub type Frame = Vec<u8, 32>;

const CHECKSUM: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// The checksum of a frame's bytes before it.
pub fn checksum(bytes: &[u8]) -> u16 {
    CHECKSUM.checksum(bytes)
}

/// What the fingers are asked to do, in the gripper's counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Command {
    /// Ready to move (`rACT`). Setting it makes the gripper find the ends of its stroke; clearing it
    /// clears faults.
    pub activate: bool,
    /// Moves to what is asked (`rGTO`); without it the fingers stand.
    pub go: bool,
    /// Opens slowly whatever else is asked, and has to be activated anew (`rATR`).
    pub release: bool,
    /// Where to: 0 is open, 255 closed.
    pub position: u8,
    /// How fast: 0 is 20 mm/s, 255 is 150 mm/s.
    pub speed: u8,
    /// How hard: 0 is 20 N, 255 is 235 N.
    pub force: u8,
}

impl Command {
    /// The six bytes of its three registers.
    pub const fn bytes(&self) -> [u8; 6] {
        let flags = self.activate as u8 | (self.go as u8) << 3 | (self.release as u8) << 4;
        [flags, 0, 0, self.position, self.speed, self.force]
    }

    /// From the six bytes of its three registers.
    pub const fn from_bytes(bytes: [u8; 6]) -> Self {
        Self {
            activate: bytes[0] & 1 != 0,
            go: bytes[0] & 8 != 0,
            release: bytes[0] & 0x10 != 0,
            position: bytes[3],
            speed: bytes[4],
            force: bytes[5],
        }
    }
}

/// How far activation is (`gSTA`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Activation {
    /// Not activated, or released.
    #[default]
    Reset,
    /// Finding the ends of the stroke.
    Running,
    /// Ready.
    Done,
    /// A value that the manual reserves.
    Reserved,
}

/// What the fingers feel (`gOBJ`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Contact {
    /// On their way.
    #[default]
    Moving,
    /// Stopped by something while opening.
    WhileOpening,
    /// Stopped by something while closing.
    WhileClosing,
    /// Where they were sent.
    AtPosition,
}

/// What the gripper says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct State {
    /// `gACT`: the command's, echoed.
    pub activate: bool,
    /// `gGTO`: the command's, echoed.
    pub go: bool,
    /// How far activation is.
    pub activation: Activation,
    /// What the fingers feel.
    pub contact: Contact,
    /// What is wrong (`gFLT`); see [`fault_name`].
    pub fault: u8,
    /// Where the fingers were sent: the command's position, echoed.
    pub asked: u8,
    /// Where they are: 0 is open, 255 closed.
    pub position: u8,
    /// Current of the motor, tens of mA.
    pub current: u8,
}

impl State {
    /// From the six bytes of its three registers.
    pub const fn from_bytes(bytes: [u8; 6]) -> Self {
        Self {
            activate: bytes[0] & 1 != 0,
            go: bytes[0] & 8 != 0,
            activation: match bytes[0] >> 4 & 3 {
                0 => Activation::Reset,
                1 => Activation::Running,
                3 => Activation::Done,
                _ => Activation::Reserved,
            },
            contact: match bytes[0] >> 6 {
                0 => Contact::Moving,
                1 => Contact::WhileOpening,
                2 => Contact::WhileClosing,
                _ => Contact::AtPosition,
            },
            fault: bytes[2] & 0x0F,
            asked: bytes[3],
            position: bytes[4],
            current: bytes[5],
        }
    }

    /// The six bytes of its three registers.
    pub const fn bytes(&self) -> [u8; 6] {
        let activation = match self.activation {
            Activation::Reset => 0,
            Activation::Running => 1,
            Activation::Reserved => 2,
            Activation::Done => 3,
        };
        let contact = match self.contact {
            Contact::Moving => 0,
            Contact::WhileOpening => 1,
            Contact::WhileClosing => 2,
            Contact::AtPosition => 3,
        };
        let flags = self.activate as u8 | (self.go as u8) << 3 | activation << 4 | contact << 6;
        let fault = self.fault & 0x0F;
        [flags, 0, fault, self.asked, self.position, self.current]
    }
}

/// What a fault is, for a person. From 0x0A on the gripper has to be activated anew.
pub const fn fault_name(fault: u8) -> &'static str {
    match fault {
        0x0 => "no fault",
        0x5 => "the move waits until activation is done",
        0x7 => "it has to be activated first",
        0x8 => "too hot",
        0x9 => "it heard nothing for a second",
        0xA => "its supply is below 20 V",
        0xB => "it is being released",
        0xC => "an internal fault",
        0xD => "activation failed: is something between the fingers?",
        0xE => "too much current",
        0xF => "it was released",
        _ => "no name known",
    }
}

/// Whether a fault stops the gripper until it is activated anew.
pub const fn is_major(fault: u8) -> bool {
    fault >= 0x0A
}

/// What is asked of the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Its state.
    Read,
    /// To do this.
    Write(Command),
}

impl Request {
    /// The frame to send to the gripper at `address`.
    pub fn encode(&self, address: u8) -> Frame {
        let [register, count] = match self {
            Self::Read => [STATE_REGISTER, REGISTERS],
            Self::Write(_) => [COMMAND_REGISTER, REGISTERS],
        };
        let mut frame = Frame::new();
        let mut put = |bytes: &[u8]| {
            // Sixteen bytes at most, half of what there is room for.
            let _ = frame.extend_from_slice(bytes);
        };
        put(&[address, self.function()]);
        put(&register.to_be_bytes());
        put(&count.to_be_bytes());
        if let Self::Write(command) = self {
            put(&[6]);
            put(&command.bytes());
        }
        seal(frame)
    }

    const fn function(&self) -> u8 {
        match self {
            Self::Read => READ_HOLDING,
            Self::Write(_) => WRITE,
        }
    }

    /// How many bytes the answer has, from those of it that are there; `None` while that cannot be
    /// said. What belongs to no answer is said to be complete, so that it is looked at.
    pub fn answer_len(&self, bytes: &[u8]) -> Option<usize> {
        let function = *bytes.get(1)?;
        Some(if function == self.function() | REFUSES {
            SHORTEST_ANSWER
        } else if function != self.function() {
            bytes.len()
        } else {
            match self {
                Self::Read => 3 + usize::from(*bytes.get(2)?) + CHECKSUM_LEN,
                Self::Write(_) => 6 + CHECKSUM_LEN,
            }
        })
    }

    /// The answer of the gripper at `address`: its state if that was asked for.
    ///
    /// # Errors
    /// It is no whole answer to this, or one that refuses.
    pub fn answer(&self, address: u8, bytes: &[u8]) -> Result<Option<State>, FrameError> {
        let got = bytes.len();
        if got < SHORTEST_ANSWER {
            return Err(FrameError::Short { got });
        }
        let (body, said) = bytes.split_at(got - CHECKSUM_LEN);
        let (computed, said) = (checksum(body), u16::from_le_bytes([said[0], said[1]]));
        if computed != said {
            return Err(FrameError::Checksum { computed, said });
        }
        if body[0] != address {
            return Err(FrameError::Address { got: body[0] });
        }
        let function = self.function();
        if body[1] == function | REFUSES && body.len() == 3 {
            return Err(FrameError::Refused { code: body[2] });
        }
        if body[1] != function {
            return Err(FrameError::Function { got: body[1] });
        }
        match (self, body) {
            (Self::Read, [_, _, 6, state @ ..]) => match state.try_into() {
                Ok(state) => Ok(Some(State::from_bytes(state))),
                Err(_) => Err(FrameError::Contents),
            },
            (Self::Write(_), [_, _, written @ ..]) => {
                let ([a, b], [c, d]) = (COMMAND_REGISTER.to_be_bytes(), REGISTERS.to_be_bytes());
                if written == [a, b, c, d] {
                    Ok(None)
                } else {
                    Err(FrameError::Contents)
                }
            }
            _ => Err(FrameError::Contents),
        }
    }
}

/// Puts the checksum behind a frame.
pub(crate) fn seal(mut frame: Frame) -> Frame {
    let sum = checksum(&frame).to_le_bytes();
    // Every caller leaves room for it.
    let _ = frame.extend_from_slice(&sum);
    frame
}

/// Why an answer was refused, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Too short for any answer.
    #[error("{got} bytes are no answer")]
    Short {
        /// Bytes there.
        got: usize,
    },
    /// Damaged on its way.
    #[error("checksum {said:#06x} where the bytes have {computed:#06x}")]
    Checksum {
        /// Of the bytes there.
        computed: u16,
        /// In the frame.
        said: u16,
    },
    /// From another device.
    #[error("an answer from address {got}")]
    Address {
        /// The address.
        got: u8,
    },
    /// To another request.
    #[error("an answer to function {got:#04x}")]
    Function {
        /// The function.
        got: u8,
    },
    /// The gripper refuses.
    #[error("refused with exception {code}")]
    Refused {
        /// The exception.
        code: u8,
    },
    /// Right in form, and not what was asked.
    #[error("an answer about other registers")]
    Contents,
}
