//! The chip's registers (bank 0), its ranges and rates, and what its bytes mean.

use hachi_hal::Vector3;

/// Registers of bank 0 (section 13).
pub(crate) const DEVICE_CONFIG: u8 = 0x11;
pub(crate) const TEMPERATURE: u8 = 0x1D;
pub(crate) const INTERRUPT_STATUS: u8 = 0x2D;
pub(crate) const POWER: u8 = 0x4E;
pub(crate) const GYRO_CONFIG: u8 = 0x4F;
pub(crate) const ACCEL_CONFIG: u8 = 0x50;
pub(crate) const WHO_AM_I: u8 = 0x75;
pub(crate) const BANK: u8 = 0x76;

/// What [`WHO_AM_I`] says.
pub(crate) const ICM_42688_P: u8 = 0x47;
/// Bit of [`DEVICE_CONFIG`].
pub(crate) const RESET: u8 = 0x01;
/// Bits of [`INTERRUPT_STATUS`], which reading clears.
pub(crate) const DATA_READY: u8 = 0x08;
pub(crate) const RESET_DONE: u8 = 0x10;
/// [`POWER`] with gyroscope and accelerometer in their low-noise mode.
pub(crate) const LOW_NOISE: u8 = 0x0F;

/// Bytes of a measurement: temperature, accelerations, turning rates.
pub const MEASUREMENT_LEN: usize = 14;

/// What a register holds before its first measurement (section 14.6 and on).
const NOT_MEASURED: i16 = i16::MIN;
/// Counts of a full range.
const FULL: f64 = 32_768.0;
/// The standard's, m/s².
const GRAVITY: f64 = 9.806_65;

/// Largest turning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum GyroRange {
    /// 2000 °/s.
    #[default]
    Dps2000,
    /// 1000 °/s.
    Dps1000,
    /// 500 °/s.
    Dps500,
    /// 250 °/s.
    Dps250,
}

impl GyroRange {
    /// The range of so many °/s, if the chip has it here.
    pub const fn from_dps(dps: u32) -> Option<Self> {
        Some(match dps {
            2000 => Self::Dps2000,
            1000 => Self::Dps1000,
            500 => Self::Dps500,
            250 => Self::Dps250,
            _ => return None,
        })
    }

    pub(crate) const fn bits(self) -> u8 {
        match self {
            Self::Dps2000 => 0,
            Self::Dps1000 => 1,
            Self::Dps500 => 2,
            Self::Dps250 => 3,
        }
    }

    /// Radians a second of one count.
    pub(crate) fn unit(self) -> f64 {
        let degrees = match self {
            Self::Dps2000 => 2_000.0_f64,
            Self::Dps1000 => 1_000.0,
            Self::Dps500 => 500.0,
            Self::Dps250 => 250.0,
        };
        degrees.to_radians() / FULL
    }
}

/// Largest acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AccelRange {
    /// 16 g.
    G16,
    /// 8 g: the steps of a walking robot stay below.
    #[default]
    G8,
    /// 4 g.
    G4,
    /// 2 g.
    G2,
}

impl AccelRange {
    /// The range of so many g, if the chip has it here.
    pub const fn from_g(g: u32) -> Option<Self> {
        Some(match g {
            16 => Self::G16,
            8 => Self::G8,
            4 => Self::G4,
            2 => Self::G2,
            _ => return None,
        })
    }

    pub(crate) const fn bits(self) -> u8 {
        match self {
            Self::G16 => 0,
            Self::G8 => 1,
            Self::G4 => 2,
            Self::G2 => 3,
        }
    }

    /// m/s² of one count.
    pub(crate) fn unit(self) -> f64 {
        let g = match self {
            Self::G16 => 16.0,
            Self::G8 => 8.0,
            Self::G4 => 4.0,
            Self::G2 => 2.0,
        };
        g * GRAVITY / FULL
    }
}

/// Measurements a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Rate {
    /// 1000.
    Hz1000,
    /// 500.
    Hz500,
    /// 200.
    #[default]
    Hz200,
    /// 100.
    Hz100,
}

impl Rate {
    /// The rate of so many measurements a second, if the chip has it here.
    pub const fn from_hz(hz: u32) -> Option<Self> {
        Some(match hz {
            1000 => Self::Hz1000,
            500 => Self::Hz500,
            200 => Self::Hz200,
            100 => Self::Hz100,
            _ => return None,
        })
    }

    pub(crate) const fn bits(self) -> u8 {
        match self {
            Self::Hz1000 => 6,
            Self::Hz500 => 15,
            Self::Hz200 => 7,
            Self::Hz100 => 8,
        }
    }

    /// Time between two measurements, ns.
    pub const fn period_ns(self) -> i64 {
        match self {
            Self::Hz1000 => 1_000_000,
            Self::Hz500 => 2_000_000,
            Self::Hz200 => 5_000_000,
            Self::Hz100 => 10_000_000,
        }
    }
}

/// What is measured, and how often.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Measuring {
    /// Largest turning rate.
    pub gyro: GyroRange,
    /// Largest acceleration.
    pub accel: AccelRange,
    /// How often.
    pub rate: Rate,
}

impl Measuring {
    /// Values of the gyroscope's and the accelerometer's registers.
    pub(crate) const fn bytes(&self) -> [u8; 2] {
        let rate = self.rate.bits();
        [self.gyro.bits() << 5 | rate, self.accel.bits() << 5 | rate]
    }
}

/// One measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Turning rate, rad/s.
    pub angular_velocity: Vector3,
    /// Specific force, m/s².
    pub specific_force: Vector3,
    /// The chip's temperature, °C.
    pub temperature_c: f64,
    /// A value is at the end of its range: what happened was more.
    pub saturated: bool,
}

impl Measurement {
    /// From its bytes (big-endian, as the chip has them after a reset); `None` if the chip has not
    /// measured yet.
    pub fn decode(bytes: &[u8; MEASUREMENT_LEN], measuring: &Measuring) -> Option<Self> {
        let count = |i: usize| i16::from_be_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        let accel = [count(1), count(2), count(3)];
        let gyro = [count(4), count(5), count(6)];
        let all = || accel.iter().chain(&gyro);
        if all().any(|&count| count == NOT_MEASURED) {
            return None;
        }
        let scaled = |counts: [i16; 3], unit: f64| {
            let [x, y, z] = counts.map(|count| f64::from(count) * unit);
            Vector3::new(x, y, z)
        };
        Some(Self {
            angular_velocity: scaled(gyro, measuring.gyro.unit()),
            specific_force: scaled(accel, measuring.accel.unit()),
            // Section 4.13.
            temperature_c: f64::from(count(0)) / 132.48 + 25.0,
            saturated: all().any(|count| count.unsigned_abs() == i16::MAX.unsigned_abs()),
        })
    }
}
