//! The other side of the wire: a simulated robot that walks as it is told, with a LiDAR on its back.
//!
//! In: HighCmds. Out: HighStates and the LiDAR's packets, as the real ones send them, over sockets
//! (`hachi simulate`) or inside the program (`hachi demo`); the truth beside them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hachi_hal::{PacketSource, Pose, Received, Stamp, Vector3};
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_runtime::{Progress, VirtualClock, Work};
use hachi_unitree::device::{KinematicBody, MemoryLink, RobotBody, SimulatedService};
use hachi_unitree::frame::{HighCmd, HighState, MOTOR_SERVO, Model};
use hachi_world::legs::{Footfall, ForceSensors, LegSensorConfig, SlipConfig};
use hachi_world::motion::BodyMotion;
use hachi_world::{
    CommandedBody, LegDimensions, LegsConfig, LiveLidar, PersonTruth, SimulatedCamera,
    SimulatedLidarError, SimulationConfig, Trajectory,
};

use super::settings::Platform;

/// A robot that walks as it is told.
#[derive(Debug, Clone)]
pub struct WalkingBody {
    /// Modes, standing up and lying down, limits.
    modes: KinematicBody,
    walker: CommandedBody,
    now: Stamp,
}

/// Weights of thigh and calf, kg (the robot descriptions), and height of the base when it walks, m.
const fn walking_numbers(model: Model) -> (f64, f64, f64) {
    match model {
        Model::Go1 => (0.92, 0.196, 0.28),
        _ => (4.3, 1.10, 0.50),
    }
}

impl WalkingBody {
    /// A robot that stands where the world's patrol begins.
    pub fn standing(platform: &Platform, world: &SimulationConfig) -> Self {
        let robot = platform.robot;
        let (g, model) = (&robot.geometry, robot.layout.model);
        let (thigh_kg, calf_kg, height_m) = walking_numbers(model);
        let mut sensors = LegSensorConfig::default();
        if model != Model::Go1 {
            // Users report a constant 20 to 28 whatever the load.
            sensors.forces = ForceSensors::Constant(24.0);
        }
        let legs = LegsConfig {
            dimensions: LegDimensions {
                hip_forward: g.hip_forward,
                hip_sideways: g.hip_sideways,
                abduction: g.abduction,
                thigh: g.thigh,
                calf: g.calf,
                foot_radius: g.foot_radius,
                mass_kg: robot.mass_kg,
                thigh_kg,
                calf_kg,
            },
            footfall: Footfall::trot(),
            floor: world.scene.floor().clone(),
            imu_in_base: Vector3::from(robot.imu_in_base),
            sensors,
            slips: SlipConfig::NONE,
            seed: world.seed,
        };
        let start = start_of(&world.trajectory);
        let motion = BodyMotion::trot();
        Self {
            modes: KinematicBody::standing(robot, height_m),
            walker: CommandedBody::standing(legs, motion, height_m, start, world.start),
            now: world.start,
        }
    }

    /// The body in the world.
    pub fn walker(&self) -> &CommandedBody {
        &self.walker
    }
}

impl RobotBody for WalkingBody {
    fn step(&mut self, command: &HighCmd, dt_s: f64) {
        self.modes.step(command, dt_s);
        self.now = self.now + (dt_s * 1e9).round() as i64;
        let asked = self.modes.velocity();
        self.walker.advance(self.now, &asked, self.modes.height_m());
    }

    fn fill(&self, state: &mut HighState) {
        self.modes.fill(state);
        let tick = self.walker.tick();
        let single = |v: &Vector3| [v.x as f32, v.y as f32, v.z as f32];
        let imu = &mut state.body.imu;
        let attitude = tick.attitude.level_from_base;
        let q = attitude.quaternion();
        imu.quaternion = [q.w, q.i, q.j, q.k].map(|v| v as f32);
        let (roll, pitch, yaw) = attitude.euler_angles();
        imu.rpy = [roll, pitch, yaw].map(|v| v as f32);
        imu.gyroscope = single(&tick.imu.angular_velocity);
        imu.accelerometer = single(&tick.imu.specific_force);
        for leg in 0..4 {
            for joint in 0..3 {
                let motor = &mut state.body.motors[3 * leg + joint];
                motor.mode = MOTOR_SERVO;
                motor.angle = tick.legs.angles[leg][joint] as f32;
                motor.speed = tick.legs.speeds[leg][joint] as f32;
                motor.torque = tick.legs.torques[leg][joint] as f32;
            }
        }
        // The conversion saturates.
        state.body.foot_force = tick.legs.foot_forces.map(|force| force as i16);
        let v = self.walker.velocity();
        state.velocity = [v.forward as f32, v.left as f32, 0.0];
        state.yaw_speed = v.yaw_rate as f32;
    }
}

/// Where a patrol begins: position and heading.
fn start_of(trajectory: &Trajectory) -> ([f64; 2], f64) {
    let start = trajectory.map_from_base(0.0);
    let ahead = start.rotation * Vector3::x();
    let at = start.translation.vector;
    ([at.x, at.y], ahead.y.atan2(ahead.x))
}

/// The places of a patrol, as seen from where it begins. Not its rounded corners: a body is longer
/// than a point, and goes in to a room straight.
pub fn route(trajectory: &Trajectory) -> Vec<[f64; 2]> {
    let ([x, y], heading) = start_of(trajectory);
    let (sin, cos) = heading.sin_cos();
    let seen = |place: &[f64; 2]| {
        let off = [place[0] - x, place[1] - y];
        [off[0] * cos + off[1] * sin, off[1] * cos - off[0] * sin]
    };
    trajectory.places().iter().map(seen).collect()
}

/// A packet on its way: when it was received, the port, the payload.
type Packet = (Stamp, u16, Vec<u8>);

/// Packets inside the program. Clones are the same wire.
#[derive(Debug, Clone, Default)]
pub struct MemoryPackets(Arc<Mutex<VecDeque<Packet>>>);

impl MemoryPackets {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Packet>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PacketSource for MemoryPackets {
    type Error = SimulatedLidarError;

    fn receive(
        &mut self,
        buffer: &mut [u8],
        _: Stamp,
    ) -> Result<Option<Received>, SimulatedLidarError> {
        let Some((stamp, port, bytes)) = self.lock().pop_front() else {
            return Ok(None);
        };
        let (needed, got) = (bytes.len(), buffer.len());
        let room = buffer
            .get_mut(..needed)
            .ok_or(SimulatedLidarError::BufferTooSmall { needed, got })?;
        room.copy_from_slice(&bytes);
        Ok(Some(Received {
            len: needed,
            stamp,
            port,
        }))
    }

    fn at_end(&self) -> bool {
        false
    }
}

/// Where the base truly was, every 10 ms.
#[derive(Debug, Clone, Default)]
pub struct Truth(Arc<Mutex<Vec<(Stamp, Pose)>>>);

/// From one true pose that is kept to the next, ns: between two, a trotting body is off the
/// straight line by 0.03 mm.
const TRUTH_NS: i64 = 10_000_000;

impl Truth {
    /// Where the base was at a moment, as far as it is known.
    pub fn map_from_base(&self, at: Stamp) -> Option<Pose> {
        let poses = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let next = poses.partition_point(|(stamp, _)| *stamp <= at);
        let (before, after) = (poses.get(next.checked_sub(1)?)?, poses.get(next)?);
        let share = at.secs_since(before.0) / after.0.secs_since(before.0);
        before.1.try_lerp_slerp(&after.1, share, 1e-9)
    }

    fn keep(&self, stamp: Stamp, pose: Pose) {
        let mut poses = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let due = |(last, _): &(Stamp, Pose)| stamp.nanos_since(*last) >= TRUTH_NS;
        if poses.last().is_none_or(due) {
            poses.push((stamp, pose));
        }
    }
}

/// The simulated robot as a task of the same table: inside the program, on the same clock.
pub struct SimulatorTask {
    /// The robot.
    pub robot: SimulatedService<WalkingBody>,
    /// Frames from and to the host.
    pub link: MemoryLink<VirtualClock>,
    /// The LiDAR on its back.
    pub lidar: LiveLidar,
    /// Its packets.
    pub packets: MemoryPackets,
    /// The truth.
    pub truth: Truth,
    /// The camera at its front, where there is one.
    pub eye: Option<SimulatedEye>,
}

/// The camera at the robot's front, on a cable inside the program.
pub struct SimulatedEye {
    /// What it sees.
    pub camera: SimulatedCamera,
    /// The other end of its cable.
    pub port: SimulatedPort,
    /// Who it truly saw.
    pub seen: SeenPeople,
}

/// A picture's time, and who is in it.
type Seen = (Stamp, Vec<PersonTruth>);

/// Who the camera truly saw in its last pictures.
#[derive(Debug, Clone, Default)]
pub struct SeenPeople(Arc<Mutex<VecDeque<Seen>>>);

/// So many are kept: more than wait between camera and tracking.
const SEEN_KEPT: usize = 16;

impl SeenPeople {
    /// Who was seen in the picture that was taken at about this time: the driver knows it to a few
    /// milliseconds.
    pub fn at(&self, stamp: Stamp) -> Option<Vec<PersonTruth>> {
        let seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let off = |(at, _): &&Seen| at.nanos_since(stamp).abs();
        seen.iter()
            .min_by_key(off)
            .map(|(_, people)| people.clone())
    }

    fn keep(&self, stamp: Stamp, people: &[PersonTruth]) {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.len() >= SEEN_KEPT {
            seen.pop_front();
        }
        seen.push_back((stamp, people.to_vec()));
    }
}

/// From an exposure's middle to the computer, ns.
const PICTURE_WAY_NS: i64 = 8_000_000;

impl SimulatedEye {
    /// Takes the pictures that have arrived by `now`; where the base was is known until then.
    fn advance(&mut self, now: Stamp, map_from_base: impl Fn(Stamp) -> Pose) {
        let due = |camera: &SimulatedCamera| {
            let exposed = camera.next_stamp()?;
            (exposed + PICTURE_WAY_NS <= now).then_some(exposed)
        };
        while let Some(exposed) = due(&self.camera) {
            // Nobody looks at the depth yet: every pixel says that nothing was measured.
            let Some(frame) = self.camera.next_color_frame_from(&map_from_base(exposed)) else {
                return;
            };
            self.seen.keep(exposed, &frame.people);
            let received = exposed + PICTURE_WAY_NS;
            self.port
                .expose(exposed, received, &frame.depth, &frame.color);
        }
    }
}

impl Work for SimulatorTask {
    fn run(&mut self, now: Stamp) -> Progress {
        while let Some(frame) = self.link.heard() {
            self.robot.hear(&frame, now);
        }
        if let Some(state) = self.robot.step(now) {
            self.link.answer(state.as_bytes());
        }
        let walker = self.robot.body().walker();
        self.truth.keep(now, walker.map_from_base(now));
        let packets = &self.packets;
        // A packet's last firing is 50 us before it is received, and the body is known until now.
        self.lidar.advance(
            now,
            |stamp| walker.map_from_base(stamp),
            |stamp, port, bytes| packets.lock().push_back((stamp, port, bytes.to_vec())),
        );
        if let Some(eye) = &mut self.eye {
            eye.advance(now, |stamp| walker.map_from_base(stamp));
        }
        Progress::Done
    }
}
