//! Registers over the two buses that the chip speaks.

use core::fmt;

use embedded_hal::i2c::I2c;
use embedded_hal::spi::{Operation, SpiDevice};

/// The chip's address on I2C with its pin AP_AD0 low; one more with it high (section 9.3).
pub const I2C_ADDRESS: u8 = 0x68;
/// The first bit of a transfer on SPI reads (section 9.6).
const READ: u8 = 0x80;

/// Registers of one chip.
pub trait Registers {
    /// What can go wrong.
    type Error: fmt::Debug;
    /// Reads registers that follow each other.
    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), Self::Error>;
    /// Writes one register.
    fn write(&mut self, register: u8, value: u8) -> Result<(), Self::Error>;
}

/// A chip on I2C.
#[derive(Debug)]
pub struct I2cRegisters<B> {
    bus: B,
    address: u8,
}

impl<B> I2cRegisters<B> {
    /// The chip at `address` on `bus`.
    pub fn new(bus: B, address: u8) -> Self {
        Self { bus, address }
    }

    /// The bus.
    pub fn release(self) -> B {
        self.bus
    }
}

impl<B: I2c> Registers for I2cRegisters<B> {
    type Error = B::Error;

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), B::Error> {
        self.bus.write_read(self.address, &[first], bytes)
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), B::Error> {
        self.bus.write(self.address, &[register, value])
    }
}

/// A chip on SPI (mode 0 or 3, at most 24 MHz).
#[derive(Debug)]
pub struct SpiRegisters<D> {
    device: D,
}

impl<D> SpiRegisters<D> {
    /// The chip that `device` selects.
    pub fn new(device: D) -> Self {
        Self { device }
    }

    /// The device.
    pub fn release(self) -> D {
        self.device
    }
}

impl<D: SpiDevice> Registers for SpiRegisters<D> {
    type Error = D::Error;

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), D::Error> {
        self.device
            .transaction(&mut [Operation::Write(&[first | READ]), Operation::Read(bytes)])
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), D::Error> {
        self.device.write(&[register & !READ, value])
    }
}
