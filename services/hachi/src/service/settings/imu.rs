//! `[imu]`: an inertial sensor of its own, which chip on which bus and how it is mounted.

use std::path::{Path, PathBuf};

use hachi_imu::ImuConfig;
use hachi_imu::bus::I2C_ADDRESS;
use hachi_imu::registers::{AccelRange, GyroRange, Rate};
use serde::{Deserialize, Serialize};

use crate::config::{Mount, Unworkable};

/// An inertial sensor of its own, an ICM-42688-P.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuSettings {
    /// The bus that it is on; there is none if unset.
    pub bus: Option<PathBuf>,
    /// Its address there, on I2C.
    pub address: u8,
    /// How it sits on the robot's base; only its rotation matters.
    pub base_from_imu: Mount,
    /// Measurements a second.
    pub rate_hz: u32,
    /// Largest turning rate, °/s.
    pub gyro_range_dps: u32,
    /// Largest acceleration, g.
    pub accel_range_g: u32,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            bus: None,
            address: I2C_ADDRESS,
            base_from_imu: Mount::default(),
            rate_hz: 200,
            gyro_range_dps: 2000,
            accel_range_g: 8,
        }
    }
}

/// Where the chip is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ImuBus {
    /// On I2C.
    I2c {
        /// `/dev/i2c-N`.
        path: PathBuf,
        /// The chip's address.
        address: u8,
    },
    /// On SPI.
    Spi {
        /// `/dev/spidevB.C`.
        path: PathBuf,
    },
}

impl ImuSettings {
    /// Where the chip is, where there is one.
    pub fn bus(&self) -> Option<ImuBus> {
        let path = self.bus.clone()?;
        match Kind::of(&path)? {
            Kind::I2c => Some(ImuBus::I2c {
                path,
                address: self.address,
            }),
            Kind::Spi => Some(ImuBus::Spi { path }),
        }
    }

    /// How it measures.
    pub fn measuring(&self) -> ImuConfig {
        // The settings were checked; what the chip does not have is its usual.
        ImuConfig {
            gyro: GyroRange::from_dps(self.gyro_range_dps).unwrap_or_default(),
            accel: AccelRange::from_g(self.accel_range_g).unwrap_or_default(),
            rate: Rate::from_hz(self.rate_hz).unwrap_or_default(),
        }
    }

    pub(super) fn check(&self) -> Result<(), Unworkable> {
        let unworkable = |key: &str, value: String, next_step: &str| Unworkable {
            key: format!("imu.{key}"),
            what: format!("{value} can't work"),
            next_step: next_step.to_owned(),
        };
        if let Some(bus) = self.bus.as_ref().filter(|bus| Kind::of(bus).is_none()) {
            let next_step =
                "name an I2C bus as \"/dev/i2c-1\" or an SPI device as \"/dev/spidev0.0\"";
            return Err(unworkable("bus", format!("{bus:?}"), next_step));
        }
        if !(I2C_ADDRESS..=I2C_ADDRESS + 1).contains(&self.address) {
            let next_step = "give 0x68, or 0x69 where its pin AP_AD0 is high";
            return Err(unworkable(
                "address",
                format!("{:#04x}", self.address),
                next_step,
            ));
        }
        if Rate::from_hz(self.rate_hz).is_none() {
            let next_step = "give 100, 200, 500 or 1000";
            return Err(unworkable("rate_hz", self.rate_hz.to_string(), next_step));
        }
        if GyroRange::from_dps(self.gyro_range_dps).is_none() {
            let (value, next_step) = (self.gyro_range_dps, "give 250, 500, 1000 or 2000");
            return Err(unworkable("gyro_range_dps", value.to_string(), next_step));
        }
        if AccelRange::from_g(self.accel_range_g).is_none() {
            let (value, next_step) = (self.accel_range_g, "give 2, 4, 8 or 16");
            return Err(unworkable("accel_range_g", value.to_string(), next_step));
        }
        self.base_from_imu.check("imu.base_from_imu")
    }
}

enum Kind {
    I2c,
    Spi,
}

impl Kind {
    /// Of the names that Linux gives.
    fn of(path: &Path) -> Option<Self> {
        let name = path.strip_prefix("/dev").ok()?.to_str()?;
        let number = |text: &str| text.parse::<u16>().is_ok();
        if name.strip_prefix("i2c-").is_some_and(number) {
            return Some(Self::I2c);
        }
        let (bus, chip) = name.strip_prefix("spidev")?.split_once('.')?;
        (number(bus) && number(chip)).then_some(Self::Spi)
    }
}
