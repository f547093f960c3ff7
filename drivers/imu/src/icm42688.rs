//! The chip as [`Imu`]: started, asked for measurements, started anew where it lost its settings.
//!
//! In: its registers, the robot's clock, a delay. Out: samples stamped when they are ready, and a
//! count of what was left out, by reason.

use core::fmt;
use core::ops::AddAssign;

use embedded_hal::delay::DelayNs;
use hachi_hal::{Clock, DeviceError, FaultKind, Imu, ImuSample, Stamp};

use crate::bus::Registers;
use crate::registers::{
    ACCEL_CONFIG, BANK, DATA_READY, DEVICE_CONFIG, GYRO_CONFIG, ICM_42688_P, INTERRUPT_STATUS,
    LOW_NOISE, MEASUREMENT_LEN, Measurement, Measuring, POWER, RESET, RESET_DONE, TEMPERATURE,
    WHO_AM_I,
};

/// A reset takes 1 ms (section 14.1).
const RESET_MS: u32 = 1;
/// No register may be written for 200 µs after the sensors are switched on (section 14.36).
const SWITCH_ON_US: u32 = 200;
/// The gyroscope runs after 30 ms (table 1), and stays on for 45 ms at least (section 14.36).
const START_UP_MS: u32 = 45;
/// How often a measurement is looked for in one period.
const LOOKS: i64 = 8;
/// Measurements that may be missed before the chip is asked what is wrong.
const MISSED: i64 = 20;

/// How the chip is set.
pub type ImuConfig = Measuring;

/// Counts of what came and of what was left out, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ImuCounters {
    /// Samples handed out.
    pub samples: u64,
    /// Measurements that nobody fetched in time, by the clock.
    pub missed: u64,
    /// Measurements that the chip marks as none.
    pub not_measured: u64,
    /// Samples with a value at the end of its range.
    pub saturated: u64,
    /// How often the chip had lost its settings and was started anew.
    pub restarts: u64,
}

impl ImuCounters {
    /// Reasons for which something was left out or is in doubt, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("missed", self.missed),
            ("not_measured", self.not_measured),
            ("saturated", self.saturated),
            ("restarts", self.restarts),
        ]
        .into_iter()
    }
}

impl AddAssign for ImuCounters {
    fn add_assign(&mut self, more: Self) {
        self.samples += more.samples;
        self.missed += more.missed;
        self.not_measured += more.not_measured;
        self.saturated += more.saturated;
        self.restarts += more.restarts;
    }
}

/// Why there is no sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImuError<E: fmt::Debug> {
    /// The bus.
    #[error("the inertial sensor's bus: {0:?}; is it wired and powered?")]
    Bus(E),
    /// Another chip, or none.
    #[error("the chip says {got:#04x}, an ICM-42688-P says 0x47: is the address right?")]
    OtherChip {
        /// What it says.
        got: u8,
    },
    /// It did not come back from its reset.
    #[error("the inertial sensor does not come back from its reset")]
    NoReset,
    /// A setting did not stay.
    #[error("register {register:#04x} holds {got:#04x} instead of {written:#04x}")]
    NotTaken {
        /// Which register.
        register: u8,
        /// What was written.
        written: u8,
        /// What it holds.
        got: u8,
    },
}

impl<E: fmt::Debug> DeviceError for ImuError<E> {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Bus(_) => FaultKind::ReadAgain,
            Self::NoReset | Self::NotTaken { .. } => FaultKind::Reopen,
            Self::OtherChip { .. } => FaultKind::FixConfig,
        }
    }
}

/// Asks the chip who it is. It goes on as it did.
///
/// # Errors
/// It does not answer, or is another.
pub fn check_identity<R: Registers>(registers: &mut R) -> Result<(), ImuError<R::Error>> {
    match byte_of(registers, WHO_AM_I)? {
        ICM_42688_P => Ok(()),
        got => Err(ImuError::OtherChip { got }),
    }
}

fn byte_of<R: Registers>(registers: &mut R, register: u8) -> Result<u8, ImuError<R::Error>> {
    let mut byte = [0];
    registers.read(register, &mut byte).map_err(ImuError::Bus)?;
    Ok(byte[0])
}

/// An ICM-42688-P.
#[derive(Debug)]
pub struct Icm42688<R, D, C> {
    registers: R,
    delay: D,
    clock: C,
    measuring: Measuring,
    /// When the last measurement was seen, or the chip was started.
    last: Stamp,
    /// Whether `last` is a sample's stamp.
    delivered: bool,
    temperature_c: Option<f64>,
    counters: ImuCounters,
}

impl<R: Registers, D: DelayNs, C: Clock> Icm42688<R, D, C> {
    /// Starts the chip behind `registers`. Takes 50 ms.
    ///
    /// # Errors
    /// It is not there, is another, or does not take its settings.
    pub fn start(
        registers: R,
        delay: D,
        clock: C,
        config: ImuConfig,
    ) -> Result<Self, ImuError<R::Error>> {
        let mut imu = Self {
            last: clock.now(),
            registers,
            delay,
            clock,
            measuring: config,
            delivered: false,
            temperature_c: None,
            counters: ImuCounters::default(),
        };
        imu.set_up()?;
        imu.last = imu.clock.now();
        Ok(imu)
    }

    /// What happened so far.
    pub fn counters(&self) -> ImuCounters {
        self.counters
    }

    /// The chip's temperature at the last sample, °C: its offsets drift with it.
    pub fn temperature_c(&self) -> Option<f64> {
        self.temperature_c
    }

    /// The bus, for others.
    pub fn release(self) -> (R, D) {
        (self.registers, self.delay)
    }

    fn set_up(&mut self) -> Result<(), ImuError<R::Error>> {
        self.write(BANK, 0)?;
        self.write(DEVICE_CONFIG, RESET)?;
        self.delay.delay_ms(RESET_MS);
        if self.byte(INTERRUPT_STATUS)? & RESET_DONE == 0 {
            // What answers at all but not to this is another chip; else it is this one, stuck.
            check_identity(&mut self.registers)?;
            return Err(ImuError::NoReset);
        }
        check_identity(&mut self.registers)?;
        let [gyro, accel] = self.measuring.bytes();
        for (register, written) in [(GYRO_CONFIG, gyro), (ACCEL_CONFIG, accel)] {
            self.write(register, written)?;
            let got = self.byte(register)?;
            if got != written {
                return Err(ImuError::NotTaken {
                    register,
                    written,
                    got,
                });
            }
        }
        self.write(POWER, LOW_NOISE)?;
        self.delay.delay_us(SWITCH_ON_US);
        self.delay.delay_ms(START_UP_MS);
        Ok(())
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), ImuError<R::Error>> {
        self.registers.write(register, value).map_err(ImuError::Bus)
    }

    fn byte(&mut self, register: u8) -> Result<u8, ImuError<R::Error>> {
        byte_of(&mut self.registers, register)
    }

    /// The measurement that is ready, if one is.
    fn fetch(&mut self) -> Result<Option<Measurement>, ImuError<R::Error>> {
        if self.byte(INTERRUPT_STATUS)? & DATA_READY == 0 {
            return Ok(None);
        }
        let mut bytes = [0; MEASUREMENT_LEN];
        self.registers
            .read(TEMPERATURE, &mut bytes)
            .map_err(ImuError::Bus)?;
        let measurement = Measurement::decode(&bytes, &self.measuring);
        self.counters.not_measured += u64::from(measurement.is_none());
        Ok(measurement)
    }

    fn sample(&mut self, measurement: &Measurement, now: Stamp) -> ImuSample {
        let period_ns = self.measuring.rate.period_ns();
        let since_ns = now.nanos_since(self.last);
        if self.delivered {
            // A look late is no measurement late.
            let missed = (since_ns + period_ns / 2) / period_ns - 1;
            self.counters.missed += u64::try_from(missed).unwrap_or(0);
        }
        let stamp = if self.delivered && since_ns <= 0 {
            self.last + 1
        } else {
            now
        };
        self.last = stamp;
        self.delivered = true;
        self.temperature_c = Some(measurement.temperature_c);
        self.counters.samples += 1;
        self.counters.saturated += u64::from(measurement.saturated);
        ImuSample {
            stamp,
            angular_velocity: measurement.angular_velocity,
            specific_force: measurement.specific_force,
        }
    }

    /// Nothing came for long: a chip that lost its power for a moment is as after a reset, with its
    /// sensors off.
    fn revive(&mut self, now: Stamp) -> Result<(), ImuError<R::Error>> {
        let limit_ns = MISSED * self.measuring.rate.period_ns();
        if now.nanos_since(self.last) < limit_ns {
            return Ok(());
        }
        if self.byte(POWER)? != LOW_NOISE {
            self.counters.restarts += 1;
            self.set_up()?;
        }
        self.last = self.clock.now();
        self.delivered = false;
        Ok(())
    }
}

impl<R: Registers, D: DelayNs, C: Clock> Imu for Icm42688<R, D, C> {
    type Error = ImuError<R::Error>;

    fn read(&mut self, deadline: Stamp) -> Result<Option<ImuSample>, Self::Error> {
        let between_looks = self.measuring.rate.period_ns() / LOOKS;
        loop {
            let measurement = self.fetch()?;
            let now = self.clock.now();
            if let Some(measurement) = measurement {
                return Ok(Some(self.sample(&measurement, now)));
            }
            self.revive(now)?;
            let left_ns = deadline.nanos_since(self.clock.now());
            if left_ns <= 0 {
                return Ok(None);
            }
            // An eighth of a period at most.
            self.delay.delay_ns(left_ns.min(between_looks) as u32);
        }
    }
}
