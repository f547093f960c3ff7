//! The driver over buses that hold it to the chip's data sheet: every byte of a session, and a chip
//! in registers that measures, is late, loses its power and fails.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal_mock::eh1::delay::StdSleep;
use embedded_hal_mock::eh1::i2c::{Mock as I2cMock, Transaction as I2c};
use embedded_hal_mock::eh1::spi::{Mock as SpiMock, Transaction as Spi};
use hachi_hal::conformance::check_imu;
use hachi_hal::{Clock, DeviceError, FaultKind, Imu, Stamp, Vector3};
use hachi_imu::bus::{I2C_ADDRESS, Registers};
use hachi_imu::registers::{AccelRange, GyroRange, Measurement, Measuring, Rate};
use hachi_imu::{I2cRegisters, Icm42688, ImuConfig, ImuError, SpiRegisters};

const MS: i64 = 1_000_000;

/// A clock that moves by a millisecond with each look.
struct Ticking(Cell<i64>);

impl Clock for Ticking {
    fn now(&self) -> Stamp {
        self.0.set(self.0.get() + MS);
        Stamp::from_nanos(self.0.get())
    }
}

/// At rest on its back at 25 °C, 8 g and 2000 °/s, turning left by 10 °/s: 4096 counts a g and 16.384
/// a degree a second.
const AT_REST: [u8; 14] = [0, 0, 0, 0, 0, 0, 0x10, 0x00, 0, 0, 0, 0, 0x00, 164];

#[track_caller]
fn near(got: &Vector3, want: [f64; 3], tolerance: f64) {
    assert!(
        (got - Vector3::from(want)).amax() < tolerance,
        "{got} {want:?}"
    );
}

#[test]
fn every_byte_on_i2c_is_the_data_sheets() {
    let (write, read) = (I2c::write, I2c::write_read);
    let a = I2C_ADDRESS;
    let expected = [
        write(a, vec![0x76, 0x00]),
        write(a, vec![0x11, 0x01]),
        read(a, vec![0x2D], vec![0x10]),
        read(a, vec![0x75], vec![0x47]),
        // 2000 °/s and 8 g, 200 times a second.
        write(a, vec![0x4F, 0x07]),
        read(a, vec![0x4F], vec![0x07]),
        write(a, vec![0x50, 0x27]),
        read(a, vec![0x50], vec![0x27]),
        write(a, vec![0x4E, 0x0F]),
        // Not ready, ready.
        read(a, vec![0x2D], vec![0x00]),
        read(a, vec![0x2D], vec![0x08]),
        read(a, vec![0x1D], AT_REST.to_vec()),
    ];
    let mut bus = I2cMock::new(&expected);
    let registers = I2cRegisters::new(bus.clone(), a);
    let clock = Ticking(Cell::new(0));
    let mut imu = Icm42688::start(registers, StdSleep::new(), clock, ImuConfig::default()).unwrap();
    let sample = imu.read(Stamp::from_nanos(i64::MAX)).unwrap().unwrap();
    near(&sample.specific_force, [0.0, 0.0, 9.806_65], 1e-9);
    near(
        &sample.angular_velocity,
        [0.0, 0.0, 10.0_f64.to_radians()],
        2e-4,
    );
    assert_eq!(imu.temperature_c(), Some(25.0));
    bus.done();
}

#[test]
fn every_byte_on_spi_is_the_data_sheets() {
    let write = |bytes: [u8; 2]| {
        [
            Spi::transaction_start(),
            Spi::write_vec(bytes.to_vec()),
            Spi::transaction_end(),
        ]
    };
    let read = |register: u8, bytes: &[u8]| {
        [
            Spi::transaction_start(),
            Spi::write_vec(vec![register]),
            Spi::read_vec(bytes.to_vec()),
            Spi::transaction_end(),
        ]
    };
    let mut expected = Vec::new();
    expected.extend(write([0x76, 0x00]));
    expected.extend(write([0x11, 0x01]));
    expected.extend(read(0xAD, &[0x10]));
    expected.extend(read(0xF5, &[0x47]));
    // 250 °/s and 2 g, 1000 times a second.
    expected.extend(write([0x4F, 0x66]));
    expected.extend(read(0xCF, &[0x66]));
    expected.extend(write([0x50, 0x66]));
    expected.extend(read(0xD0, &[0x66]));
    expected.extend(write([0x4E, 0x0F]));
    expected.extend(read(0xAD, &[0x18]));
    expected.extend(read(0x9D, &AT_REST));
    let mut device = SpiMock::new(&expected);
    let config = Measuring {
        gyro: GyroRange::Dps250,
        accel: AccelRange::G2,
        rate: Rate::Hz1000,
    };
    let registers = SpiRegisters::new(device.clone());
    let clock = Ticking(Cell::new(0));
    let mut imu = Icm42688::start(registers, StdSleep::new(), clock, config).unwrap();
    let sample = imu.read(Stamp::from_nanos(i64::MAX)).unwrap().unwrap();
    // A quarter and an eighth of what they were.
    near(&sample.specific_force, [0.0, 0.0, 9.806_65 / 4.0], 1e-9);
    near(
        &sample.angular_velocity,
        [0.0, 0.0, 1.25_f64.to_radians()],
        3e-5,
    );
    device.done();
}

#[test]
fn measurements_are_scaled_by_their_ranges_and_signed() {
    let mut bytes = [0; 14];
    bytes[..2].copy_from_slice(&(-1_325_i16).to_be_bytes());
    for (i, count) in [16_384, -16_384, 1, 32_767, -1, 0_i16]
        .into_iter()
        .enumerate()
    {
        bytes[2 + 2 * i..4 + 2 * i].copy_from_slice(&count.to_be_bytes());
    }
    let measuring = Measuring {
        gyro: GyroRange::Dps500,
        accel: AccelRange::G16,
        rate: Rate::Hz500,
    };
    let m = Measurement::decode(&bytes, &measuring).unwrap();
    // Half of 16 g; the end of 500 °/s.
    near(&m.specific_force, [78.453_2, -78.453_2, 0.004_788], 1e-6);
    near(&m.angular_velocity, [8.726_380, -0.000_266, 0.0], 1e-6);
    assert!((m.temperature_c - 15.0).abs() < 0.01);
    assert!(m.saturated);
    bytes[8..10].copy_from_slice(&i16::MIN.to_be_bytes());
    assert_eq!(Measurement::decode(&bytes, &measuring), None);
}

/// A chip in registers. Time passes only while it is waited for or looked at.
#[derive(Clone)]
struct Chip(Rc<State>);

struct State {
    now_ns: Cell<i64>,
    memory: RefCell<[u8; 128]>,
    /// When the next measurement is ready, ns.
    next_ns: Cell<i64>,
    /// Reads that fail.
    failing: Cell<u32>,
    stuck: Cell<bool>,
    measurement: Cell<[u8; 14]>,
}

impl Chip {
    fn new() -> Self {
        let chip = Self(Rc::new(State {
            now_ns: Cell::new(0),
            memory: RefCell::new([0; 128]),
            next_ns: Cell::new(i64::MAX),
            failing: Cell::new(0),
            stuck: Cell::new(false),
            measurement: Cell::new(AT_REST),
        }));
        chip.lose_power();
        chip
    }

    fn lose_power(&self) {
        let mut memory = self.0.memory.borrow_mut();
        *memory = [0; 128];
        memory[0x75] = 0x47;
        memory[0x2D] = 0x10;
        memory[0x4F] = 0x06;
        memory[0x50] = 0x06;
        self.0.next_ns.set(i64::MAX);
    }

    fn start(&self) -> Result<Icm42688<Self, Self, Self>, ImuError<()>> {
        Icm42688::start(
            self.clone(),
            self.clone(),
            self.clone(),
            ImuConfig::default(),
        )
    }

    fn set(&self, register: usize, value: u8) {
        self.0.memory.borrow_mut()[register] = value;
    }

    fn pass(&self, ns: i64) {
        self.0.now_ns.set(self.0.now_ns.get() + ns);
    }
}

impl Clock for Chip {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.0.now_ns.get())
    }
}

impl DelayNs for Chip {
    fn delay_ns(&mut self, ns: u32) {
        self.pass(i64::from(ns));
    }
}

impl Registers for Chip {
    type Error = ();

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), ()> {
        // A transfer takes time too.
        self.pass(20_000);
        let state = &*self.0;
        if state.failing.get() > 0 {
            state.failing.set(state.failing.get() - 1);
            return Err(());
        }
        let now_ns = state.now_ns.get();
        let mut memory = state.memory.borrow_mut();
        if now_ns >= state.next_ns.get() {
            memory[0x2D] |= 0x08;
            memory[0x1D..0x2B].copy_from_slice(&state.measurement.get());
            let late = (now_ns - state.next_ns.get()) / (5 * MS) + 1;
            state.next_ns.set(state.next_ns.get() + late * 5 * MS);
        }
        bytes.copy_from_slice(&memory[usize::from(first)..][..bytes.len()]);
        if first == 0x2D {
            memory[0x2D] = 0;
        }
        Ok(())
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), ()> {
        if register == 0x11 && value == 1 {
            let identity = self.0.memory.borrow()[0x75];
            self.lose_power();
            self.set(0x75, identity);
            if self.0.stuck.get() {
                self.set(0x2D, 0);
            }
            return Ok(());
        }
        if register == 0x4E && value == 0x0F {
            self.0.next_ns.set(self.0.now_ns.get() + 5 * MS);
        }
        self.set(usize::from(register), value);
        Ok(())
    }
}

#[test]
fn it_keeps_the_promise_of_imus() {
    let chip = Chip::new();
    let mut imu = chip.start().unwrap();
    chip.0.failing.set(1);
    let tally = check_imu(&mut imu, &chip, 400, 2 * MS).unwrap();
    assert_eq!(tally.faults, 1);
    assert!(tally.items > 100 && tally.nothing > 100, "{tally:?}");
    assert_eq!(imu.counters().missed, 0);
}

#[test]
fn samples_are_stamped_when_they_are_ready_and_missed_ones_counted() {
    let chip = Chip::new();
    let mut imu = chip.start().unwrap();
    let by = |ms: i64| Stamp::from_nanos(ms * MS);
    let first = imu.read(by(1_000)).unwrap().unwrap().stamp;
    let second = imu.read(by(1_000)).unwrap().unwrap().stamp;
    let apart_ns = second.nanos_since(first);
    assert!((apart_ns - 5 * MS).abs() < MS, "{apart_ns}");
    assert_eq!(
        imu.read(chip.now() + MS).unwrap(),
        None,
        "not ready in a millisecond"
    );
    // Away for five periods.
    chip.pass(25 * MS);
    imu.read(by(1_000)).unwrap().unwrap();
    let missed = imu.counters().missed;
    assert!((4..=5).contains(&missed), "{missed}");
}

#[test]
fn a_chip_that_lost_its_power_is_started_anew() {
    let chip = Chip::new();
    let mut imu = chip.start().unwrap();
    imu.read(chip.now() + 100 * MS).unwrap().unwrap();
    chip.lose_power();
    let back = imu.read(chip.now() + 500 * MS).unwrap().unwrap();
    near(&back.specific_force, [0.0, 0.0, 9.806_65], 1e-9);
    assert_eq!(imu.counters().restarts, 1);
}

#[test]
fn what_the_chip_has_not_measured_is_no_sample() {
    let chip = Chip::new();
    let mut imu = chip.start().unwrap();
    let mut none = AT_REST;
    none[4..6].copy_from_slice(&[0x80, 0]);
    chip.0.measurement.set(none);
    assert_eq!(imu.read(chip.now() + 12 * MS).unwrap(), None);
    chip.0.measurement.set([0x7F; 14]);
    assert!(imu.read(chip.now() + 12 * MS).unwrap().is_some());
    let mut end = AT_REST;
    end[8..10].copy_from_slice(&[0x7F, 0xFF]);
    chip.0.measurement.set(end);
    assert!(imu.read(chip.now() + 12 * MS).unwrap().is_some());
    let counters = imu.counters();
    assert!(counters.not_measured >= 2, "{counters:?}");
    assert_eq!(counters.saturated, 1);
}

#[test]
fn what_is_no_such_chip_is_refused_with_what_it_says() {
    let chip = Chip::new();
    // An MPU-6050.
    chip.set(0x75, 0x68);
    let other = chip.start().err().unwrap();
    assert_eq!(other, ImuError::OtherChip { got: 0x68 });
    assert_eq!(other.kind(), FaultKind::FixConfig);
    let chip = Chip::new();
    chip.0.stuck.set(true);
    assert_eq!(chip.start().err(), Some(ImuError::NoReset));
    let chip = Chip::new();
    chip.0.failing.set(1);
    let silent = chip.start().err().unwrap();
    assert_eq!(silent.kind(), FaultKind::ReadAgain);
}
