//! Buses of this machine, by the names that Linux gives them.
//!
//! In: `/dev/i2c-N` or `/dev/spidevB.C`. Out: the registers of the chip there. The system calls are
//! those of `linux-embedded-hal`; another system has no such bus, and says so.

use std::boxed::Box;
use std::fmt;
use std::path::Path;
use std::string::String;
use std::time::Duration;

use embedded_hal::delay::DelayNs;

use crate::bus::Registers;

/// What went wrong on a bus, in the system's words.
#[derive(Clone, PartialEq, Eq)]
pub struct BusFault(pub String);

impl fmt::Debug for BusFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Registers behind whichever bus it is.
pub type AnyRegisters = Box<dyn Registers<Error = BusFault> + Send>;

impl Registers for AnyRegisters {
    type Error = BusFault;

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), BusFault> {
        (**self).read(first, bytes)
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        (**self).write(register, value)
    }
}

/// Lets the thread sleep.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sleep;

impl DelayNs for Sleep {
    fn delay_ns(&mut self, ns: u32) {
        std::thread::sleep(Duration::from_nanos(u64::from(ns)));
    }
}

/// Opens the chip at `address` on an I2C bus. Whether it is there, its registers say.
///
/// # Errors
/// There is no such bus, or no right to it.
pub fn open_i2c(path: &Path, address: u8) -> Result<AnyRegisters, BusFault> {
    buses::open_i2c(path, address)
}

/// Opens the chip that an SPI device selects.
///
/// # Errors
/// There is no such device, no right to it, or it can't be set to the chip's mode.
pub fn open_spi(path: &Path) -> Result<AnyRegisters, BusFault> {
    buses::open_spi(path)
}

#[cfg(target_os = "linux")]
mod buses {
    use std::boxed::Box;
    use std::path::Path;
    use std::string::ToString;

    use linux_embedded_hal::spidev::{SpiModeFlags, SpidevOptions};
    use linux_embedded_hal::{I2cdev, SpidevDevice};

    use super::{AnyRegisters, BusFault};
    use crate::bus::{I2cRegisters, Registers, SpiRegisters};

    /// Bits a second on SPI: a measurement takes 34 µs. The chip takes up to 24 MHz (section 9.6),
    /// wires on pin headers less.
    const SPI_HZ: u32 = 4_000_000;

    pub(super) fn open_i2c(path: &Path, address: u8) -> Result<AnyRegisters, BusFault> {
        let bus = I2cdev::new(path).map_err(fault)?;
        Ok(Box::new(InWords(I2cRegisters::new(bus, address))))
    }

    pub(super) fn open_spi(path: &Path) -> Result<AnyRegisters, BusFault> {
        let mut device = SpidevDevice::open(path).map_err(fault)?;
        let options = SpidevOptions::new()
            .bits_per_word(8)
            .max_speed_hz(SPI_HZ)
            .mode(SpiModeFlags::SPI_MODE_0)
            .build();
        device.configure(&options).map_err(fault)?;
        Ok(Box::new(InWords(SpiRegisters::new(device))))
    }

    fn fault(error: impl ToString) -> BusFault {
        BusFault(error.to_string())
    }

    /// Registers whose bus says in words what went wrong.
    struct InWords<R>(R);

    impl<R: Registers<Error: ToString>> Registers for InWords<R> {
        type Error = BusFault;

        fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), BusFault> {
            self.0.read(first, bytes).map_err(fault)
        }

        fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
            self.0.write(register, value).map_err(fault)
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod buses {
    use std::path::Path;
    use std::string::ToString;

    use super::{AnyRegisters, BusFault};

    pub(super) fn open_i2c(_: &Path, _: u8) -> Result<AnyRegisters, BusFault> {
        Err(BusFault("this system has no I2C bus".to_string()))
    }

    pub(super) fn open_spi(_: &Path) -> Result<AnyRegisters, BusFault> {
        Err(BusFault("this system has no SPI device".to_string()))
    }
}
