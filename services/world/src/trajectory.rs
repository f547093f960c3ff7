//! Where the robot is at any time: a patrol that repeats for as long as one asks.
//!
//! In: legs (stand, turn, walk), the floor, the gait. Out: `map_from_footprint`, `map_from_base`,
//! velocities, in closed form for any time, so that memory does not grow with duration and every
//! laser firing has its own pose. Positions have continuous second derivatives.

use std::f64::consts::{PI, TAU};

use hachi_hal::{Pose, Rotation, Vector3};
use nalgebra::{Matrix3, Rotation3, Translation3};

use crate::floor::{Floor, Rising};
use crate::motion::BodyMotion;
use crate::path::Path;
use crate::smooth::Rise;

/// Why legs do not make a patrol.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The robot would have to jump to begin its next round.
    #[error("the patrol ends {gap_m} m and {turn_rad} rad from where it starts")]
    NotClosed {
        /// Distance from the end to the start, metres.
        gap_m: f64,
        /// Angle from the last heading to the first, radians.
        turn_rad: f64,
    },
    /// There is nothing to repeat.
    #[error("the patrol takes no time")]
    Empty,
}

/// How the robot moves along its legs.
#[derive(Debug, Clone, PartialEq)]
pub struct Gait {
    /// Walking speed, m/s.
    pub speed: f64,
    /// Speed of turns in place, rad/s.
    pub turn_rate: f64,
    /// Seconds from standing to full speed and back.
    pub ramp_s: f64,
    /// How far before a corner the robot leaves the straight line, metres.
    pub corner_cut_m: f64,
    /// Height of the base over the floor, metres.
    pub base_height_m: f64,
    /// The motion of the body about its mean.
    pub body: BodyMotion,
}

impl Gait {
    /// A quadruped of the size of a Unitree B1 at a trot.
    pub fn quadruped() -> Self {
        Self {
            speed: 0.6,
            turn_rate: 0.7,
            ramp_s: 0.8,
            corner_cut_m: 1.0,
            base_height_m: 0.45,
            body: BodyMotion::trot(),
        }
    }

    /// A quadruped that trots at `speed` m/s and rounds its corners the wider the faster it is, at
    /// 1 rad/s: a corner cut by `c` metres has a curvature of 1.75 / c at most.
    pub fn trotting(speed: f64) -> Self {
        Self {
            speed,
            corner_cut_m: 1.75 * speed,
            ..Self::quadruped()
        }
    }

    /// A robot on wheels at `speed` m/s, at most 3 m/s² in corners: it hardly bobs.
    pub fn wheeled(speed: f64) -> Self {
        Self {
            speed,
            ramp_s: 2.0,
            corner_cut_m: 1.75 * speed * speed / 3.0,
            body: BodyMotion::rolling(),
            ..Self::quadruped()
        }
    }

    /// Somebody in a hurry who carries the sensor.
    pub fn hand_held() -> Self {
        Self {
            speed: 1.2,
            turn_rate: 100f64.to_radians(),
            ramp_s: 0.5,
            corner_cut_m: 0.8,
            base_height_m: 1.2,
            body: BodyMotion::hand_held(),
        }
    }
}

/// Half the distances between the feet that stand on the floor, along and across: the footprint
/// lies on the plane through them. About those of a Unitree B1.
const HALF_STANCE_M: [f64; 2] = [0.30, 0.20];

#[derive(Debug, Clone)]
enum Movement {
    Stand,
    Turn { angle: f64, progress: Rise },
    Walk { path: Path, progress: Rise },
}

#[derive(Debug, Clone)]
struct Leg {
    begins_s: f64,
    from: [f64; 2],
    heading: f64,
    movement: Movement,
}

/// Puts a patrol together, leg by leg, from a place and a heading.
#[derive(Debug)]
pub struct TrajectoryBuilder {
    gait: Gait,
    start: ([f64; 2], f64),
    at: [f64; 2],
    heading: f64,
    elapsed_s: f64,
    legs: Vec<Leg>,
    places: Vec<[f64; 2]>,
}

impl TrajectoryBuilder {
    /// A robot that stands at `position` (metres) and looks along `heading` (radians, x towards y).
    pub fn new(position: [f64; 2], heading: f64, gait: Gait) -> Self {
        Self {
            gait,
            start: (position, heading),
            at: position,
            heading,
            elapsed_s: 0.0,
            legs: Vec::new(),
            places: Vec::new(),
        }
    }

    fn leg(&mut self, movement: Movement, lasts_s: f64) {
        self.legs.push(Leg {
            begins_s: self.elapsed_s,
            from: self.at,
            heading: self.heading,
            movement,
        });
        self.elapsed_s += lasts_s;
    }

    /// Stands still.
    #[must_use]
    pub fn stand(mut self, seconds: f64) -> Self {
        self.leg(Movement::Stand, seconds.max(0.0));
        self
    }

    /// Turns in place by `angle` radians, positive to the left.
    #[must_use]
    pub fn turn(mut self, angle: f64) -> Self {
        if angle.abs() > 1e-9 {
            let progress = Rise::with_slope(angle.abs(), self.gait.turn_rate, self.gait.ramp_s);
            self.leg(Movement::Turn { angle, progress }, progress.length);
            self.heading = wrapped(self.heading + angle);
        }
        self
    }

    /// Turns in place to a heading, the short way.
    #[must_use]
    pub fn turn_to(self, heading: f64) -> Self {
        let angle = wrapped(heading - self.heading);
        self.turn(angle)
    }

    /// Turns towards the first of `places` and walks through them without stopping; the corners
    /// between them are rounded.
    #[must_use]
    pub fn walk(mut self, places: &[[f64; 2]]) -> Self {
        let waypoints: Vec<[f64; 2]> = std::iter::once(self.at)
            .chain(places.iter().copied())
            .collect();
        let Some(path) = Path::through(&waypoints, self.gait.corner_cut_m) else {
            return self;
        };
        let (_, first) = path.at(0.0);
        self.places.extend(places);
        self = self.turn_to(first);
        let progress = Rise::with_slope(path.length(), self.gait.speed, self.gait.ramp_s);
        let (end, heading) = path.at(path.length());
        self.leg(Movement::Walk { path, progress }, progress.length);
        (self.at, self.heading) = (end, heading);
        self
    }

    /// The patrol over `floor`.
    ///
    /// # Errors
    /// If it does not end where it starts, or takes no time.
    pub fn build(self, floor: Floor) -> Result<Trajectory, TrajectoryError> {
        let gap_m = (self.at[0] - self.start.0[0]).hypot(self.at[1] - self.start.0[1]);
        let turn_rad = wrapped(self.start.1 - self.heading);
        if gap_m > 1e-6 || turn_rad.abs() > 1e-6 {
            return Err(TrajectoryError::NotClosed { gap_m, turn_rad });
        }
        if self.elapsed_s <= 0.0 {
            return Err(TrajectoryError::Empty);
        }
        Ok(Trajectory {
            gait: self.gait,
            legs: self.legs,
            places: self.places,
            period_s: self.elapsed_s,
            floor,
        })
    }
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// Where the robot is at any time, in seconds since the start.
#[derive(Debug, Clone)]
pub struct Trajectory {
    gait: Gait,
    legs: Vec<Leg>,
    places: Vec<[f64; 2]>,
    period_s: f64,
    floor: Floor,
}

/// How the base moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Velocity of the base's origin, in the map frame, m/s.
    pub velocity_in_map: Vector3,
    /// Acceleration of the base's origin, in the map frame, m/s².
    pub acceleration_in_map: Vector3,
    /// Angular velocity, in the base frame, rad/s.
    pub angular_velocity_in_base: Vector3,
}

impl Trajectory {
    /// Seconds of one round.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// The places that it walks to, in turn, where it stops or goes round a corner; m, map frame.
    pub fn places(&self) -> &[[f64; 2]] {
        &self.places
    }

    /// Position, heading and share of full speed on the level.
    fn planar(&self, time_s: f64) -> ([f64; 2], f64, f64) {
        let time_s = time_s.max(0.0).rem_euclid(self.period_s);
        let leg = self
            .legs
            .partition_point(|leg| leg.begins_s <= time_s)
            .max(1)
            - 1;
        let leg = &self.legs[leg];
        let within = time_s - leg.begins_s;
        match &leg.movement {
            Movement::Stand => (leg.from, leg.heading, 0.0),
            Movement::Turn { angle, progress } => (
                leg.from,
                leg.heading + progress.value(within).copysign(*angle),
                progress.slope_share(within),
            ),
            Movement::Walk { path, progress } => {
                let (position, heading) = path.at(progress.value(within));
                (position, heading, progress.slope_share(within))
            }
        }
    }

    /// The footprint: on the plane through the feet, under the base, x along the heading.
    pub fn map_from_footprint(&self, time_s: f64) -> Pose {
        let (position, heading, _) = self.planar(time_s);
        self.footprint_at(position, heading)
    }

    fn footprint_at(&self, position: [f64; 2], heading: f64) -> Pose {
        footprint_on(&self.floor, position, heading)
    }

    /// The base: over the footprint, bobbing with the gait.
    pub fn map_from_base(&self, time_s: f64) -> Pose {
        let (position, heading, activity) = self.planar(time_s);
        let standing = Translation3::new(0.0, 0.0, self.gait.base_height_m);
        self.footprint_at(position, heading)
            * standing
            * self.gait.body.displacement(time_s.max(0.0), activity)
    }

    /// How the base moves, by central differences over half a millisecond: good to 1e-4 m/s² and
    /// 1e-5 rad/s for bodies that shake at 2 Hz.
    pub fn twist(&self, time_s: f64) -> Twist {
        const HALF_STEP_S: f64 = 5e-4;
        let time_s = time_s.max(HALF_STEP_S);
        let before = self.map_from_base(time_s - HALF_STEP_S);
        let now = self.map_from_base(time_s);
        let after = self.map_from_base(time_s + HALF_STEP_S);
        let [p, q, r] = [before, now, after].map(|pose| pose.translation.vector);
        Twist {
            velocity_in_map: (r - p) / (2.0 * HALF_STEP_S),
            acceleration_in_map: (r - 2.0 * q + p) / (HALF_STEP_S * HALF_STEP_S),
            angular_velocity_in_base: (before.rotation.inverse() * after.rotation).scaled_axis()
                / (2.0 * HALF_STEP_S),
        }
    }

    /// The gait.
    pub fn gait(&self) -> &Gait {
        &self.gait
    }
}

/// The footprint of a quadruped that stands on a floor.
pub(crate) fn footprint_on(floor: &Floor, [x, y]: [f64; 2], heading: f64) -> Pose {
    let (sin, cos) = heading.sin_cos();
    let [along, across] = HALF_STANCE_M;
    let foot = |f: f64, l: f64| floor.raised_height(x + f * cos - l * sin, y + f * sin + l * cos);
    let [front_left, front_right] = [foot(along, across), foot(along, -across)];
    let [hind_left, hind_right] = [foot(-along, across), foot(-along, -across)];
    // The terrain curves by a fraction of a millimetre under the feet: its plane is their plane.
    let terrain = floor.terrain.as_ref();
    let rise = terrain.map_or_else(Rising::default, |terrain| terrain.rise(x, y));
    let slope_along = (front_left + front_right - hind_left - hind_right) / (4.0 * along)
        + (rise.slope[0] * cos + rise.slope[1] * sin);
    let slope_across = (front_left + hind_left - front_right - hind_right) / (4.0 * across)
        + (rise.slope[1] * cos - rise.slope[0] * sin);
    let height = (front_left + front_right + hind_left + hind_right) / 4.0 + rise.height;
    // The plane's normal and its x axis, in a frame that only follows the heading.
    let forward = Vector3::new(1.0, 0.0, slope_along).normalize();
    let up = Vector3::new(-slope_along, -slope_across, 1.0).normalize();
    let left = up.cross(&forward);
    let forward = left.cross(&up);
    let tilt = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[forward, left, up]));
    Pose::from_parts(
        Translation3::new(x, y, height),
        Rotation::from_axis_angle(&Vector3::z_axis(), heading)
            * Rotation::from_rotation_matrix(&tilt),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::RaisedFloor;

    fn square(gait: Gait) -> Trajectory {
        let floor = Floor {
            raised: vec![RaisedFloor {
                start: [1.0, 0.0],
                along: [1.0, 0.0],
                half_width_m: 1.5,
                ramp_m: 2.5,
                level_m: 1.0,
                height_m: 0.3,
            }],
            ..Floor::default()
        };
        TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
            .stand(1.0)
            .walk(&[[9.0, 0.0], [9.0, 6.0]])
            .turn(PI)
            .walk(&[[9.0, 0.0], [0.0, 0.0]])
            .turn_to(0.0)
            .build(floor)
            .unwrap()
    }

    #[test]
    fn position_velocity_and_attitude_are_continuous_over_two_rounds() {
        for gait in [Gait::quadruped(), Gait::hand_held()] {
            let hand_held = !gait.body.only_while_moving;
            let trajectory = square(gait);
            let step = 0.002;
            let mut last: Option<(Pose, Twist)> = None;
            let mut time = 0.01;
            while time < 2.0 * trajectory.period_s() {
                let (pose, twist) = (trajectory.map_from_base(time), trajectory.twist(time));
                if let Some((last_pose, last_twist)) = last {
                    let predicted = last_pose.translation.vector
                        + (last_twist.velocity_in_map + twist.velocity_in_map) * (step / 2.0);
                    let miss = (pose.translation.vector - predicted).norm();
                    assert!(miss < 1e-5, "at {time}: {miss} m");
                    let turned = (last_pose.rotation.inverse() * pose.rotation).angle();
                    let most = if hand_held { 260f64 } else { 100.0 }.to_radians();
                    assert!(turned < most * step, "at {time}: {turned}");
                    let jerk = (twist.acceleration_in_map - last_twist.acceleration_in_map).norm();
                    assert!(jerk / step < 150.0, "at {time}: {} m/s3", jerk / step);
                }
                last = Some((pose, twist));
                time += step;
            }
        }
    }

    #[test]
    fn the_body_bobs_with_the_configured_amplitude_and_frequency() {
        let trajectory = square(Gait::quadruped());
        // Walking the straight 6 m at the end of the first leg, on the level.
        let heights: Vec<f64> = (0..2000)
            .map(|i| {
                trajectory
                    .map_from_base(18.0 + f64::from(i) * 1e-3)
                    .translation
                    .z
                    - 0.45
            })
            .collect();
        let highest = heights.iter().copied().fold(f64::MIN, f64::max);
        let lowest = heights.iter().copied().fold(f64::MAX, f64::min);
        assert!((highest - 0.015).abs() < 1e-5 && (lowest + 0.015).abs() < 1e-5);
        let crossings = heights
            .windows(2)
            .filter(|w| w[0] < 0.0 && w[1] >= 0.0)
            .count();
        assert_eq!(crossings, 4); // 2 Hz for 2 s
    }

    #[test]
    fn the_footprint_lies_on_the_ramp_and_the_body_tilts_with_it() {
        let mut gait = Gait::quadruped();
        gait.body = BodyMotion::none();
        let trajectory = square(gait);
        // Middle of the ramp up: slope 0.3 / (2.5 - 0.5), nose up is a negative pitch.
        let time = (0..40_000)
            .map(|i| f64::from(i) * 1e-3)
            .find(|&t| trajectory.map_from_footprint(t).translation.x >= 2.25)
            .unwrap();
        let footprint = trajectory.map_from_footprint(time);
        assert!((footprint.translation.z - 0.15).abs() < 1e-3);
        let (roll, pitch, _) = footprint.rotation.euler_angles();
        assert!((pitch + (0.15f64).atan()).abs() < 1e-9, "{pitch}");
        assert!(roll.abs() < 1e-9);
        let base = footprint.inverse() * trajectory.map_from_base(time);
        assert!((base.translation.vector - Vector3::new(0.0, 0.0, 0.45)).norm() < 1e-9);
    }

    #[test]
    fn an_open_patrol_is_refused_with_its_gap() {
        let open = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::quadruped())
            .walk(&[[3.0, 0.0]])
            .build(Floor::default());
        assert_eq!(
            open.unwrap_err(),
            TrajectoryError::NotClosed {
                gap_m: 3.0,
                turn_rad: 0.0
            }
        );
    }
}
