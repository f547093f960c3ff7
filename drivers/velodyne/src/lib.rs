//! Velodyne VLP-16 (Puck, Puck LITE, Puck Hi-Res): bytes to timed points, packets to whole turns.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`packet`] | the payload of one UDP datagram | points with their own firing times; GPS state |
//! | [`encode`] | what each laser saw | the sensor's own bytes, for simulators and tests |
//! | `device` (feature `std`) | a [`hachi_hal::PacketSource`] | [`hachi_hal::LidarScans`]: whole turns |
//!
//! Without the `std` feature nothing here allocates and everything builds for bare metal. Sockets
//! and capture files live in `hachi-datagram`, the mounting of the sensor in the platform crates,
//! removal of motion blur in the odometry.
//!
//! Numbers come from the maker's VLP-16 manual (63-9243) unless a constant says otherwise.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate alloc;
#[cfg(test)]
extern crate std;

#[cfg(feature = "std")]
pub mod device;
pub mod encode;
pub mod packet;

#[cfg(feature = "std")]
pub use device::{StampSource, VelodyneConfig, VelodyneCounters, VelodyneScans};
