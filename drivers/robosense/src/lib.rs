//! RoboSense RS-Helios-16P: bytes to timed points, packets to whole turns.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`packet`] | the payload of one UDP datagram | points with their own firing times; calibration, state |
//! | [`encode`] | what each laser saw | the sensor's own bytes, for simulators and tests |
//! | `device` (feature `std`) | a [`hachi_hal::PacketSource`] | [`hachi_hal::LidarScans`]: whole turns |
//!
//! Without the `std` feature nothing here allocates and everything builds for bare metal. Sockets
//! and capture files live in `hachi-datagram`, the mounting of the sensor in the platform crates,
//! removal of motion blur in the odometry.
//!
//! Numbers come from the maker's RS-Helios-16P manual; where a recording of a real sensor says
//! otherwise, the constant says so.
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
pub use device::{CalibrationSource, RobosenseConfig, RobosenseCounters, RobosenseScans};
