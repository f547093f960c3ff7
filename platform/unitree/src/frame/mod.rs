//! The robots' frames, byte by byte, in both directions.
//!
//! In: the payload of one UDP datagram. Out: all its fields, or a [`FrameError`] with what was
//! seen; and the other way about. Nothing here judges values: numbers that can't be are named
//! where they are used ([`crate::reading`]), and never sent. Elsewhere: which mode to ask for when
//! (`command`), sockets (`device`).
//!
//! All fields are little-endian and packed. Sizes, offsets and check values were measured on what
//! the maker's own library sends and accepts (legged SDK 3.8.6 for the Go1, 3.8.3 for the B1).

mod check;
mod commands;
mod error;
mod layout;
mod parts;
mod remote;
mod states;
mod wire;

pub use check::{CheckForm, check_value, check_value_of_frame, restore, transform};
pub use commands::{
    ANGLE_FREE, BatteryCommand, HighCmd, LowCmd, MOTOR_SERVO, MotorCmd, MotorSaturation, SPEED_FREE,
};
pub(crate) use error::all_finite;
pub use error::{FieldError, FrameError};
pub use layout::{FrameKind, LONGEST_FRAME, Layout, MOST_CELLS, MOST_THERMISTORS, MOTORS, Model};
pub use parts::{
    BatteryReading, BodyReading, Header, ImuReading, LEVEL_HIGH, LEVEL_LOW, MotorState,
};
pub use remote::{Key, Keys, REMOTE_LEN, Remote, STICK_DEAD_ZONE};
pub use states::{HighState, LowState};
pub use wire::{Frame, HEAD};
