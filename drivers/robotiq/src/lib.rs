//! Robotiq 2F-85 gripper over Modbus RTU: frames to fingers.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`frame`] | commands; bytes of an answer | bytes of a request; state of the fingers |
//! | [`serve`] | bytes of a request | what it asks, and bytes of the answer: the gripper's side |
//! | `device` (feature `std`) | a [`device::Line`] | [`hachi_hal::Gripper`] |
//!
//! Without the `std` feature nothing here allocates and everything builds for bare metal.
//!
//! Numbers come from the maker's manual of the 2F-85 (registers, states, faults) and the Modbus
//! documents ("MODBUS over serial line" V1.02 for timing, "application protocol" V1.1b3 for frames).
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "std")]
pub mod device;
pub mod frame;
pub mod serve;

#[cfg(feature = "std")]
pub use device::{GripperError, Robotiq, RobotiqCounters};
