//! The robot over UDP, and a simulated robot that answers.
//!
//! In: commands, and a clock. Out: the robot as hal's devices. One socket for both directions; the
//! host speaks first, and the robot answers whoever spoke last.
//!
//! | module | holds |
//! |---|---|
//! | [`client`] | [`HighClient`]: the host's side of the high-level service |
//! | [`link`] | what carries frames: [`UdpLink`], or [`MemoryLink`] inside one program |
//! | [`simulated`] | [`SimulatedRobot`]: the robot's side, over any [`RobotBody`] |
//! | [`stop`] | [`StopLine`]: a second line to the robot that can only make it stand still |
//! | [`body`] | [`KinematicBody`]: a body that stands, walks and lies without physics |

pub mod body;
pub mod client;
mod counters;
mod error;
pub mod link;
pub mod simulated;
pub mod stop;

pub use body::KinematicBody;
pub use client::{ClientConfig, HighClient};
pub use counters::ClientCounters;
pub use error::ClientError;
pub use link::{MemoryLink, RobotLink, UdpLink};
pub use simulated::{
    RobotBody, SimulatedCounters, SimulatedRobot, SimulatedRobotConfig, SimulatedService,
};
pub use stop::StopLine;
