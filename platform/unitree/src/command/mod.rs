//! From what is asked of a base to what its robot is told.
//!
//! In: [`hachi_hal::BaseCommand`]s, and the mode that the robot reports. Out: the HighCmd that is
//! in force at any moment. No socket and no clock: `device` sends it.
//!
//! The robot walks by modes, and changing between them in the wrong order lets it drop. The
//! maker documents no transitions; [`ModeLadder`] keeps to the order of the maker's examples.

mod commander;
mod ladder;
mod limits;

pub use commander::{CommandRefused, Commander, CommanderConfig, Told};
pub use ladder::{Mode, ModeLadder, Rung};
pub use limits::{CommandLimits, GaitKind, VelocityLimits};
