//! What the robot sends: HighState and LowState, in both directions.

use super::check::CheckForm;
use super::error::FrameError;
use super::layout::{FrameKind, Layout};
use super::parts::{BodyReading, Header, LEVEL_HIGH, LEVEL_LOW};
use super::remote::REMOTE_LEN;
use super::wire::{Fields, Frame, Writer, opened};

/// All that a robot reports at high level.
#[derive(Debug, Clone, PartialEq)]
pub struct HighState {
    /// Header.
    pub header: Header,
    /// Inertial sensor, motors, battery, feet.
    pub body: BodyReading,
    /// What it does: [`crate::command::Mode`].
    pub mode: u8,
    /// How far a dance or jump has got.
    pub progress: f32,
    /// [`crate::command::GaitKind`].
    pub gait: u8,
    /// How high feet are lifted, m.
    pub foot_raise_height: f32,
    /// Where it believes to be, m.
    pub position: [f32; 3],
    /// Height of the body, m.
    pub body_height: f32,
    /// How fast it believes to be: forward, left, and a third value, m/s.
    pub velocity: [f32; 3],
    /// How fast it believes to turn, rad/s.
    pub yaw_speed: f32,
    /// Ultrasound, m.
    pub range_obstacle: [f32; 4],
    /// Feet in the body frame, m.
    pub foot_positions: [[f32; 3]; 4],
    /// Their speeds, m/s.
    pub foot_speeds: [[f32; 3]; 4],
    /// The remote control, see [`super::Remote`].
    pub remote: [u8; REMOTE_LEN],
    /// Reserved.
    pub reserve: u32,
}

/// All that a robot reports at low level.
#[derive(Debug, Clone, PartialEq)]
pub struct LowState {
    /// Header.
    pub header: Header,
    /// Inertial sensor, motors, battery, feet.
    pub body: BodyReading,
    /// Milliseconds since the robot's controller started; wraps after 49.7 days.
    pub tick_ms: u32,
    /// The remote control, see [`super::Remote`].
    pub remote: [u8; REMOTE_LEN],
    /// Reserved.
    pub reserve: u32,
}

impl HighState {
    /// All zeros but the level flag.
    pub fn of(layout: &Layout) -> Self {
        Self {
            header: Header::of_level(LEVEL_HIGH),
            body: BodyReading::of(layout),
            mode: 0,
            progress: 0.0,
            gait: 0,
            foot_raise_height: 0.0,
            position: [0.0; 3],
            body_height: 0.0,
            velocity: [0.0; 3],
            yaw_speed: 0.0,
            range_obstacle: [0.0; 4],
            foot_positions: [[0.0; 3]; 4],
            foot_speeds: [[0.0; 3]; 4],
            remote: [0; REMOTE_LEN],
            reserve: 0,
        }
    }

    /// The frame's contents, and which form of check value it carries.
    ///
    /// # Errors
    /// The bytes are not a whole HighState of this robot.
    pub fn decode(layout: &Layout, bytes: &[u8]) -> Result<(Self, CheckForm), FrameError> {
        let (mut reader, form) = opened(layout, FrameKind::HighState, bytes)?;
        let mut state = Self::of(layout);
        state.lay_out(&mut reader);
        Ok((state, form))
    }

    /// The frame as the robot sends it. Values are not checked: a simulated robot may be ill.
    pub fn encode(&self, form: CheckForm) -> Frame {
        let mut writer = Writer::new();
        Header::write_head(&mut writer);
        self.clone().lay_out(&mut writer);
        writer.sealed(form)
    }

    fn lay_out(&mut self, io: &mut impl Fields) {
        self.header.lay_out(io);
        self.body.imu.lay_out(io);
        for motor in &mut self.body.motors {
            motor.lay_out_high(io);
        }
        self.body.battery.lay_out_high(io);
        self.body.lay_out_feet(io);
        io.u8(&mut self.mode);
        io.f32(&mut self.progress);
        io.u8(&mut self.gait);
        io.f32(&mut self.foot_raise_height);
        io.f32s(&mut self.position);
        io.f32(&mut self.body_height);
        io.f32s(&mut self.velocity);
        io.f32(&mut self.yaw_speed);
        io.f32s(&mut self.range_obstacle);
        io.f32s(self.foot_positions.as_flattened_mut());
        io.f32s(self.foot_speeds.as_flattened_mut());
        io.bytes(&mut self.remote);
        io.u32(&mut self.reserve);
    }
}

impl LowState {
    /// All zeros but the level flag.
    pub fn of(layout: &Layout) -> Self {
        Self {
            header: Header::of_level(LEVEL_LOW),
            body: BodyReading::of(layout),
            tick_ms: 0,
            remote: [0; REMOTE_LEN],
            reserve: 0,
        }
    }

    /// The frame's contents.
    ///
    /// # Errors
    /// The bytes are not a whole LowState of this robot.
    pub fn decode(layout: &Layout, bytes: &[u8]) -> Result<Self, FrameError> {
        let (mut reader, _) = opened(layout, FrameKind::LowState, bytes)?;
        let mut state = Self::of(layout);
        state.lay_out(layout, &mut reader);
        Ok(state)
    }

    /// The frame as the robot sends it. Values are not checked.
    pub fn encode(&self, layout: &Layout) -> Frame {
        let mut writer = Writer::new();
        Header::write_head(&mut writer);
        self.clone().lay_out(layout, &mut writer);
        writer.sealed(CheckForm::Plain)
    }

    fn lay_out(&mut self, layout: &Layout, io: &mut impl Fields) {
        self.header.lay_out(io);
        self.body.imu.lay_out(io);
        for motor in &mut self.body.motors {
            motor.lay_out_low(io, layout.torque_counts_per_nm);
        }
        self.body.battery.lay_out_low(io);
        self.body.lay_out_feet(io);
        io.u32(&mut self.tick_ms);
        io.bytes(&mut self.remote);
        io.u32(&mut self.reserve);
    }
}
