//! The robot over UDP, and a simulated robot that answers.
//!
//! In: commands, and a clock. Out: the robot as hal's devices. One socket for both directions; the
//! host speaks first, and the robot answers whoever spoke last.
//!
//! | module | holds |
//! |---|---|
//! | [`client`] | [`HighClient`]: the host's side of the high-level service |
//! | [`simulated`] | [`SimulatedRobot`]: the robot's side, over any [`RobotBody`] |
//! | [`body`] | [`KinematicBody`]: a body that stands, walks and lies without physics |

pub mod body;
pub mod client;
mod counters;
mod error;
pub mod simulated;

pub use body::KinematicBody;
pub use client::{ClientConfig, HighClient};
pub use counters::ClientCounters;
pub use error::ClientError;
pub use simulated::{RobotBody, SimulatedCounters, SimulatedRobot, SimulatedRobotConfig};
