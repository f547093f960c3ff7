//! Any bytes from an inertial sensor's registers: samples are finite and in order, whatever the bus
//! says and however often it fails.
#![no_main]

use std::cell::Cell;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use hachi_hal::conformance::SamplePromise;
use hachi_hal::{Clock, Imu, Stamp};
use hachi_imu::bus::Registers;
use hachi_imu::registers::{MEASUREMENT_LEN, Measurement, Measuring};
use hachi_imu::{Icm42688, ImuConfig};
use libfuzzer_sys::fuzz_target;

/// A bus whose bytes are the fuzzer's once the chip is set up, and a clock that waiting moves.
#[derive(Clone)]
struct Chip<'a> {
    bytes: Rc<Cell<&'a [u8]>>,
    now_ns: Rc<Cell<i64>>,
    written: Rc<Cell<u8>>,
    set_up: Rc<Cell<bool>>,
}

impl Clock for Chip<'_> {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.now_ns.get())
    }
}

impl DelayNs for Chip<'_> {
    fn delay_ns(&mut self, ns: u32) {
        self.now_ns.set(self.now_ns.get() + i64::from(ns));
    }
}

impl Registers for Chip<'_> {
    type Error = ();

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), ()> {
        if !self.set_up.get() {
            bytes[0] = match first {
                0x75 => 0x47,
                0x2D => 0x10,
                _ => self.written.get(),
            };
            return Ok(());
        }
        let (&command, rest) = self.bytes.get().split_first().ok_or(())?;
        if command == 0xFF {
            self.bytes.set(rest);
            return Err(());
        }
        let (now, later) = rest.split_at(bytes.len().min(rest.len()));
        bytes[..now.len()].copy_from_slice(now);
        self.bytes.set(later);
        Ok(())
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), ()> {
        self.written.set(value);
        if register == 0x4E {
            self.set_up.set(true);
        }
        Ok(())
    }
}

fuzz_target!(|data: &[u8]| {
    if let Some(bytes) = data.first_chunk::<MEASUREMENT_LEN>()
        && let Some(m) = Measurement::decode(bytes, &Measuring::default())
    {
        // 2000 degrees a second and eight times gravity, and no more.
        assert!(m.angular_velocity.amax() <= 34.907 && m.specific_force.amax() <= 78.454);
    }
    let chip = Chip {
        bytes: Rc::new(Cell::new(data)),
        now_ns: Rc::default(),
        written: Rc::default(),
        set_up: Rc::default(),
    };
    let imu = Icm42688::start(
        chip.clone(),
        chip.clone(),
        chip.clone(),
        ImuConfig::default(),
    );
    let mut imu = imu.unwrap();
    let mut promise = SamplePromise::default();
    while !chip.bytes.get().is_empty() {
        if let Ok(Some(sample)) = imu.read(chip.now() + 50_000_000) {
            promise.check(&sample).unwrap();
        }
    }
});
