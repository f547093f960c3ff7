//! The driver over buses that hold it to the chip's data sheet: every byte of a session, and a chip
//! in registers that measures, is late, loses its power and fails.

use std::cell::Cell;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal_mock::eh1::delay::StdSleep;
use embedded_hal_mock::eh1::i2c::{Mock as I2cMock, Transaction as I2c};
use embedded_hal_mock::eh1::spi::{Mock as SpiMock, Transaction as Spi};
use hachi_hal::conformance::check_imu;
use hachi_hal::{Clock, DeviceError, FaultKind, Imu, Stamp, Vector3};
use hachi_imu::bus::I2C_ADDRESS;
use hachi_imu::registers::{AccelRange, GyroRange, Measurement, Measuring, Rate};
use hachi_imu::simulated::{Measures, SimulatedChip};
use hachi_imu::system::BusFault;
use hachi_imu::{I2cRegisters, Icm42688, ImuConfig, ImuError, SpiRegisters, check_identity};

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

/// Time that passes only while something is waited for or looked at: a look takes 20 µs.
#[derive(Clone, Default)]
struct Waited(Rc<Cell<i64>>);

impl Waited {
    fn pass(&self, ns: i64) {
        self.0.set(self.0.get() + ns);
    }
}

impl Clock for Waited {
    fn now(&self) -> Stamp {
        self.pass(20_000);
        Stamp::from_nanos(self.0.get())
    }
}

impl DelayNs for Waited {
    fn delay_ns(&mut self, ns: u32) {
        self.pass(i64::from(ns));
    }
}

type Chip = SimulatedChip<Waited>;

/// A chip, and the time it lives in.
fn chip() -> (Chip, Waited) {
    let time = Waited::default();
    (SimulatedChip::new(time.clone()), time)
}

fn start(
    (chip, time): &(Chip, Waited),
) -> Result<Icm42688<Chip, Waited, Waited>, ImuError<BusFault>> {
    Icm42688::start(
        chip.clone(),
        time.clone(),
        time.clone(),
        ImuConfig::default(),
    )
}

#[test]
fn it_keeps_the_promise_of_imus() {
    let rig = chip();
    let mut imu = start(&rig).unwrap();
    let (chip, time) = &rig;
    chip.fail(1);
    let tally = check_imu(&mut imu, time, 400, 2 * MS).unwrap();
    assert_eq!(tally.faults, 1);
    assert!(tally.items > 100 && tally.nothing > 100, "{tally:?}");
    assert_eq!(imu.counters().missed, 0);
}

#[test]
fn samples_are_stamped_when_they_are_ready_and_missed_ones_counted() {
    let rig = chip();
    let mut imu = start(&rig).unwrap();
    let time = &rig.1;
    let by = |ms: i64| Stamp::from_nanos(ms * MS);
    let first = imu.read(by(1_000)).unwrap().unwrap().stamp;
    let second = imu.read(by(1_000)).unwrap().unwrap().stamp;
    let apart_ns = second.nanos_since(first);
    assert!((apart_ns - 5 * MS).abs() < MS, "{apart_ns}");
    assert_eq!(
        imu.read(time.now() + MS).unwrap(),
        None,
        "not ready in a millisecond"
    );
    // Away for five periods.
    time.pass(25 * MS);
    imu.read(by(1_000)).unwrap().unwrap();
    let missed = imu.counters().missed;
    assert!((4..=5).contains(&missed), "{missed}");
}

#[test]
fn a_chip_that_lost_its_power_is_started_anew() {
    let rig = chip();
    let mut imu = start(&rig).unwrap();
    let (chip, time) = &rig;
    imu.read(time.now() + 100 * MS).unwrap().unwrap();
    chip.lose_power();
    let back = imu.read(time.now() + 500 * MS).unwrap().unwrap();
    near(&back.specific_force, [0.0, 0.0, 9.806_65], 1e-9);
    assert_eq!(imu.counters().restarts, 1);
}

#[test]
fn what_the_chip_has_not_measured_is_no_sample() {
    let rig = chip();
    let mut imu = start(&rig).unwrap();
    let (chip, time) = &rig;
    let mut none = AT_REST;
    none[4..6].copy_from_slice(&[0x80, 0]);
    chip.set(Measures::Bytes(none));
    assert_eq!(imu.read(time.now() + 12 * MS).unwrap(), None);
    chip.set(Measures::Bytes([0x7F; 14]));
    assert!(imu.read(time.now() + 12 * MS).unwrap().is_some());
    let mut end = AT_REST;
    end[8..10].copy_from_slice(&[0x7F, 0xFF]);
    chip.set(Measures::Bytes(end));
    assert!(imu.read(time.now() + 12 * MS).unwrap().is_some());
    let counters = imu.counters();
    assert!(counters.not_measured >= 2, "{counters:?}");
    assert_eq!(counters.saturated, 1);
}

#[test]
fn a_motion_comes_out_as_it_went_in() {
    let rig = chip();
    let mut imu = start(&rig).unwrap();
    let (chip, time) = &rig;
    let (turning, force) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(3.0, -4.0, 60.0));
    chip.set(Measures::Motion(turning, force));
    let sample = imu.read(time.now() + 12 * MS).unwrap().unwrap();
    // Half a count of 2000 °/s and 8 g.
    near(&sample.angular_velocity, turning.into(), 6e-4);
    near(&sample.specific_force, force.into(), 1.3e-3);
}

#[test]
fn what_is_no_such_chip_is_refused_with_what_it_says() {
    let mut rig = chip();
    // An MPU-6050.
    rig.0.call_itself(0x68);
    let other = start(&rig).err().unwrap();
    assert_eq!(other, ImuError::OtherChip { got: 0x68 });
    assert_eq!(other.kind(), FaultKind::FixConfig);
    assert_eq!(check_identity(&mut rig.0), Err(other));
    let mut rig = chip();
    assert_eq!(check_identity(&mut rig.0), Ok(()));
    rig.0.hang(true);
    assert_eq!(start(&rig).err(), Some(ImuError::NoReset));
    let rig = chip();
    rig.0.fail(1);
    let silent = start(&rig).err().unwrap();
    assert_eq!(silent.kind(), FaultKind::ReadAgain);
    assert!(silent.to_string().contains("Remote I/O error"), "{silent}");
}

#[cfg(target_os = "linux")]
#[test]
fn what_is_no_bus_is_said_in_the_systems_words() {
    use std::path::Path;

    use hachi_imu::system::{open_i2c, open_spi};

    let said = |path: &str| {
        let path = Path::new(path);
        let i2c = open_i2c(path, I2C_ADDRESS).err().unwrap();
        let spi = open_spi(path).err().unwrap();
        [i2c, spi].map(|fault| format!("{fault:?}"))
    };
    for fault in said("/dev/i2c-250") {
        assert!(fault.contains("No such file or directory"), "{fault}");
    }
    // There, and no bus: ENOTTY, by its name or its number.
    for fault in said("/dev/null") {
        assert!(
            fault.contains("ENOTTY") || fault.contains("os error 25"),
            "{fault}"
        );
    }
}
