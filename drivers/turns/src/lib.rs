//! What all spinning LiDARs share above their packets: cutting the stream of points into turns, and
//! moving the sensor's time onto the robot's clock.
//!
//! In: the points of one packet after the other, each with its time on the sensor's clock, and when
//! the packet arrived. Out: whole turns with their header. Elsewhere: what the bytes mean, which
//! packets are missing, repeated or damaged (the drivers).
//!
//! | module | holds |
//! |---|---|
//! | [`assembler`] | [`TurnAssembler`]: points of packets to points of turns |
//! | [`clock_map`] | [`ClockMap`]: the offset between two clocks from arrival times |
//! | [`stamper`] | [`TurnStamper`]: headers on the robot's clock that never overlap |
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod assembler;
pub mod clock_map;
pub mod stamper;

pub use assembler::{CutAngle, PacketPoints, Turn, TurnAssembler};
pub use clock_map::ClockMap;
pub use stamper::{TurnStamper, deliver};
