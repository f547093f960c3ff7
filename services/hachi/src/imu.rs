//! The inertial sensor that the settings name, on a bus of this machine.

use hachi_imu::system::{AnyRegisters, BusFault, open_i2c, open_spi};

use crate::service::settings::imu::ImuBus;

/// Opens the bus. Whether the chip is there, its registers say.
///
/// # Errors
/// There is no such bus, or no right to it.
pub fn open(bus: &ImuBus) -> Result<AnyRegisters, BusFault> {
    match bus {
        ImuBus::I2c { path, address } => open_i2c(path, *address),
        ImuBus::Spi { path } => open_spi(path),
    }
}

impl std::fmt::Display for ImuBus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::I2c { path, address } => write!(f, "{address:#04x} on {}", path.display()),
            Self::Spi { path } => write!(f, "{}", path.display()),
        }
    }
}
