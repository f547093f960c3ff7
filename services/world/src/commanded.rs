//! A quadruped that goes where it is told, and not along a path that is known beforehand.
//!
//! In: a floor, a gait, and from moment to moment the velocity that is asked of it. Out: where its
//! body is and was a moment ago, and what joints, feet and inertial sensor report. A body has
//! inertia: velocities follow what is asked at a quadruped's accelerations, and the bobbing of the
//! gait sets in and ends over half a second.

use std::collections::VecDeque;

use hachi_hal::{BodyVelocity, Pose, Stamp, Vector3};
use nalgebra::Translation3;

use crate::floor::Floor;
use crate::legs::{LegTick, LegsConfig, WalkingLegs};
use crate::motion::BodyMotion;
use crate::smooth;
use crate::trajectory::{Twist, footprint_on};

/// From one look at the body to the next, ns: legs roll in steps of 1 to 5 ms.
const STEP_NS: i64 = 2_000_000;
const STEP_S: f64 = STEP_NS as f64 * 1e-9;

/// How fast a trotting quadruped changes its speed, m/s², and its turn, rad/s².
const ACCELERATION: f64 = 3.0;
const TURN_ACCELERATION: f64 = 6.0;

/// The gait's bobbing sets in and ends over this, s.
const SET_IN_S: f64 = 0.5;
/// Slower than this, m/s or rad/s, it stands.
const STANDS_BELOW: f64 = 0.02;

/// Poses that are remembered: half a second.
const REMEMBERED: usize = 250;

/// The body and its legs.
#[derive(Debug, Clone)]
pub struct CommandedBody {
    floor: Floor,
    motion: BodyMotion,
    legs: WalkingLegs,
    position: [f64; 2],
    heading: f64,
    velocity: BodyVelocity,
    /// How far the gait's bobbing has set in, 0 to 1.
    activity: f64,
    height_m: f64,
    elapsed_s: f64,
    /// The last poses, one a step, and one step ahead: the newest is not reported yet.
    poses: VecDeque<(Stamp, Pose)>,
    tick: LegTick,
    way_m: f64,
}

impl CommandedBody {
    /// A body that stands at `position`, `height_m` over the floor, at `start`.
    pub fn standing(
        legs: LegsConfig,
        motion: BodyMotion,
        height_m: f64,
        (position, heading): ([f64; 2], f64),
        start: Stamp,
    ) -> Self {
        let floor = legs.floor.clone();
        let standing = Translation3::new(0.0, 0.0, height_m);
        let pose = footprint_on(&floor, position, heading) * standing;
        let mut legs = WalkingLegs::new(legs, &pose);
        let still = Twist {
            velocity_in_map: Vector3::zeros(),
            acceleration_in_map: Vector3::zeros(),
            angular_velocity_in_base: Vector3::zeros(),
        };
        let tick = legs.step(start, 0.0, &pose, &still);
        let poses = [-1, 0, 1].map(|step| (start + step * STEP_NS, pose));
        Self {
            floor,
            motion,
            legs,
            position,
            heading,
            velocity: BodyVelocity::ZERO,
            activity: 0.0,
            height_m,
            elapsed_s: 0.0,
            poses: VecDeque::from(poses),
            tick,
            way_m: 0.0,
        }
    }

    /// Goes on to `now` with this velocity asked of it, the base `height_m` over the floor.
    pub fn advance(&mut self, now: Stamp, asked: &BodyVelocity, height_m: f64) {
        self.height_m = height_m;
        while self.stamp() + STEP_NS <= now {
            self.step(asked);
        }
    }

    /// The moment of what is reported.
    pub fn stamp(&self) -> Stamp {
        self.tick.legs.stamp
    }

    /// What the robot's own sensors report, and the truth about its legs.
    pub fn tick(&self) -> &LegTick {
        &self.tick
    }

    /// How fast it is.
    pub fn velocity(&self) -> BodyVelocity {
        self.velocity
    }

    /// The way it has gone, m.
    pub fn way_m(&self) -> f64 {
        self.way_m
    }

    /// Where the base was at a moment of the last half second; at the nearest that is known for
    /// any other.
    pub fn map_from_base(&self, at: Stamp) -> Pose {
        let next = self.poses.partition_point(|(stamp, _)| *stamp <= at);
        let (Some(before), Some(after)) = (
            self.poses.get(next.saturating_sub(1)),
            self.poses.get(next.min(self.poses.len() - 1)),
        ) else {
            return Pose::identity();
        };
        let span = after.0.nanos_since(before.0).max(1) as f64;
        let share = (at.nanos_since(before.0) as f64 / span).clamp(0.0, 1.0);
        before
            .1
            .try_lerp_slerp(&after.1, share, 1e-9)
            .unwrap_or(before.1)
    }

    fn step(&mut self, asked: &BodyVelocity) {
        let v = &mut self.velocity;
        let towards = |now: f64, goal: f64, rate: f64| {
            now + (goal - now).clamp(-rate * STEP_S, rate * STEP_S)
        };
        v.forward = towards(v.forward, asked.forward, ACCELERATION);
        v.left = towards(v.left, asked.left, ACCELERATION);
        v.yaw_rate = towards(v.yaw_rate, asked.yaw_rate, TURN_ACCELERATION);
        let speed = v.forward.hypot(v.left);
        let moves = speed.max(v.yaw_rate.abs()) > STANDS_BELOW;
        let set_in = STEP_S / SET_IN_S;
        self.activity = (self.activity + if moves { set_in } else { -set_in }).clamp(0.0, 1.0);
        let middle = self.heading + v.yaw_rate * STEP_S / 2.0;
        let (sin, cos) = middle.sin_cos();
        self.position[0] += (v.forward * cos - v.left * sin) * STEP_S;
        self.position[1] += (v.forward * sin + v.left * cos) * STEP_S;
        self.heading += v.yaw_rate * STEP_S;
        self.way_m += speed * STEP_S;
        self.elapsed_s += STEP_S;
        self.remember();
        self.report();
    }

    /// Where the body is one step after what is reported next.
    fn remember(&mut self) {
        let standing = Translation3::new(0.0, 0.0, self.height_m);
        let bobbing = smooth::step(self.activity);
        let pose = footprint_on(&self.floor, self.position, self.heading)
            * standing
            * self.motion.displacement(self.elapsed_s, bobbing);
        let newest = self.poses.back().map_or(self.stamp(), |(stamp, _)| *stamp);
        if self.poses.len() >= REMEMBERED {
            self.poses.pop_front();
        }
        self.poses.push_back((newest + STEP_NS, pose));
    }

    /// What legs and body report in the middle of the last three poses.
    fn report(&mut self) {
        let n = self.poses.len();
        let (Some((_, before)), Some((stamp, now)), Some((_, after))) = (
            self.poses.get(n.wrapping_sub(3)),
            self.poses.get(n.wrapping_sub(2)),
            self.poses.get(n.wrapping_sub(1)),
        ) else {
            return;
        };
        let [p, q, r] = [before, now, after].map(|pose| pose.translation.vector);
        let twist = Twist {
            velocity_in_map: (r - p) / (2.0 * STEP_S),
            acceleration_in_map: (r - 2.0 * q + p) / (STEP_S * STEP_S),
            angular_velocity_in_base: (before.rotation.inverse() * after.rotation).scaled_axis()
                / (2.0 * STEP_S),
        };
        self.tick = self.legs.step(*stamp, STEP_S, now, &twist);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::legs::{Footfall, LegDimensions, LegSensorConfig, SlipConfig};

    fn body() -> CommandedBody {
        let legs = LegsConfig {
            dimensions: LegDimensions {
                hip_forward: 0.3455,
                hip_sideways: 0.072,
                abduction: 0.12675,
                thigh: 0.35,
                calf: 0.35,
                foot_radius: 0.04,
                mass_kg: 62.6,
                thigh_kg: 4.3,
                calf_kg: 1.1,
            },
            footfall: Footfall::trot(),
            floor: Floor::default(),
            imu_in_base: Vector3::zeros(),
            sensors: LegSensorConfig::NONE,
            slips: SlipConfig::NONE,
            seed: 1,
        };
        let start = Stamp::from_nanos(1_000_000_000);
        CommandedBody::standing(legs, BodyMotion::trot(), 0.5, ([1.0, 2.0], 0.0), start)
    }

    #[test]
    fn it_goes_where_it_is_told_and_its_feet_reach_the_ground() {
        let mut body = body();
        let asked = BodyVelocity {
            forward: 0.6,
            left: 0.0,
            yaw_rate: 0.3,
        };
        let start = body.stamp();
        let mut lifted = 0;
        for ms in (10..=10_000).step_by(10) {
            body.advance(start + ms * 1_000_000, &asked, 0.5);
            let truth = &body.tick().truth;
            assert!(truth.reached);
            lifted += usize::from(truth.standing.contains(&false));
        }
        // A circle of 2 m for 10 s, less the 0.2 s that speeding up takes.
        let pose = body.map_from_base(body.stamp());
        let angle: f64 = 0.3 * (10.0 - 0.1);
        let expected = [1.0 + 2.0 * angle.sin(), 2.0 + 2.0 * (1.0 - angle.cos())];
        let off = (pose.translation.x - expected[0]).hypot(pose.translation.y - expected[1]);
        assert!(off < 0.1, "{off}");
        assert!((body.way_m() - 0.6 * 9.9).abs() < 0.01, "{}", body.way_m());
        assert!(lifted > 500, "it trots: {lifted}");
        body.advance(body.stamp() + 2_000_000_000, &BodyVelocity::ZERO, 0.5);
        assert_eq!(body.velocity(), BodyVelocity::ZERO);
        assert_eq!(body.tick().truth.standing, [true; 4]);
    }

    #[test]
    fn poses_of_the_last_moments_join_up() {
        let mut body = body();
        let asked = BodyVelocity {
            forward: 0.8,
            ..BodyVelocity::ZERO
        };
        body.advance(body.stamp() + 3_000_000_000, &asked, 0.5);
        let now = body.stamp();
        for back_us in (0..400_000).step_by(777) {
            let here = body.map_from_base(now + -back_us * 1_000);
            let there = body.map_from_base(now + -(back_us + 777) * 1_000);
            let way = (here.translation.vector - there.translation.vector).norm();
            // 0.8 m/s and the bobbing, 0.2 m/s at most.
            assert!(way < 1.05 * 777e-6, "{way} m at -{back_us} us");
        }
    }
}
