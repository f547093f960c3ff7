//! Intel RealSense D415, D435 and D455 over plain USB video: bytes to depth and colour in metres
//! and degrees of grey, two streams to frames that belong together.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`frame`] | bytes of Z16, YUYV and metadata buffers | counts, colours, times on the camera's clock |
//! | [`align`] | a depth image and the optics | the same depths as the colour camera sees them |
//! | [`calibration`] | the tables that the factory wrote | [`hachi_hal::Intrinsics`], the extrinsics |
//! | [`monitor`], [`controls`] | commands, settings | payloads of the UVC extension unit, and back |
//! | [`encode`] | what a camera says | its own bytes, for simulators and tests |
//! | `device` (feature `std`) | a [`device::CameraPort`] | [`hachi_hal::RgbdCamera`] |
//!
//! Without the `std` feature nothing here allocates and everything builds for bare metal. Where the
//! camera is mounted is the platform crates' matter.
//!
//! Numbers come from librealsense's D400 sources and the kernel's `metafmt-d4xx` unless a constant
//! says otherwise; none of it has a published manual.
#![no_std]
#![deny(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod align;
mod bytes;
pub mod calibration;
pub mod controls;
#[cfg(feature = "std")]
pub mod device;
pub mod encode;
pub mod frame;
pub mod monitor;

#[cfg(feature = "std")]
pub use device::{CameraError, RealSense, RealSenseConfig, RealSenseCounters};

/// USB vendor of all of them.
pub const VENDOR: u16 = 0x8086;

/// A camera that is known here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Model {
    /// D415: 55 mm baseline, rolling shutter.
    D415,
    /// D435: 50 mm baseline.
    D435,
    /// D455: 95 mm baseline, global shutters, inertial sensor.
    D455,
}

impl Model {
    /// The camera of a USB product number.
    pub const fn from_product(product: u16) -> Option<Self> {
        match product {
            0x0AD3 => Some(Self::D415),
            0x0B07 => Some(Self::D435),
            0x0B5C => Some(Self::D455),
            _ => None,
        }
    }

    /// Its USB product number.
    pub const fn product(self) -> u16 {
        match self {
            Self::D415 => 0x0AD3,
            Self::D435 => 0x0B07,
            Self::D455 => 0x0B5C,
        }
    }

    /// What it says on the case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::D415 => "D415",
            Self::D435 => "D435",
            Self::D455 => "D455",
        }
    }
}
