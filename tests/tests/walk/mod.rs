//! A simulated quadruped on a path, its legs followed by the real code: what the tests of legs
//! share.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::{Pose, Stamp, Vector3};
use hachi_unitree::frame::Model;
use hachi_unitree::{BodySample, LegEstimate, LegTracker, Quadruped};
use hachi_world::floor::RaisedFloor;
use hachi_world::legs::{Footfall, LegSensorConfig, SlipConfig};
use hachi_world::motion::{Axis, BodyMotion, Harmonic};
use hachi_world::{
    Floor, Gait, LegDimensions, LegTick, LegsConfig, Trajectory, TrajectoryBuilder, WalkingLegs,
};

/// A robot, and how it stands and weighs in the simulation.
#[derive(Clone, Copy)]
pub struct Robot {
    pub quadruped: Quadruped,
    pub height_m: f64,
    pub dimensions: LegDimensions,
}

/// Weights of the links are those of the robot descriptions.
pub fn robot(model: Model) -> Robot {
    let (quadruped, height_m, thigh_kg, calf_kg) = match model {
        Model::B1 => (B1, 0.50, 4.3, 1.10),
        _ => (GO1, 0.28, 0.92, 0.196),
    };
    let g = quadruped.geometry;
    Robot {
        quadruped,
        height_m,
        dimensions: LegDimensions {
            hip_forward: g.hip_forward,
            hip_sideways: g.hip_sideways,
            abduction: g.abduction,
            thigh: g.thigh,
            calf: g.calf,
            foot_radius: g.foot_radius,
            mass_kg: quadruped.mass_kg,
            thigh_kg,
            calf_kg,
        },
    }
}

/// A trot that also sways by `degrees` in roll and pitch, slowly.
pub fn swaying(robot: &Robot, degrees: f64) -> Gait {
    let mut body = BodyMotion::trot();
    let sway = |axis, frequency_hz, phase| Harmonic {
        axis,
        amplitude: degrees.to_radians(),
        frequency_hz,
        phase,
    };
    body.harmonics.push(sway(Axis::Roll, 0.23, 0.0));
    body.harmonics.push(sway(Axis::Pitch, 0.31, 1.0));
    Gait {
        base_height_m: robot.height_m,
        body,
        ..Gait::quadruped()
    }
}

/// 12 m there and back, with turns on the spot and a curve.
pub fn there_and_back(gait: Gait, floor: Floor) -> Trajectory {
    TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
        .stand(1.0)
        .walk(&[[8.0, 0.0], [8.0, 4.0]])
        .walk(&[[8.0, 0.0], [0.0, 0.0]])
        .turn_to(0.0)
        .build(floor)
        .unwrap()
}

/// A ramp of `degrees` up, a level stretch and a ramp down, across the way of [`there_and_back`].
pub fn ramps(degrees: f64) -> Floor {
    let ramp_m = 2.5;
    Floor {
        raised: vec![RaisedFloor {
            start: [1.2, 0.0],
            along: [1.0, 0.0],
            half_width_m: 2.0,
            ramp_m,
            level_m: 0.8,
            // The slope sets in and ends over half a metre each.
            height_m: (ramp_m - 0.5) * degrees.to_radians().tan(),
        }],
        terrain: None,
    }
}

pub struct Walk {
    pub robot: Robot,
    pub trajectory: Trajectory,
    pub footfall: Footfall,
    pub sensors: LegSensorConfig,
    pub slips: SlipConfig,
    pub floor: Floor,
    pub seed: u64,
    pub period_s: f64,
    /// The legs' state is looked at every so many periods.
    pub looked_at_every: i64,
    /// The robot reports no torques.
    pub without_torques: bool,
}

/// One moment of a walk.
pub struct Moment<'a> {
    pub time_s: f64,
    pub map_from_base: Pose,
    pub map_from_footprint: Pose,
    pub tick: &'a LegTick,
    pub estimate: &'a LegEstimate,
}

impl Walk {
    pub fn new(model: Model, trajectory: Trajectory, floor: Floor) -> Self {
        Self {
            robot: robot(model),
            trajectory,
            footfall: Footfall::trot(),
            sensors: LegSensorConfig::default(),
            slips: SlipConfig::NONE,
            floor,
            seed: 1,
            period_s: 0.002,
            looked_at_every: 1,
            without_torques: false,
        }
    }

    /// Walks for `seconds` and shows each moment.
    pub fn run(&self, seconds: f64, mut each: impl FnMut(&Moment<'_>)) {
        let mut legs = WalkingLegs::new(
            LegsConfig {
                dimensions: self.robot.dimensions,
                footfall: self.footfall,
                floor: self.floor.clone(),
                imu_in_base: Vector3::from(self.robot.quadruped.imu_in_base),
                sensors: self.sensors,
                slips: self.slips,
                seed: self.seed,
            },
            &self.trajectory.map_from_base(0.0),
        );
        let mut tracker = LegTracker::new(&self.robot.quadruped);
        let steps = (seconds / self.period_s) as i64;
        for i in 0..steps {
            let time_s = i as f64 * self.period_s;
            let stamp = Stamp::from_nanos((time_s * 1e9).round() as i64);
            let map_from_base = self.trajectory.map_from_base(time_s);
            let twist = self.trajectory.twist(time_s);
            let dt_s = if i == 0 { 0.0 } else { self.period_s };
            let tick = legs.step(stamp, dt_s, &map_from_base, &twist);
            if i % self.looked_at_every != 0 {
                continue;
            }
            let mut measured = tick.legs;
            if self.without_torques {
                measured.torques = [Vector3::zeros(); 4];
            }
            let sample = BodySample {
                legs: measured,
                imu: tick.imu,
                attitude: tick.attitude,
            };
            let estimate = tracker.step(&sample).unwrap();
            each(&Moment {
                time_s,
                map_from_base,
                map_from_footprint: self.trajectory.map_from_footprint(time_s),
                tick: &tick,
                estimate: &estimate,
            });
        }
    }
}
