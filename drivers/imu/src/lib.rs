//! TDK ICM-42688-P inertial sensor on I2C or SPI, over `embedded-hal`: registers to samples.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`bus`] | an `embedded-hal` bus | [`bus::Registers`]: bytes of registers, both ways |
//! | [`registers`] | ranges and rates; bytes | bytes; turning rates and accelerations in SI units |
//! | [`icm42688`] | registers, the robot's clock | [`hachi_hal::Imu`] |
//! | `system` (feature `std`) | `/dev/i2c-N`, `/dev/spidevB.C` | [`bus::Registers`] |
//! | `simulated` (feature `std`) | bytes of registers, a motion | a chip inside the program |
//!
//! But for these two nothing here allocates and everything builds for bare metal. Samples are in the
//! chip's own axes, which are right-handed; how it is mounted is the robot's matter.
//!
//! Numbers come from the maker's data sheet (DS-000347), each with its section.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod bus;
pub mod icm42688;
pub mod registers;
#[cfg(feature = "std")]
pub mod simulated;
#[cfg(feature = "std")]
pub mod system;

pub use bus::{I2cRegisters, Registers, SpiRegisters};
pub use embedded_hal::delay::DelayNs;
pub use icm42688::{Icm42688, ImuConfig, ImuCounters, ImuError, check_identity};
