//! What the host sends: HighCmd and LowCmd, in both directions.
//!
//! A number that is not finite is never sent: encoding refuses it by name.

use super::check::CheckForm;
use super::error::{FieldError, FrameError, all_finite};
use super::layout::{FrameKind, Layout, MOTORS};
use super::parts::{Header, LEVEL_HIGH, LEVEL_LOW};
use super::remote::REMOTE_LEN;
use super::wire::{Fields, Frame, Writer, opened};

/// The battery's part of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BatteryCommand {
    /// 0xA5 switches the robot off.
    pub off: u8,
    /// Reserved.
    pub reserve: [u8; 3],
}

impl BatteryCommand {
    fn lay_out(&mut self, io: &mut impl Fields) {
        io.u8(&mut self.off);
        io.bytes(&mut self.reserve);
    }
}

/// Walk, stand or lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HighCmd {
    /// Header.
    pub header: Header,
    /// [`crate::command::Mode`].
    pub mode: u8,
    /// [`crate::command::GaitKind`].
    pub gait: u8,
    /// B1, in walking mode 3: 0 low, 1 medium, 2 high.
    pub speed_level: u8,
    /// How much higher than usual feet are lifted, m.
    pub foot_raise_height: f32,
    /// How much higher than usual the body is carried, m.
    pub body_height: f32,
    /// Of a reserved mode.
    pub position: [f32; 2],
    /// Roll, pitch, yaw of a standing body, rad.
    pub euler: [f32; 3],
    /// Forward and left, m/s.
    pub velocity: [f32; 2],
    /// Turning left, rad/s.
    pub yaw_speed: f32,
    /// B1: shift of the centre of mass, m. Not sent to a Go1.
    pub centre_of_mass_shift: [f32; 2],
    /// B1: shift of the standing feet, m. Not sent to a Go1.
    pub stance_shift: [f32; 2],
    /// Battery.
    pub battery: BatteryCommand,
    /// Four lamps: red, green, blue.
    pub led: [[u8; 3]; 4],
    /// A remote control's state, as if from it.
    pub remote: [u8; REMOTE_LEN],
    /// Reserved.
    pub reserve: u32,
}

impl Default for HighCmd {
    /// All zeros but the level flag.
    fn default() -> Self {
        Self {
            header: Header::of_level(LEVEL_HIGH),
            mode: 0,
            gait: 0,
            speed_level: 0,
            foot_raise_height: 0.0,
            body_height: 0.0,
            position: [0.0; 2],
            euler: [0.0; 3],
            velocity: [0.0; 2],
            yaw_speed: 0.0,
            centre_of_mass_shift: [0.0; 2],
            stance_shift: [0.0; 2],
            battery: BatteryCommand::default(),
            led: [[0; 3]; 4],
            remote: [0; REMOTE_LEN],
            reserve: 0,
        }
    }
}

impl HighCmd {
    /// The frame's contents, and which form of check value it carries.
    ///
    /// # Errors
    /// The bytes are not a whole HighCmd for this robot.
    pub fn decode(layout: &Layout, bytes: &[u8]) -> Result<(Self, CheckForm), FrameError> {
        let (mut reader, form) = opened(layout, FrameKind::HighCmd, bytes)?;
        let mut command = Self::default();
        command.lay_out(layout, &mut reader);
        Ok((command, form))
    }

    /// The frame for this robot.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn encode(&self, layout: &Layout, form: CheckForm) -> Result<Frame, FieldError> {
        self.check_finite()?;
        let mut writer = Writer::new();
        Header::write_head(&mut writer);
        let mut command = *self;
        command.lay_out(layout, &mut writer);
        Ok(writer.sealed(form))
    }

    /// Refuses numbers that are not finite: what a robot does with them nobody knows.
    ///
    /// # Errors
    /// The first one.
    pub fn check_finite(&self) -> Result<(), FieldError> {
        all_finite("foot raise height", &[self.foot_raise_height])?;
        all_finite("body height", &[self.body_height])?;
        all_finite("position", &self.position)?;
        all_finite("euler", &self.euler)?;
        all_finite("velocity", &self.velocity)?;
        all_finite("yaw speed", &[self.yaw_speed])?;
        all_finite("centre of mass shift", &self.centre_of_mass_shift)?;
        all_finite("stance shift", &self.stance_shift)
    }

    fn lay_out(&mut self, layout: &Layout, io: &mut impl Fields) {
        self.header.lay_out(io);
        io.u8(&mut self.mode);
        io.u8(&mut self.gait);
        io.u8(&mut self.speed_level);
        io.f32(&mut self.foot_raise_height);
        io.f32(&mut self.body_height);
        io.f32s(&mut self.position);
        io.f32s(&mut self.euler);
        io.f32s(&mut self.velocity);
        io.f32(&mut self.yaw_speed);
        if layout.has_stance_shifts {
            io.f32s(&mut self.centre_of_mass_shift);
            io.f32s(&mut self.stance_shift);
        }
        self.battery.lay_out(io);
        for lamp in &mut self.led {
            io.bytes(lamp);
        }
        io.bytes(&mut self.remote);
        io.u32(&mut self.reserve);
    }
}

/// Angle that means: do not control it.
pub const ANGLE_FREE: f32 = 2.146e9;
/// Speed that means: do not control it.
pub const SPEED_FREE: f32 = 16_000.0;
/// Motor mode in which it follows its command.
pub const MOTOR_SERVO: u8 = 0x0A;

/// Counts of position stiffness per Nm/rad.
const STIFFNESS_COUNTS: f32 = 32.0;
/// Counts of damping per Nm s/rad.
const DAMPING_COUNTS: f32 = 16.0;

/// What one motor is asked: torque = tau + Kp (q - angle) + Kd (dq - speed).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorCmd {
    /// [`MOTOR_SERVO`], or 0 to damp.
    pub mode: u8,
    /// Joint angle, rad; [`ANGLE_FREE`] to leave it.
    pub angle: f32,
    /// Joint speed, rad/s; [`SPEED_FREE`] to leave it.
    pub speed: f32,
    /// Torque, Nm.
    pub torque: f32,
    /// Stiffness Kp, Nm/rad.
    pub stiffness: f32,
    /// Damping Kd, Nm s/rad.
    pub damping: f32,
    /// Reserved.
    pub reserve: [u8; 12],
}

impl MotorCmd {
    /// Powered, and asked nothing.
    pub const IDLE: Self = Self {
        mode: MOTOR_SERVO,
        angle: ANGLE_FREE,
        speed: SPEED_FREE,
        torque: 0.0,
        stiffness: 0.0,
        damping: 0.0,
        reserve: [0; 12],
    };

    /// All zeros.
    const BLANK: Self = Self {
        mode: 0,
        angle: 0.0,
        speed: 0.0,
        ..Self::IDLE
    };

    fn lay_out(&mut self, layout: &Layout, io: &mut impl Fields) {
        io.u8(&mut self.mode);
        io.f32(&mut self.angle);
        io.f32(&mut self.speed);
        io.i16_scaled(&mut self.torque, layout.torque_counts_per_nm);
        io.u16_scaled(&mut self.stiffness, STIFFNESS_COUNTS);
        io.u16_scaled(&mut self.damping, DAMPING_COUNTS);
        io.bytes(&mut self.reserve);
    }
}

/// Values that do not fit in their counts and were held at the end of the range. One bit a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MotorSaturation {
    /// Torques.
    pub torque: u32,
    /// Stiffnesses.
    pub stiffness: u32,
    /// Dampings.
    pub damping: u32,
}

impl MotorSaturation {
    /// Whether anything was held.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}

/// Motor by motor.
#[derive(Debug, Clone, PartialEq)]
pub struct LowCmd {
    /// Header.
    pub header: Header,
    /// Motors, as in [`super::BodyReading::motors`].
    pub motors: [MotorCmd; MOTORS],
    /// Battery.
    pub battery: BatteryCommand,
    /// A remote control's state, as if from it.
    pub remote: [u8; REMOTE_LEN],
    /// Reserved.
    pub reserve: u32,
}

impl Default for LowCmd {
    /// Every motor powered and asked nothing.
    fn default() -> Self {
        Self {
            header: Header::of_level(LEVEL_LOW),
            motors: [MotorCmd::IDLE; MOTORS],
            battery: BatteryCommand::default(),
            remote: [0; REMOTE_LEN],
            reserve: 0,
        }
    }
}

impl LowCmd {
    /// The frame's contents, and which form of check value it carries.
    ///
    /// # Errors
    /// The bytes are not a whole LowCmd for this robot.
    pub fn decode(layout: &Layout, bytes: &[u8]) -> Result<(Self, CheckForm), FrameError> {
        let (mut reader, form) = opened(layout, FrameKind::LowCmd, bytes)?;
        let mut command = Self {
            motors: [MotorCmd::BLANK; MOTORS],
            ..Self::default()
        };
        command.lay_out(layout, &mut reader);
        Ok((command, form))
    }

    /// The frame for this robot. What does not fit in its counts is held at the end of the range,
    /// and said; the maker's library lets it wrap, which turns a strong push into a strong pull.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn encode(
        &self,
        layout: &Layout,
        form: CheckForm,
    ) -> Result<(Frame, MotorSaturation), FieldError> {
        let saturation = self.saturation(layout)?;
        let mut writer = Writer::new();
        Header::write_head(&mut writer);
        self.clone().lay_out(layout, &mut writer);
        Ok((writer.sealed(form), saturation))
    }

    fn saturation(&self, layout: &Layout) -> Result<MotorSaturation, FieldError> {
        let mut saturation = MotorSaturation::default();
        for (index, motor) in self.motors.iter().enumerate() {
            for (field, got) in [
                ("motor angle", motor.angle),
                ("motor speed", motor.speed),
                ("motor torque", motor.torque),
                ("motor stiffness", motor.stiffness),
                ("motor damping", motor.damping),
            ] {
                if !got.is_finite() {
                    return Err(FieldError::NotFinite { field, index, got });
                }
            }
            let bit = 1 << index;
            let counts = motor.torque * layout.torque_counts_per_nm;
            // Whatever is cut towards zero into the range fits.
            if !(counts > -32_769.0 && counts < 32_768.0) {
                saturation.torque |= bit;
            }
            let unsigned = |counts: f32| counts > -1.0 && counts < 65_536.0;
            if !unsigned(motor.stiffness * STIFFNESS_COUNTS) {
                saturation.stiffness |= bit;
            }
            if !unsigned(motor.damping * DAMPING_COUNTS) {
                saturation.damping |= bit;
            }
        }
        Ok(saturation)
    }

    fn lay_out(&mut self, layout: &Layout, io: &mut impl Fields) {
        self.header.lay_out(io);
        for motor in &mut self.motors {
            motor.lay_out(layout, io);
        }
        self.battery.lay_out(io);
        io.bytes(&mut self.remote);
        io.u32(&mut self.reserve);
    }
}
