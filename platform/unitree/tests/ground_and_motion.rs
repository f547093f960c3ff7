//! Contact, footprint, leg odometry and their vote on bodies put together by hand, where the answer
//! is known exactly. The walks are in the tests of the whole.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::{
    AttitudeSample, ImuSample, Leg, LegKinematics, LegState, Pose, Rotation, Stamp, Vector3,
};
use hachi_unitree::contact::{
    ContactConfig, ContactDetector, ContactInput, ContactSource, Contacts, FootContact,
};
use hachi_unitree::footprint::{Footprint, FootprintInput, FootprintTracker};
use hachi_unitree::odometry::LegOdometryError;
use hachi_unitree::{BodySample, LegTracker, Quadruped};

const GRAVITY: f64 = 9.80665;
const MS: i64 = 1_000_000;

/// A body over a plane: feet stand under the hips on the ground `base_from_ground` says.
struct Scene {
    robot: Quadruped,
    base_from_ground: Pose,
    level_from_base: Rotation,
}

impl Scene {
    /// A body `height` over the ground, tilted against it, on ground tilted against the vertical.
    fn new(robot: Quadruped, height: f64, body_rpy: [f64; 3], ground_pitch: f64) -> Self {
        let [r, p, y] = body_rpy;
        let ground_from_base = Pose::from_parts(
            Vector3::new(0.0, 0.0, height).into(),
            Rotation::from_euler_angles(r, p, y),
        );
        let level_from_ground = Rotation::from_euler_angles(0.0, ground_pitch, 0.0);
        Self {
            robot,
            base_from_ground: ground_from_base.inverse(),
            level_from_base: level_from_ground * ground_from_base.rotation,
        }
    }

    /// Centre of the foot that stands under its hip.
    fn foot(&self, leg: Leg) -> Vector3 {
        let geometry = &self.robot.geometry;
        let hip = geometry.hip(leg) + Vector3::new(0.0, leg.side() * geometry.abduction, 0.0);
        let mut on_ground = self.base_from_ground.inverse() * nalgebra::Point3::from(hip);
        on_ground.z = geometry.foot_radius;
        (self.base_from_ground * on_ground).coords
    }

    fn feet(&self) -> [Vector3; 4] {
        Leg::ALL.map(|leg| self.foot(leg))
    }

    fn normal(&self) -> Vector3 {
        self.base_from_ground.rotation * Vector3::z()
    }

    /// Joints of a robot that stands or glides over the ground at `velocity` (base frame), with a
    /// share of its weight on each foot.
    fn sample(&self, stamp: Stamp, velocity: Vector3, shares: [f64; 4]) -> BodySample {
        let geometry = &self.robot.geometry;
        let up = self.level_from_base.inverse() * Vector3::z();
        let weight = self.robot.mass_kg * GRAVITY;
        let mut legs = LegState {
            stamp,
            angles: [Vector3::zeros(); 4],
            speeds: [Vector3::zeros(); 4],
            torques: [Vector3::zeros(); 4],
            foot_forces: [0.0; 4],
        };
        for leg in Leg::ALL {
            let i = leg.index();
            let posture = geometry.joints_for(leg, &self.foot(leg));
            assert!(posture.reachable);
            legs.angles[i] = posture.angles;
            let jacobian = geometry.jacobian(leg, &posture.angles);
            // A foot that rolls: its sole stands still.
            let arm = self.normal() * -geometry.foot_radius;
            let rolling = jacobian - arm.cross_matrix() * geometry.shank_axes(leg, &posture.angles);
            legs.speeds[i] = -(rolling.try_inverse().unwrap() * velocity);
            legs.torques[i] = -(jacobian.transpose() * up * (weight * shares[i]));
        }
        BodySample {
            legs,
            imu: ImuSample {
                stamp,
                angular_velocity: Vector3::zeros(),
                specific_force: up * GRAVITY,
            },
            attitude: AttitudeSample {
                stamp,
                level_from_base: self.level_from_base,
            },
        }
    }
}

fn contacts(stamp: Stamp, standing: [bool; 4]) -> Contacts {
    Contacts {
        stamp,
        feet: standing.map(|standing| FootContact {
            standing,
            confidence: if standing { 1.0 } else { 0.0 },
            vertical_force: 0.0,
        }),
        source: ContactSource::Torque,
    }
}

fn at(ms: i64) -> Stamp {
    Stamp::from_nanos(ms * MS)
}

const TILTS: [[f64; 4]; 4] = [
    [0.0, 0.0, 0.0, 0.0],
    [0.26, -0.26, 0.0, 0.0],
    [0.0, 0.2, 0.4, -0.2],
    [-0.2, 0.1, -0.3, 0.26],
];

#[track_caller]
fn assert_ground(footprint: &Footprint, scene: &Scene, height: f64) {
    assert!(
        (footprint.height_m() - height).abs() < 1e-9,
        "{footprint:?}"
    );
    assert!((footprint.normal_in_base() - scene.normal()).norm() < 1e-9);
    // x is the body's, laid onto the plane.
    let x = footprint.footprint_from_base.rotation * Vector3::x();
    assert!(x.x > 0.0 && x.y.abs() < 1e-9, "{x}");
    // The base is over the origin.
    let base = footprint.footprint_from_base.translation.vector;
    assert!(base.xy().norm() < 1e-9, "{base}");
}

#[test]
fn four_feet_give_the_plane_whatever_tilts() {
    for (robot, height) in [(GO1, 0.28), (B1, 0.50)] {
        for [roll, pitch, yaw, slope] in TILTS {
            let scene = Scene::new(robot, height, [roll, pitch, yaw], slope);
            let mut tracker = FootprintTracker::new();
            let footprint = tracker
                .step(
                    &robot.geometry,
                    &FootprintInput {
                        feet: &scene.feet(),
                        contacts: &contacts(at(0), [true; 4]),
                        moving: &[false; 4],
                        level_from_base: scene.level_from_base,
                        moved: None,
                    },
                )
                .unwrap();
            assert_ground(&footprint, &scene, height);
            assert_eq!((footprint.age_ns, footprint.feet), (Some(0), 4));
            assert!(footprint.residual_m < 1e-9);
            let mount = Pose::translation(0.2, 0.0, 0.1);
            let from_lidar = footprint.footprint_from_lidar(&mount);
            let expected = footprint.footprint_from_base * nalgebra::Point3::new(0.2, 0.0, 0.1);
            assert!((from_lidar.translation.vector - expected.coords).norm() < 1e-12);
        }
    }
}

#[test]
fn fewer_than_three_feet_carry_the_plane_with_the_attitude_and_say_its_age() {
    let robot = GO1;
    let mut tracker = FootprintTracker::new();
    let mut step = |scene: &Scene, ms: i64, standing: [bool; 4]| {
        tracker.step(
            &robot.geometry,
            &FootprintInput {
                feet: &scene.feet(),
                contacts: &contacts(at(ms), standing),
                moving: &[false; 4],
                level_from_base: scene.level_from_base,
                moved: None,
            },
        )
    };
    let nobody = [false; 4];
    let first = Scene::new(robot, 0.28, [0.0, 0.1, 0.0], -0.2);
    assert_eq!(step(&first, 0, nobody), None, "no foot has stood yet");
    step(&first, 10, [true, true, true, false]).unwrap();
    // The body tilts and rises; two feet, one foot, none.
    let tilted = Scene::new(robot, 0.30, [-0.2, 0.2, 0.0], -0.2);
    for (ms, standing, feet) in [
        (110, [true, false, false, true], 2),
        (210, [false, true, false, false], 1),
        (310, nobody, 0),
    ] {
        let footprint = step(&tilted, ms, standing).unwrap();
        assert_ground(&footprint, &tilted, 0.30);
        assert_eq!(footprint.age_ns, Some((ms - 10) * MS));
        assert_eq!(footprint.feet, feet);
    }
}

#[test]
fn two_feet_turn_a_plane_that_is_no_longer_true() {
    let robot = B1;
    let level = Scene::new(robot, 0.5, [0.0; 3], 0.0);
    // The robot has come onto a ramp of 10 degrees; its body is level.
    let slope = -10f64.to_radians();
    let ramp = Scene::new(robot, 0.5, [0.0, -slope, 0.0], slope);
    assert!(ramp.level_from_base.angle() < 1e-9);
    let mut tracker = FootprintTracker::new();
    let mut angle = f64::NAN;
    for (i, scene) in core::iter::once(&level)
        .chain(core::iter::repeat_n(&ramp, 12))
        .enumerate()
    {
        let standing = match (i, i % 2) {
            (0, _) => [true; 4],
            (_, 0) => [true, false, false, true],
            _ => [false, true, true, false],
        };
        let footprint = tracker
            .step(
                &robot.geometry,
                &FootprintInput {
                    feet: &scene.feet(),
                    contacts: &contacts(at(i as i64 * 250), standing),
                    moving: &[false; 4],
                    level_from_base: scene.level_from_base,
                    moved: None,
                },
            )
            .unwrap();
        angle = footprint.normal_in_base().angle(&scene.normal());
    }
    assert!(angle.to_degrees() < 0.2, "{}", angle.to_degrees());
}

#[test]
fn the_torques_of_a_standing_robot_tell_its_weight() {
    for (robot, height) in [(GO1, 0.28), (B1, 0.5)] {
        let scene = Scene::new(robot, height, [0.1, -0.1, 0.0], 0.0);
        let config = ContactConfig {
            counts_per_share: None,
            ..robot.contact
        };
        let mut detector = ContactDetector::new(robot.geometry, config, robot.mass_kg);
        let up = scene.level_from_base.inverse() * Vector3::z();
        let sample = scene.sample(at(0), Vector3::zeros(), [0.5, 0.0, 0.1, 0.4]);
        let contacts = detector.step(&ContactInput {
            legs: &sample.legs,
            up,
            ground_normal: up,
            angular_velocity: Vector3::zeros(),
        });
        let weight = robot.mass_kg * GRAVITY;
        let shares = contacts.feet.map(|foot| foot.vertical_force / weight);
        for (got, expected) in shares.iter().zip([0.5, 0.0, 0.1, 0.4]) {
            assert!((got - expected).abs() < 1e-9, "{shares:?}");
        }
        // A tenth of the weight is 0.4 of a foot's share: below the touch threshold.
        let standing = contacts.feet.map(|foot| foot.standing);
        assert_eq!(standing, [true, false, false, true]);
        assert_eq!(contacts.source, ContactSource::Torque);
    }
}

#[test]
fn contact_keeps_its_state_between_the_thresholds() {
    let robot = B1;
    let scene = Scene::new(robot, 0.5, [0.0; 3], 0.0);
    let mut detector = ContactDetector::new(robot.geometry, robot.contact, robot.mass_kg);
    let mut stands = |ms: i64, share: f64| {
        let sample = scene.sample(at(ms), Vector3::zeros(), [share / 4.0; 4]);
        let contacts = detector.step(&ContactInput {
            legs: &sample.legs,
            up: Vector3::z(),
            ground_normal: Vector3::z(),
            angular_velocity: Vector3::zeros(),
        });
        contacts.feet[0].standing
    };
    assert!(!stands(0, 0.45));
    assert!(stands(1, 0.55));
    assert!(stands(2, 0.45) && stands(3, 0.35));
    assert!(!stands(4, 0.3));
    assert!(!stands(5, 0.45));
}

#[test]
fn a_glide_over_standing_feet_is_measured_exactly() {
    for (robot, height) in [(GO1, 0.28), (B1, 0.5)] {
        for [roll, pitch, _, slope] in TILTS {
            let scene = Scene::new(robot, height, [roll, pitch, 0.0], slope);
            let mut tracker = LegTracker::new(&robot);
            let velocity = Vector3::new(0.4, -0.1, 0.05);
            let mut last = None;
            for ms in (0..1_000).step_by(2) {
                let sample = scene.sample(at(ms), velocity, [0.25; 4]);
                last = Some(tracker.step(&sample).unwrap());
            }
            let motion = last.unwrap().motion;
            assert!((motion.velocity - velocity).norm() < 1e-9, "{motion:?}");
            assert_eq!((motion.feet, motion.slip.any()), (4, false));
            // The feet settle in the first moments, in which the velocity is not known yet.
            let speed = velocity.norm();
            assert!((motion.distance_m - speed * 0.99).abs() < 0.02 * speed);
            let sigma = (motion.velocity_covariance.trace() / 3.0).sqrt();
            assert!((0.005..0.05).contains(&sigma), "{sigma}");
        }
    }
}

#[test]
fn one_of_two_feet_that_slips_is_outvoted_and_named() {
    let robot = GO1;
    let scene = Scene::new(robot, 0.28, [0.0; 3], 0.0);
    let mut tracker = LegTracker::new(&robot);
    let velocity = Vector3::new(0.4, 0.0, 0.0);
    let slide = Vector3::new(-0.35, 0.2, 0.0);
    let trot = [0.5, 0.0, 0.0, 0.5];
    for ms in (0..1_000).step_by(2) {
        let mut sample = scene.sample(at(ms), velocity, trot);
        let slips = ms >= 800;
        if slips {
            // The rear left foot's sole moves over the ground.
            let other = scene.sample(at(ms), velocity - slide, trot);
            sample.legs.speeds[3] = other.legs.speeds[3];
        }
        let motion = tracker.step(&sample).unwrap().motion;
        if ms > 100 {
            assert_eq!(motion.slip.feet, [false, false, false, slips], "at {ms} ms");
            assert!((motion.velocity - velocity).norm() < 1e-6, "at {ms} ms");
        }
        if slips {
            assert!((motion.slip.speeds[3] - slide.norm()).abs() < 1e-6);
            // And it is less sure than before.
            assert!(motion.velocity_covariance.trace() > 0.01);
        }
    }
}

#[test]
fn moments_that_are_not_later_or_not_finite_are_left_out() {
    let scene = Scene::new(GO1, 0.28, [0.0; 3], 0.0);
    let mut tracker = LegTracker::new(&GO1);
    let still = |ms: i64| scene.sample(at(ms), Vector3::zeros(), [0.25; 4]);
    tracker.step(&still(10)).unwrap();
    for ms in [10, 5] {
        let error = tracker.step(&still(ms)).unwrap_err();
        assert!(
            matches!(error, LegOdometryError::NotLater { .. }),
            "{error}"
        );
    }
    let mut ill = still(20);
    ill.legs.torques[2].y = f64::NAN;
    let error = tracker.step(&ill).unwrap_err();
    assert_eq!(error, LegOdometryError::NotFinite { stamp: at(20) });
    let mut ill = still(20);
    ill.imu.specific_force.x = f64::INFINITY;
    assert!(tracker.step(&ill).is_err());
    assert!(tracker.step(&still(20)).is_ok());
}

#[test]
fn a_gap_makes_the_place_uncertain() {
    let scene = Scene::new(GO1, 0.28, [0.0; 3], 0.0);
    let mut tracker = LegTracker::new(&GO1);
    let still = |ms: i64| scene.sample(at(ms), Vector3::zeros(), [0.25; 4]);
    let mut sigma = 0.0;
    for ms in [0, 2, 4, 6, 8] {
        let motion = tracker.step(&still(ms)).unwrap().motion;
        sigma = motion.position_covariance.trace().sqrt();
    }
    assert!(sigma < 0.02, "{sigma}");
    // Half a second in which it may have run.
    let motion = tracker.step(&still(508)).unwrap().motion;
    assert!(motion.position_covariance.trace().sqrt() > 0.5);
}
