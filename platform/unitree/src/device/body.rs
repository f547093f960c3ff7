//! A body without physics: it goes where it is told and stands on its feet.
//!
//! In: HighCmds. Out: HighStates whose joints, feet and inertial reading fit a body that stands,
//! glides at the velocity it is told, gets up and lies down. For walking legs that lift, load and
//! slip see the simulated world; this is what a client needs to be tried against.

use hachi_hal::{BodyVelocity, Leg, LegKinematics, Vector3};
use libm::{cos, sin};

use super::simulated::RobotBody;
use crate::command::{GaitKind, Mode};
use crate::frame::{HighCmd, HighState, Model};
use crate::robot::Quadruped;

/// Getting up and lying down take this long, s.
const RISING_S: f64 = 1.5;
/// Height of a lying body over the ground, as a share of a standing one.
const LYING_SHARE: f64 = 0.4;

/// A gliding body.
#[derive(Debug, Clone)]
pub struct KinematicBody {
    robot: Quadruped,
    standing_m: f64,
    mode: Mode,
    /// 0 lying, 1 standing.
    risen: f64,
    place: [f64; 2],
    heading: f64,
    velocity: BodyVelocity,
    steps: u32,
}

impl KinematicBody {
    /// A lying robot that stands `standing_m` high when it stands.
    pub fn lying(robot: &Quadruped, standing_m: f64) -> Self {
        Self {
            robot: *robot,
            standing_m,
            mode: Mode::LieDown,
            risen: 0.0,
            place: [0.0; 2],
            heading: 0.0,
            velocity: BodyVelocity::ZERO,
            steps: 0,
        }
    }

    /// A robot that stands by itself.
    pub fn standing(robot: &Quadruped, standing_m: f64) -> Self {
        Self {
            mode: Mode::Idle,
            risen: 1.0,
            ..Self::lying(robot, standing_m)
        }
    }

    /// Where it is: x, y, heading, from where it began.
    pub fn pose(&self) -> [f64; 3] {
        [self.place[0], self.place[1], self.heading]
    }

    /// How it moves.
    pub fn velocity(&self) -> BodyVelocity {
        self.velocity
    }

    /// What it does.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    fn model(&self) -> Model {
        self.robot.layout.model
    }

    /// Takes the mode if it can be had from here, as far as is known of the robots.
    fn take_mode(&mut self, asked: Mode) {
        let stands = self.risen >= 1.0;
        self.mode = match asked {
            Mode::Walk | Mode::Stand if !stands => self.mode,
            Mode::Damp if self.risen > 0.0 => self.mode,
            Mode::Idle => self.mode,
            mode => mode,
        };
    }

    /// Height of the base over the ground, m.
    pub fn height_m(&self) -> f64 {
        self.standing_m * (LYING_SHARE + (1.0 - LYING_SHARE) * self.risen)
    }
}

impl RobotBody for KinematicBody {
    fn step(&mut self, command: &HighCmd, dt_s: f64) {
        self.take_mode(Mode::of_byte(self.model(), command.mode));
        let rise = match self.mode {
            Mode::StandUp | Mode::Stand | Mode::Walk | Mode::Idle | Mode::Recover => dt_s,
            _ => -dt_s,
        };
        let was_lying = self.risen <= 0.0;
        // One that lies and is told nothing goes on lying.
        if !(was_lying && self.mode == Mode::Idle) {
            self.risen = (self.risen + rise / RISING_S).clamp(0.0, 1.0);
        }
        // A robot that is asked more than it can does what it can.
        let trot = self.robot.limits.of_gait(GaitKind::Trot);
        let asked = BodyVelocity {
            forward: f64::from(command.velocity[0]),
            left: f64::from(command.velocity[1]),
            yaw_rate: f64::from(command.yaw_speed),
        };
        self.velocity = match (self.mode, trot) {
            (Mode::Walk, Some(limits)) => limits.velocity(&asked).0,
            _ => BodyVelocity::ZERO,
        };
        let v = &self.velocity;
        let (s, c) = (sin(self.heading), cos(self.heading));
        self.place[0] += (v.forward * c - v.left * s) * dt_s;
        self.place[1] += (v.forward * s + v.left * c) * dt_s;
        self.heading += v.yaw_rate * dt_s;
        self.steps = self.steps.wrapping_add(1);
    }

    fn fill(&self, state: &mut HighState) {
        const GRAVITY: f32 = 9.80665;
        let (body, geometry) = (&mut state.body, &self.robot.geometry);
        let half = self.heading / 2.0;
        body.imu.quaternion = [cos(half) as f32, 0.0, 0.0, sin(half) as f32];
        body.imu.rpy = [0.0, 0.0, self.heading as f32];
        // The last digit of a real sensor is never still.
        let flicker = 1e-3 * (self.steps % 7) as f32;
        body.imu.gyroscope = [flicker, 0.0, self.velocity.yaw_rate as f32];
        body.imu.accelerometer = [0.0, flicker, GRAVITY];
        let share = self.robot.mass_kg * f64::from(GRAVITY) / 4.0 * self.risen;
        for leg in Leg::ALL {
            let i = leg.index();
            let hip = geometry.hip(leg);
            let down = self.height_m() - geometry.foot_radius;
            let foot = hip + Vector3::new(0.0, leg.side() * geometry.abduction, -down);
            let angles = geometry.joints_for(leg, &foot).angles;
            let push = Vector3::new(0.0, 0.0, share);
            let torques = -(geometry.jacobian(leg, &angles).transpose() * push);
            for joint in 0..3 {
                let motor = &mut body.motors[3 * i + joint];
                motor.mode = crate::frame::MOTOR_SERVO;
                motor.angle = angles[joint] as f32;
                motor.torque = torques[joint] as f32;
            }
            // The conversion saturates.
            body.foot_force[i] = (100.0 + share) as i16;
            state.foot_positions[i] = [foot.x, foot.y, foot.z].map(|v| v as f32);
        }
        body.battery.charge_percent = 80;
        body.battery.cells_mv.fill(4_000);
        state.mode = self.mode.byte(self.model());
        state.position = [
            self.place[0] as f32,
            self.place[1] as f32,
            self.height_m() as f32,
        ];
        state.body_height = self.height_m() as f32;
        state.velocity = [self.velocity.forward as f32, self.velocity.left as f32, 0.0];
        state.yaw_speed = self.velocity.yaw_rate as f32;
    }
}
