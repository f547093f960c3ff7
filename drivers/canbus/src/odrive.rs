//! CANSimple, the protocol of ODrive's motor controllers: commands out, states in.
//!
//! An identifier is the node's number (six bits) and the command's (five); numbers are
//! little-endian.

use crate::frame::CanFrame;

/// Nodes have six bits.
pub const MOST_NODE: u8 = 0x3F;

const HEARTBEAT: u16 = 0x01;
const STOP: u16 = 0x02;
const AXIS_STATE: u16 = 0x07;
const ENCODER: u16 = 0x09;
const MODE: u16 = 0x0B;
const POSITION: u16 = 0x0C;
const VELOCITY: u16 = 0x0D;
const TORQUE: u16 = 0x0E;
const LIMITS: u16 = 0x0F;
const CURRENT: u16 = 0x14;
const BUS: u16 = 0x17;
const CLEAR: u16 = 0x18;

/// Feed-forward terms of a position are counted in thousandths.
const FEED_FORWARD: f32 = 1_000.0;

/// What an axis is asked to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AxisState {
    /// Without current: it can be turned by hand.
    Idle,
    /// Everything that is set to happen at the start.
    Startup,
    /// Motor and encoder are measured; the motor turns.
    FullCalibration,
    /// Looks for the encoder's index; the motor turns.
    IndexSearch,
    /// Does what it is told.
    ClosedLoop,
    /// Looks for its end stop; the motor turns.
    Homing,
}

impl AxisState {
    /// Its number.
    pub const fn number(self) -> u32 {
        match self {
            Self::Idle => 1,
            Self::Startup => 2,
            Self::FullCalibration => 3,
            Self::IndexSearch => 6,
            Self::ClosedLoop => 8,
            Self::Homing => 11,
        }
    }
}

/// What an axis follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ControlMode {
    /// Nm.
    Torque,
    /// Turns a second.
    Velocity,
    /// Turns.
    Position,
}

impl ControlMode {
    /// Its number.
    const fn number(self) -> u32 {
        match self {
            Self::Torque => 1,
            Self::Velocity => 2,
            Self::Position => 3,
        }
    }
}

/// Inputs are followed as they come.
const PASS_THROUGH: u32 = 1;

/// What an axis is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Stop at once, with an error that has to be cleared.
    Stop,
    /// Be this.
    State(AxisState),
    /// Follow this.
    Mode(ControlMode),
    /// Go there.
    Position {
        /// Turns.
        turns: f32,
        /// Turns a second, on top.
        velocity: f32,
        /// Nm, on top.
        torque: f32,
    },
    /// Turn this fast.
    Velocity {
        /// Turns a second.
        turns_per_s: f32,
        /// Nm, on top.
        torque: f32,
    },
    /// Turn this hard.
    Torque {
        /// Nm.
        torque: f32,
    },
    /// Never faster, never with more current.
    Limits {
        /// Turns a second.
        turns_per_s: f32,
        /// A.
        current: f32,
    },
    /// Forget errors.
    ClearErrors,
    /// Say the voltage and current of the supply.
    AskBus,
}

/// Why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// More than six bits.
    #[error("node {got} is above 63")]
    Node {
        /// The number.
        got: u8,
    },
    /// A number is not finite.
    #[error("a number of the command is not finite")]
    NotFinite,
    /// A feed-forward term does not fit into its sixteen bits.
    #[error("a feed-forward term is beyond 32.767")]
    FeedForward,
}

impl Command {
    /// The frame that tells the axis `node`.
    ///
    /// # Errors
    /// The node is none, or a number cannot be told.
    pub fn encode(&self, node: u8) -> Result<CanFrame, CommandError> {
        if node > MOST_NODE {
            return Err(CommandError::Node { got: node });
        }
        let (command, first, second) = match *self {
            Self::Stop => return empty(node, STOP),
            Self::ClearErrors => return empty(node, CLEAR),
            Self::AskBus => return request(node, BUS),
            Self::State(state) => return short(node, AXIS_STATE, &state.number().to_le_bytes()),
            Self::Torque { torque } => return short(node, TORQUE, &number(torque)?),
            Self::Mode(mode) => (
                MODE,
                mode.number().to_le_bytes(),
                PASS_THROUGH.to_le_bytes(),
            ),
            Self::Position {
                turns,
                velocity,
                torque,
            } => {
                let ([a, b], [c, d]) = (feed_forward(velocity)?, feed_forward(torque)?);
                (POSITION, number(turns)?, [a, b, c, d])
            }
            Self::Velocity {
                turns_per_s,
                torque,
            } => (VELOCITY, number(turns_per_s)?, number(torque)?),
            Self::Limits {
                turns_per_s,
                current,
            } => (LIMITS, number(turns_per_s)?, number(current)?),
        };
        let ([a, b, c, d], [e, f, g, h]) = (first, second);
        short(node, command, &[a, b, c, d, e, f, g, h])
    }
}

fn id(node: u8, command: u16) -> u16 {
    u16::from(node) << 5 | command
}

fn short(node: u8, command: u16, bytes: &[u8]) -> Result<CanFrame, CommandError> {
    // At most eight bytes, and eleven bits by the check of the node.
    CanFrame::new(id(node, command), bytes).ok_or(CommandError::Node { got: node })
}

fn empty(node: u8, command: u16) -> Result<CanFrame, CommandError> {
    short(node, command, &[])
}

fn request(node: u8, command: u16) -> Result<CanFrame, CommandError> {
    CanFrame::request(id(node, command)).ok_or(CommandError::Node { got: node })
}

fn number(value: f32) -> Result<[u8; 4], CommandError> {
    if value.is_finite() {
        Ok(value.to_le_bytes())
    } else {
        Err(CommandError::NotFinite)
    }
}

fn feed_forward(value: f32) -> Result<[u8; 2], CommandError> {
    number(value)?;
    let counts = value * FEED_FORWARD;
    if counts.abs() <= f32::from(i16::MAX) {
        Ok((counts as i16).to_le_bytes())
    } else {
        Err(CommandError::FeedForward)
    }
}

/// What an axis says.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Message {
    /// That it lives, every 100 ms.
    Heartbeat {
        /// Its errors, a bit each; 0 is none.
        axis_errors: u32,
        /// Its state's number.
        state: u8,
        /// Whether motor, encoder, controller have errors.
        part_errors: [bool; 3],
        /// Whether it has come to where it was sent.
        arrived: bool,
    },
    /// Where it is, every 10 ms.
    Encoder {
        /// Turns.
        turns: f32,
        /// Turns a second.
        turns_per_s: f32,
    },
    /// Its current.
    Current {
        /// What the controller wants, A.
        wanted: f32,
        /// What flows, A.
        measured: f32,
    },
    /// Its supply.
    Bus {
        /// V.
        voltage: f32,
        /// A.
        current: f32,
    },
}

/// Why a frame of an axis was left out, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// Shorter than what it has to say.
    #[error("{got} bytes of command {command:#04x}, eight are needed")]
    Length {
        /// The command.
        command: u8,
        /// Bytes there.
        got: usize,
    },
    /// A number that is none.
    #[error("a number of command {command:#04x} is not finite")]
    NotFinite {
        /// The command.
        command: u8,
    },
}

impl Message {
    /// What a frame of the axis `node` says; `None` if it is not that axis's or nothing that is read
    /// here.
    ///
    /// # Errors
    /// It is damaged.
    pub fn decode(node: u8, frame: &CanFrame) -> Result<Option<Self>, MessageError> {
        let command = frame.id() & 0x1F;
        if frame.is_request() || frame.id() >> 5 != u16::from(node) {
            return Ok(None);
        }
        if ![HEARTBEAT, ENCODER, CURRENT, BUS].contains(&command) {
            return Ok(None);
        }
        // Five bits.
        let command = command as u8;
        let data = frame.data();
        let Ok([a, b, c, d, e, f, g, h]) = <[u8; 8]>::try_from(data) else {
            return Err(MessageError::Length {
                command,
                got: data.len(),
            });
        };
        let numbers = [[a, b, c, d], [e, f, g, h]].map(f32::from_le_bytes);
        if u16::from(command) != HEARTBEAT && !numbers.iter().all(|v| v.is_finite()) {
            return Err(MessageError::NotFinite { command });
        }
        Ok(Some(match u16::from(command) {
            HEARTBEAT => Self::Heartbeat {
                axis_errors: u32::from_le_bytes([a, b, c, d]),
                state: e,
                part_errors: [f & 1 != 0, g & 1 != 0, h & 1 != 0],
                arrived: h & 0x80 != 0,
            },
            ENCODER => Self::Encoder {
                turns: numbers[0],
                turns_per_s: numbers[1],
            },
            CURRENT => Self::Current {
                wanted: numbers[0],
                measured: numbers[1],
            },
            _ => Self::Bus {
                voltage: numbers[0],
                current: numbers[1],
            },
        }))
    }

    /// The frame in which the axis `node` says it. For simulators and tests.
    ///
    /// # Errors
    /// The node is none, or a number cannot be said.
    pub fn encode(&self, node: u8) -> Result<CanFrame, CommandError> {
        if node > MOST_NODE {
            return Err(CommandError::Node { got: node });
        }
        let (command, first, second) = match *self {
            Self::Heartbeat {
                axis_errors,
                state,
                part_errors: [motor, encoder, controller],
                arrived,
            } => {
                let last = u8::from(controller) | u8::from(arrived) << 7;
                let rest = [state, u8::from(motor), u8::from(encoder), last];
                (HEARTBEAT, axis_errors.to_le_bytes(), rest)
            }
            Self::Encoder { turns, turns_per_s } => (ENCODER, number(turns)?, number(turns_per_s)?),
            Self::Current { wanted, measured } => (CURRENT, number(wanted)?, number(measured)?),
            Self::Bus { voltage, current } => (BUS, number(voltage)?, number(current)?),
        };
        let ([a, b, c, d], [e, f, g, h]) = (first, second);
        short(node, command, &[a, b, c, d, e, f, g, h])
    }
}
