//! TDK ICM-42688-P inertial sensor on I2C or SPI, over `embedded-hal`: registers to samples.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`bus`] | an `embedded-hal` bus | [`bus::Registers`]: bytes of registers, both ways |
//! | [`registers`] | ranges and rates; bytes | bytes; turning rates and accelerations in SI units |
//! | [`icm42688`] | registers, the robot's clock | [`hachi_hal::Imu`] |
//!
//! Nothing here allocates and everything builds for bare metal. On Linux the buses are those of
//! `linux-embedded-hal` (`examples/imu.rs`). Samples are in the chip's own axes, which are
//! right-handed; how it is mounted is the platform's matter.
//!
//! Numbers come from the maker's data sheet (DS-000347), each with its section.
#![no_std]
#![forbid(unsafe_code)]

pub mod bus;
pub mod icm42688;
pub mod registers;

pub use bus::{I2cRegisters, SpiRegisters};
pub use icm42688::{Icm42688, ImuConfig, ImuCounters, ImuError};
