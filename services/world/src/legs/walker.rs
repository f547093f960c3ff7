//! Legs under a moving body: read [`WalkingLegs::step`] first.

use hachi_hal::{
    AttitudeSample, ImuSample, Leg, LegState, Matrix3, Pose, Rotation, Stamp, Vector3,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::chain::{Chain, LegDimensions, reach};
use super::gait::{Footfall, Slip, SlipConfig, Swing, load_share};
use super::sensors::{LegSensorConfig, Sensors, Truth};
use crate::floor::Floor;
use crate::imu::GRAVITY;
use crate::noise::{Purpose, generator};
use crate::trajectory::Twist;

/// Everything that decides what the legs do.
#[derive(Debug, Clone, PartialEq)]
pub struct LegsConfig {
    /// Lengths and weights.
    pub dimensions: LegDimensions,
    /// Gait.
    pub footfall: Footfall,
    /// What they walk on.
    pub floor: Floor,
    /// Where the inertial sensor sits on the base; it is not turned.
    pub imu_in_base: Vector3,
    /// How sensors err.
    pub sensors: LegSensorConfig,
    /// How feet slip.
    pub slips: SlipConfig,
    /// Of all noise.
    pub seed: u64,
}

/// What is true at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegTruth {
    /// Which feet stand on the ground.
    pub standing: [bool; 4],
    /// The ground's push on each foot along the vertical, N.
    pub loads: [f64; 4],
    /// Centres of the feet, map frame.
    pub feet_in_map: [Vector3; 4],
    /// How fast each foot slips over the ground, m/s; zero where it rolls or swings.
    pub slip_speeds: [f64; 4],
    /// Joint angles, rad.
    pub angles: [Vector3; 4],
    /// Joint speeds, rad/s.
    pub speeds: [Vector3; 4],
    /// Whether every leg reaches where it should be.
    pub reached: bool,
}

/// What the robot's own sensors report at one moment, and the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegTick {
    /// Joints and feet.
    pub legs: LegState,
    /// Inertial sensor, axes of the base.
    pub imu: ImuSample,
    /// The robot's estimate of its attitude.
    pub attitude: AttitudeSample,
    /// The truth.
    pub truth: LegTruth,
}

#[derive(Debug, Clone, Copy)]
enum Foot {
    Stands {
        centre: Vector3,
        since_s: f64,
        slip: Option<Slip>,
    },
    Swings(Swing),
}

/// Four legs that walk under a body.
#[derive(Debug, Clone)]
pub struct WalkingLegs {
    config: LegsConfig,
    sensors: Sensors,
    random: ChaCha8Rng,
    feet: [Foot; 4],
    angles: [Vector3; 4],
    time_s: f64,
    last_link_velocities: Option<[[Vector3; 2]; 4]>,
    last_angular_velocity: Vector3,
}

/// A body slower than this, m/s or rad/s, lets its feet stand.
const STANDS_BELOW: f64 = 0.02;
/// But a foot farther than this from its place steps, metres.
const OUT_OF_PLACE_M: f64 = 0.02;

impl WalkingLegs {
    /// Legs that stand under a body at `map_from_base`.
    pub fn new(config: LegsConfig, map_from_base: &Pose) -> Self {
        let mut legs = Self {
            sensors: Sensors::new(config.sensors, config.seed),
            random: generator(config.seed, Purpose::Legs, 1),
            feet: [Foot::Stands {
                centre: Vector3::zeros(),
                since_s: f64::NEG_INFINITY,
                slip: None,
            }; 4],
            angles: [Vector3::new(0.0, 0.8, -1.5); 4],
            time_s: 0.0,
            last_link_velocities: None,
            last_angular_velocity: Vector3::zeros(),
            config,
        };
        for leg in Leg::ALL {
            let centre = legs.place(leg, map_from_base, &Vector3::zeros());
            legs.feet[leg.index()] = Foot::Stands {
                centre,
                since_s: f64::NEG_INFINITY,
                slip: None,
            };
        }
        legs
    }

    /// The next moment, `dt_s` after the last (the first: 0), with the body where it is then.
    ///
    /// Steps of 1 to 5 ms; longer ones make feet roll visibly in pieces.
    pub fn step(&mut self, stamp: Stamp, dt_s: f64, body: &Pose, twist: &Twist) -> LegTick {
        self.time_s += dt_s;
        for leg in Leg::ALL {
            self.lift_or_land(leg, body, twist);
        }
        let mut truth = LegTruth {
            standing: [false; 4],
            loads: self.loads(twist),
            feet_in_map: [Vector3::zeros(); 4],
            slip_speeds: [0.0; 4],
            angles: self.angles,
            speeds: [Vector3::zeros(); 4],
            reached: true,
        };
        for leg in Leg::ALL {
            self.move_leg(leg, dt_s, body, twist, &mut truth);
        }
        let torques = self.torques(dt_s, body, twist, &truth);
        let (legs, imu, attitude) = self.sensors.measure(
            &Truth {
                stamp,
                angles: truth.angles,
                speeds: truth.speeds,
                torques,
                loads: truth.loads,
                attitude: body.rotation,
                angular_velocity: twist.angular_velocity_in_base,
                specific_force: self.specific_force(dt_s, body, twist),
            },
            dt_s,
        );
        self.last_angular_velocity = twist.angular_velocity_in_base;
        LegTick {
            legs,
            imu,
            attitude,
            truth,
        }
    }

    /// Where a foot's centre belongs on the floor when the body is at `body`, shifted by `ahead`.
    fn place(&self, leg: Leg, body: &Pose, ahead: &Vector3) -> Vector3 {
        let d = &self.config.dimensions;
        let at = body.translation.vector;
        let normal = self.normal(at.x, at.y);
        let above = (at.z - self.config.floor.height(at.x, at.y)) * normal.z;
        let under = at - normal * above;
        let (_, _, heading) = body.rotation.euler_angles();
        let hip = Vector3::new(
            leg.end() * d.hip_forward,
            leg.side() * (d.hip_sideways + d.abduction),
            0.0,
        );
        let level = under + Rotation::from_axis_angle(&Vector3::z_axis(), heading) * hip + ahead;
        self.on_floor(level.x, level.y)
    }

    /// The centre of a foot that stands at a place.
    fn on_floor(&self, x: f64, y: f64) -> Vector3 {
        let sole = Vector3::new(x, y, self.config.floor.height(x, y));
        sole + self.normal(x, y) * self.config.dimensions.foot_radius
    }

    fn normal(&self, x: f64, y: f64) -> Vector3 {
        const STEP: f64 = 1e-4;
        let height = |x: f64, y: f64| self.config.floor.height(x, y);
        let along_x = (height(x + STEP, y) - height(x - STEP, y)) / (2.0 * STEP);
        let along_y = (height(x, y + STEP) - height(x, y - STEP)) / (2.0 * STEP);
        Vector3::new(-along_x, -along_y, 1.0).normalize()
    }

    fn lift_or_land(&mut self, leg: Leg, body: &Pose, twist: &Twist) {
        let i = leg.index();
        let footfall = self.config.footfall;
        match self.feet[i] {
            Foot::Swings(swing) if self.time_s >= swing.ends_s => {
                let slip = self.draw_slip();
                self.feet[i] = Foot::Stands {
                    centre: swing.to,
                    since_s: self.time_s,
                    slip,
                };
            }
            Foot::Stands { centre, .. } => {
                let phase = footfall.phase(i, self.time_s);
                let swing_s = (1.0 - phase) * footfall.period_s;
                let whole_s = (1.0 - footfall.duty) * footfall.period_s;
                // Lifts only where almost the whole swing is left.
                let due = phase >= footfall.duty && swing_s > 0.8 * whole_s;
                if due && self.must_step(leg, &centre, body, twist) {
                    let to = self.foothold(leg, body, twist, swing_s);
                    self.feet[i] = Foot::Swings(Swing {
                        from: centre,
                        to,
                        begins_s: self.time_s,
                        ends_s: self.time_s + swing_s,
                        lift_m: footfall.lift_m,
                    });
                }
            }
            Foot::Swings(_) => {}
        }
    }

    fn must_step(&self, leg: Leg, centre: &Vector3, body: &Pose, twist: &Twist) -> bool {
        let off = self.place(leg, body, &Vector3::zeros()) - centre;
        moves(twist) || off.xy().norm() > OUT_OF_PLACE_M
    }

    /// Half a stance ahead of where the hip will be when the foot lands.
    fn foothold(&self, leg: Leg, body: &Pose, twist: &Twist, swing_s: f64) -> Vector3 {
        let ahead_s = swing_s + self.config.footfall.duty * self.config.footfall.period_s / 2.0;
        let up = body.rotation.inverse_transform_vector(&Vector3::z());
        let yaw_rate = twist.angular_velocity_in_base.dot(&up);
        let mut then = *body;
        then.rotation =
            Rotation::from_axis_angle(&Vector3::z_axis(), yaw_rate * ahead_s) * body.rotation;
        let v = twist.velocity_in_map;
        self.place(leg, &then, &Vector3::new(v.x * ahead_s, v.y * ahead_s, 0.0))
    }

    /// A slip in the middle of the step that begins now, or none.
    fn draw_slip(&mut self) -> Option<Slip> {
        let slips = self.config.slips;
        let [happens, when, speed, lasts, direction] = [0; 5].map(|_| self.random.random::<f64>());
        if happens >= slips.share {
            return None;
        }
        let within = |[least, most]: [f64; 2], share: f64| least + (most - least) * share;
        let stance_s = self.config.footfall.duty * self.config.footfall.period_s;
        let lasts_s = within(slips.lasts_s, lasts).min(0.6 * stance_s);
        let from_s = self.time_s + 0.2 * stance_s + when * (0.6 * stance_s - lasts_s);
        let (sin, cos) = (std::f64::consts::TAU * direction).sin_cos();
        Some(Slip {
            from_s,
            to_s: from_s + lasts_s,
            velocity: Vector3::new(cos, sin, 0.0) * within(slips.speed, speed),
        })
    }

    /// The ground's push on each foot: the feet that stand share what holds the body.
    fn loads(&self, twist: &Twist) -> [f64; 4] {
        let footfall = &self.config.footfall;
        let stance_s = footfall.duty * footfall.period_s;
        let shares: [f64; 4] = std::array::from_fn(|i| match &self.feet[i] {
            Foot::Swings(_) => 0.0,
            Foot::Stands { since_s, .. } => {
                let left = (footfall.duty - footfall.phase(i, self.time_s)) * footfall.period_s;
                // A foot that will not lift does not hand on.
                let lifts = left > 0.0 && moves(twist);
                let until_s = if lifts { left } else { f64::INFINITY };
                load_share(self.time_s - since_s, until_s, stance_s)
            }
        });
        let total: f64 = shares.iter().sum();
        let held = self.config.dimensions.mass_kg * (GRAVITY + twist.acceleration_in_map.z);
        if total > 1e-3 {
            shares.map(|share| held.max(0.0) * share / total)
        } else {
            [0.0; 4]
        }
    }

    /// Moves one foot on and finds the joint angles and speeds that fit.
    fn move_leg(&mut self, leg: Leg, dt_s: f64, body: &Pose, twist: &Twist, truth: &mut LegTruth) {
        let i = leg.index();
        let base_from_map = body.rotation.inverse();
        let turning = twist.angular_velocity_in_base;
        let base_velocity = base_from_map * twist.velocity_in_map;
        let radius = self.config.dimensions.foot_radius;
        let dimensions = self.config.dimensions;
        let in_base = |centre: &Vector3| base_from_map * (centre - body.translation.vector);

        let mut place = |centre: &Vector3, angles: &mut Vector3| {
            match reach(&dimensions, leg, &in_base(centre), angles) {
                Some(found) => *angles = found,
                None => truth.reached = false,
            }
            Chain::new(&dimensions, leg, angles)
        };
        // Joint speeds: `jacobian dq = foot's velocity - that of a point of the body there`.
        let carried = |chain: &Chain| base_velocity + turning.cross(&chain.foot);
        let (centre, speeds) = match &self.feet[i] {
            Foot::Swings(swing) => {
                let (centre, velocity) = swing.at(self.time_s);
                let chain = place(&centre, &mut self.angles[i]);
                let relative = base_from_map * velocity - carried(&chain);
                (centre, solved(&chain.jacobian(&chain.foot, 3), &relative))
            }
            Foot::Stands { centre, slip, .. } => {
                let (at, mut centre) = (*centre, *centre);
                let slipping = slip.map_or_else(Vector3::zeros, |s| s.at(self.time_s));
                let chain = place(&centre, &mut self.angles[i]);
                let normal = base_from_map * self.normal(centre.x, centre.y);
                // The foot rolls: its centre moves by the shank's turn times the radius.
                let arm = normal * radius;
                let rolling =
                    chain.jacobian(&chain.foot, 3) + arm.cross_matrix() * chain.calf_axes();
                let relative = base_from_map * slipping - carried(&chain) + turning.cross(&arm);
                let speeds = solved(&rolling, &relative);
                let shank = turning + chain.calf_axes() * speeds;
                centre += (body.rotation * shank.cross(&arm) + slipping) * dt_s;
                let next = self.on_floor_under(&centre);
                truth.standing[i] = true;
                truth.slip_speeds[i] = slipping.norm();
                if let Foot::Stands { centre, .. } = &mut self.feet[i] {
                    *centre = next;
                }
                (at, speeds)
            }
        };
        truth.feet_in_map[i] = centre;
        truth.angles[i] = self.angles[i];
        truth.speeds[i] = speeds;
    }

    /// The place nearest to `centre` at which a foot's centre can be.
    fn on_floor_under(&self, centre: &Vector3) -> Vector3 {
        let normal = self.normal(centre.x, centre.y);
        let radius = self.config.dimensions.foot_radius;
        let sole = centre - normal * radius;
        let floor = Vector3::new(sole.x, sole.y, self.config.floor.height(sole.x, sole.y));
        centre + normal * normal.dot(&(floor - sole))
    }

    /// What the inertial sensor feels where it sits.
    fn specific_force(&self, dt_s: f64, body: &Pose, twist: &Twist) -> Vector3 {
        let up = Vector3::z() * GRAVITY;
        let at_base = body
            .rotation
            .inverse_transform_vector(&(twist.acceleration_in_map + up));
        let (turning, arm) = (twist.angular_velocity_in_base, self.config.imu_in_base);
        let speeding = if dt_s > 0.0 {
            (turning - self.last_angular_velocity) / dt_s
        } else {
            Vector3::zeros()
        };
        at_base + speeding.cross(&arm) + turning.cross(&turning.cross(&arm))
    }

    /// Torques that hold the body up and move the links.
    fn torques(&mut self, dt_s: f64, body: &Pose, twist: &Twist, truth: &LegTruth) -> [Vector3; 4] {
        let d = self.config.dimensions;
        let base_from_map = body.rotation.inverse();
        let turning = twist.angular_velocity_in_base;
        let base_velocity = base_from_map * twist.velocity_in_map;
        let mut velocities = [[Vector3::zeros(); 2]; 4];
        let mut torques = [Vector3::zeros(); 4];
        let ahead = twist.acceleration_in_map / GRAVITY;
        for leg in Leg::ALL {
            let i = leg.index();
            let chain = Chain::new(&d, leg, &truth.angles[i]);
            // The ground pushes up, and along as far as the body speeds up.
            let push = base_from_map * Vector3::new(ahead.x, ahead.y, 1.0) * truth.loads[i];
            torques[i] = -(chain.jacobian(&chain.foot, 3).transpose() * push);
            let centres = chain.centres(&d);
            for (link, (centre, mass)) in centres.iter().zip([d.thigh_kg, d.calf_kg]).enumerate() {
                let jacobian = chain.jacobian(centre, link + 2);
                let velocity = body.rotation
                    * (base_velocity + turning.cross(centre) + jacobian * truth.speeds[i]);
                velocities[i][link] = velocity;
                let last = self.last_link_velocities.map(|all| all[i][link]);
                let acceleration = match last {
                    Some(last) if dt_s > 0.0 => (velocity - last) / dt_s,
                    _ => Vector3::zeros(),
                };
                let carried = base_from_map * (acceleration + Vector3::z() * GRAVITY) * mass;
                torques[i] += jacobian.transpose() * carried;
            }
        }
        self.last_link_velocities = Some(velocities);
        torques
    }
}

/// Whether a body walks or turns, rather than stands and sways.
fn moves(twist: &Twist) -> bool {
    twist.velocity_in_map.xy().norm() > STANDS_BELOW
        || twist.angular_velocity_in_base.z.abs() > STANDS_BELOW
}

/// Joint speeds for a velocity; none where the leg is stretched and has no answer.
fn solved(jacobian: &Matrix3, velocity: &Vector3) -> Vector3 {
    jacobian
        .try_inverse()
        .map_or_else(Vector3::zeros, |inverse| inverse * velocity)
}
