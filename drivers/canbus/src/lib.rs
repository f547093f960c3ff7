//! Nodes on a CAN bus: an emergency stop that is wired to an input node, and ODrive actuators.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`frame`] | — | [`frame::CanFrame`]: up to eight bytes under an eleven-bit identifier |
//! | [`stop_node`] | frames of a CANopen input node | whether the stop is pressed, and why |
//! | [`odrive`] | commands; frames of CANSimple | frames; state of an axis |
//! | `device` (feature `std`) | a [`device::CanBus`] | [`hachi_hal::EmergencyStop`]; an axis |
//!
//! Without the `std` feature nothing here allocates and everything builds for bare metal.
//!
//! Numbers come from CiA 301 and 401 (heartbeat, emergency, inputs) and from ODrive's CANSimple
//! protocol as of firmware 0.5.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "std")]
pub mod device;
pub mod frame;
pub mod odrive;
pub mod stop_node;

#[cfg(feature = "std")]
pub use device::{BusError, CanStop, OdriveAxis};
