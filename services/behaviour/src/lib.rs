//! What the robot does, and the gate that everything it does goes through.
//!
//! In: where the robot is, what stands around it, how old all of that is. Out: commands to a base.
//!
//! | module | holds |
//! |---|---|
//! | [`gate`] | [`SafetyGate`]: what of a wish may reach the base; read [`SafetyGate::step`] first |
//! | [`guarded`] | [`GuardedBase`]: a base that only the gate can reach |
//! | [`cause`] | why the robot stands, with the log's line for each |
//! | [`config`] | limits |
//! | [`obstacles`], [`swept`] | what stands around the robot; where it would stop |
//! | [`passage`] | ways past things: through doors |
//! | [`patrol`] | a behaviour: from place to place, round after round |
//!
//! A behaviour has wishes; it never has a base. The gate sits outside all of them, so that a wrong
//! decision still meets the limits (`docs/safety.md`). Nothing here has a thread, a clock, a socket
//! or a file, and nothing allocates once made.
#![forbid(unsafe_code)]

pub mod cause;
pub mod config;
pub mod gate;
pub mod guarded;
pub mod obstacles;
pub mod passage;
pub mod patrol;
pub mod swept;

pub use cause::{Cause, Causes};
pub use config::{ConfigError, SafetyConfig};
pub use gate::{SafetyGate, Sight, Verdict};
pub use guarded::{Body, GuardedBase};
pub use obstacles::{ObstacleFinder, Obstacles};
pub use passage::{Passage, Step, Way};
pub use patrol::{Patrol, PatrolConfig, PlaceEstimate};
