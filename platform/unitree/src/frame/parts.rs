//! What frames are made of: header, inertial sensor, motors, battery.

use heapless::Vec;

use super::layout::{Layout, MOST_CELLS, MOST_THERMISTORS, MOTORS};
use super::wire::{Fields, HEAD};

/// Level flag of high-level frames.
pub const LEVEL_HIGH: u8 = 0xEE;
/// Level flag of low-level frames.
pub const LEVEL_LOW: u8 = 0xFF;

/// What every frame begins with, after its two head bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Header {
    /// [`LEVEL_HIGH`], [`LEVEL_LOW`], 0xF0 for triggers; zero in commands to the lesser editions.
    pub level: u8,
    /// Reserved.
    pub reserve: u8,
    /// The robot's serial number; its first byte is the product, its second the edition.
    pub serial: [u32; 2],
    /// Versions of hardware (first three bytes) and software (the next three).
    pub version: [u32; 2],
    /// Bandwidth, as the maker calls it.
    pub bandwidth: u16,
}

impl Header {
    pub(crate) const fn of_level(level: u8) -> Self {
        Self {
            level,
            reserve: 0,
            serial: [0; 2],
            version: [0; 2],
            bandwidth: 0,
        }
    }

    /// The product byte of the serial number: see [`super::Model::product_code`]. Zero where the
    /// robot does not say.
    pub const fn product(&self) -> u8 {
        self.serial[0].to_le_bytes()[0]
    }

    pub(crate) fn write_head(io: &mut impl Fields) {
        io.bytes(&mut { HEAD });
    }

    /// Everything after the two head bytes.
    pub(crate) fn lay_out(&mut self, io: &mut impl Fields) {
        io.u8(&mut self.level);
        io.u8(&mut self.reserve);
        for word in self.serial.iter_mut().chain(&mut self.version) {
            io.u32(word);
        }
        io.u16(&mut self.bandwidth);
    }
}

/// The inertial sensor in the trunk, with the robot's own estimate of its attitude.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuReading {
    /// Attitude, w x y z; takes directions of the trunk to a frame whose z points up.
    pub quaternion: [f32; 4],
    /// Angular velocity, rad/s.
    pub gyroscope: [f32; 3],
    /// Specific force, m/s².
    pub accelerometer: [f32; 3],
    /// The attitude as roll, pitch and yaw, rad.
    pub rpy: [f32; 3],
    /// Temperature, °C.
    pub temperature_c: i8,
}

impl ImuReading {
    pub(crate) fn lay_out(&mut self, io: &mut impl Fields) {
        io.f32s(&mut self.quaternion);
        io.f32s(&mut self.gyroscope);
        io.f32s(&mut self.accelerometer);
        io.f32s(&mut self.rpy);
        io.i8(&mut self.temperature_c);
    }
}

/// What one motor reports.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorState {
    /// 0x0A while it works, 0 while it damps, 8 when a Go1's is too hot.
    pub mode: u8,
    /// Joint angle, rad.
    pub angle: f32,
    /// Joint speed, rad/s.
    pub speed: f32,
    /// Joint acceleration, rad/s². Whole numbers at low level.
    pub acceleration: f32,
    /// Estimated torque, Nm. In steps of 1/256 (Go1) or 1/128 (B1) at low level.
    pub torque: f32,
    /// Angle before filtering, rad.
    pub raw_angle: f32,
    /// Speed before filtering, rad/s.
    pub raw_speed: f32,
    /// Acceleration before filtering, rad/s².
    pub raw_acceleration: f32,
    /// Temperature, °C.
    pub temperature_c: i8,
    /// Reserved.
    pub reserve: [u32; 2],
}

impl MotorState {
    /// The 38 bytes of a HighState.
    pub(crate) fn lay_out_high(&mut self, io: &mut impl Fields) {
        io.u8(&mut self.mode);
        io.f32(&mut self.angle);
        io.f32(&mut self.speed);
        io.f32(&mut self.acceleration);
        io.f32(&mut self.torque);
        io.f32(&mut self.raw_angle);
        io.f32(&mut self.raw_speed);
        io.f32(&mut self.raw_acceleration);
        self.lay_out_end(io);
    }

    /// The 32 bytes of a LowState.
    pub(crate) fn lay_out_low(&mut self, io: &mut impl Fields, torque_counts_per_nm: f32) {
        io.u8(&mut self.mode);
        io.f32(&mut self.angle);
        io.f32(&mut self.speed);
        io.i16_scaled(&mut self.acceleration, 1.0);
        io.i16_scaled(&mut self.torque, torque_counts_per_nm);
        io.f32(&mut self.raw_angle);
        io.f32(&mut self.raw_speed);
        io.i16_scaled(&mut self.raw_acceleration, 1.0);
        self.lay_out_end(io);
    }

    fn lay_out_end(&mut self, io: &mut impl Fields) {
        io.i8(&mut self.temperature_c);
        for word in &mut self.reserve {
            io.u32(word);
        }
    }
}

/// What the battery reports.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BatteryReading {
    /// Version, high and low.
    pub version: [u8; 2],
    /// Go1: 0 wakes up, 1 discharges, 2 charges, 3 charger there, 4 pre-charges, 5 charge error,
    /// 6 waterfall light, 7 discharges itself, 8 broken. B1: 1 is normal.
    pub status: u8,
    /// Charge, per cent.
    pub charge_percent: u8,
    /// Current, mA; negative while it is drained.
    pub current_ma: i32,
    /// Charge cycles.
    pub cycles: u16,
    /// Temperatures at its monitor, °C.
    pub monitor_temperatures_c: Vec<i8, MOST_THERMISTORS>,
    /// Temperatures at its controller, °C.
    pub controller_temperatures_c: Vec<i8, MOST_THERMISTORS>,
    /// Cell voltages, mV. In steps of 32 mV at low level.
    pub cells_mv: Vec<u16, MOST_CELLS>,
}

/// Millivolts of one count of a cell in a LowState.
const LOW_CELL_STEP_MV: u16 = 32;

impl BatteryReading {
    /// A dead battery with as many cells and thermistors as the robot's has.
    pub fn of(layout: &Layout) -> Self {
        let mut reading = Self::default();
        // The layouts' numbers are within the capacities, so nothing is left out.
        let _ = reading.monitor_temperatures_c.resize(layout.thermistors, 0);
        let _ = reading
            .controller_temperatures_c
            .resize(layout.thermistors, 0);
        let _ = reading.cells_mv.resize(layout.cells, 0);
        reading
    }

    pub(crate) fn lay_out_high(&mut self, io: &mut impl Fields) {
        self.lay_out_front(io);
        for cell in &mut self.cells_mv {
            io.u16(cell);
        }
    }

    pub(crate) fn lay_out_low(&mut self, io: &mut impl Fields) {
        self.lay_out_front(io);
        for cell in &mut self.cells_mv {
            let mut steps = u8::try_from(*cell / LOW_CELL_STEP_MV).unwrap_or(u8::MAX);
            io.u8(&mut steps);
            *cell = u16::from(steps) * LOW_CELL_STEP_MV;
        }
    }

    fn lay_out_front(&mut self, io: &mut impl Fields) {
        io.bytes(&mut self.version);
        io.u8(&mut self.status);
        io.u8(&mut self.charge_percent);
        io.i32(&mut self.current_ma);
        io.u16(&mut self.cycles);
        let monitor = self.monitor_temperatures_c.iter_mut();
        for degrees in monitor.chain(&mut self.controller_temperatures_c) {
            io.i8(degrees);
        }
    }
}

/// The middle of both states: inertial sensor, motors, battery, feet.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyReading {
    /// Inertial sensor.
    pub imu: ImuReading,
    /// Motors: three for each leg, hip, thigh, calf, legs in the order FR, FL, RR, RL; the last
    /// eight are unused.
    pub motors: [MotorState; MOTORS],
    /// Battery.
    pub battery: BatteryReading,
    /// Foot sensors, counts.
    pub foot_force: [i16; 4],
    /// The robot's estimate of them. A Go1's is always zero.
    pub foot_force_estimate: [i16; 4],
}

impl BodyReading {
    /// All zeros.
    pub fn of(layout: &Layout) -> Self {
        Self {
            imu: ImuReading::default(),
            motors: [MotorState::default(); MOTORS],
            battery: BatteryReading::of(layout),
            foot_force: [0; 4],
            foot_force_estimate: [0; 4],
        }
    }

    pub(crate) fn lay_out_feet(&mut self, io: &mut impl Fields) {
        for force in self.foot_force.iter_mut() {
            io.i16(force);
        }
        for force in self.foot_force_estimate.iter_mut() {
            io.i16(force);
        }
    }
}
