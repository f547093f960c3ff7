//! Modbus RTU frames, the gripper's side: requests in, answers out. For simulators and tests.

use crate::frame::{
    COMMAND_REGISTER, Command, Frame, READ_HOLDING, READ_INPUT, REFUSES, REGISTERS, STATE_REGISTER,
    State, WRITE, checksum, seal,
};

/// A request as the gripper understands it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// So many of the state's registers, by this function.
    Read {
        /// 3 or 4.
        function: u8,
        /// 1 to 3.
        registers: u8,
    },
    /// To do this; the first `registers` of three were written.
    Write {
        /// What to do.
        command: Command,
        /// 1 to 3.
        registers: u8,
    },
    /// Something that it does not know.
    Unknown {
        /// The function.
        function: u8,
    },
}

/// Reads a request to the gripper at `address`. `None` if it is damaged or another's: then a gripper
/// is silent. `before` is the command in force, of which a short write changes the beginning.
pub fn request(address: u8, bytes: &[u8], before: Command) -> Option<Asked> {
    let (body, sum) = bytes.split_last_chunk::<2>()?;
    if checksum(body) != u16::from_le_bytes(*sum) || *body.first()? != address {
        return None;
    }
    let function = *body.get(1)?;
    let unknown = Some(Asked::Unknown { function });
    let [register, count] = match body.get(2..6)? {
        [a, b, c, d] => [u16::from_be_bytes([*a, *b]), u16::from_be_bytes([*c, *d])],
        _ => return unknown,
    };
    if !(1..=REGISTERS).contains(&count) {
        return unknown;
    }
    let registers = count as u8;
    match (function, register, &body[6..]) {
        (READ_HOLDING | READ_INPUT, STATE_REGISTER, []) => Some(Asked::Read {
            function,
            registers,
        }),
        (WRITE, COMMAND_REGISTER, [len, written @ ..])
            if *len == 2 * registers && written.len() == usize::from(*len) =>
        {
            let mut command = before.bytes();
            command[..written.len()].copy_from_slice(written);
            let command = Command::from_bytes(command);
            Some(Asked::Write { command, registers })
        }
        _ => unknown,
    }
}

/// The answer to a request, from the gripper at `address` in this state.
pub fn answer(address: u8, asked: Asked, state: &State) -> Frame {
    const ILLEGAL_FUNCTION: u8 = 1;
    let mut frame = Frame::new();
    let mut put = |bytes: &[u8]| {
        // Nine bytes at most, a quarter of what there is room for.
        let _ = frame.extend_from_slice(bytes);
    };
    match asked {
        Asked::Read {
            function,
            registers,
        } => {
            let len = 2 * registers.min(REGISTERS as u8);
            put(&[address, function, len]);
            put(&state.bytes()[..usize::from(len)]);
        }
        Asked::Write { registers, .. } => {
            put(&[address, WRITE]);
            put(&COMMAND_REGISTER.to_be_bytes());
            put(&u16::from(registers).to_be_bytes());
        }
        Asked::Unknown { function } => put(&[address, function | REFUSES, ILLEGAL_FUNCTION]),
    }
    seal(frame)
}
