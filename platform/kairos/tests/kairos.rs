//! Wheels, limits, commands and odometry of the RB-Kairos+, against numbers worked out by hand.

use std::f64::consts::{FRAC_PI_2, TAU};

use hachi_hal::conformance::check_base_drive;
use hachi_hal::{
    BaseAction, BaseCommand, BaseDrive, BodyPosture, BodyVelocity, Pose, Stamp, Vector3,
};
use hachi_kairos::{
    LIMITS, SimulatedBase, TwistDrive, WHEELS, WheelOdometry, WheelOdometryConfig,
    footprint_from_lidar,
};
use proptest::prelude::*;

fn velocity(forward: f64, left: f64, yaw_rate: f64) -> BodyVelocity {
    BodyVelocity {
        forward,
        left,
        yaw_rate,
    }
}

fn near(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
}

#[test]
fn wheels_turn_as_the_general_mecanum_formula_says() {
    // r = 0.127, L = 0.21528 + 0.2690 = 0.48428.
    let ahead = WHEELS.wheel_speeds(&velocity(0.127, 0.0, 0.0));
    assert!(near(&ahead, &[1.0; 4]));
    let aside = WHEELS.wheel_speeds(&velocity(0.0, 0.127, 0.0));
    assert!(near(&aside, &[-1.0, 1.0, 1.0, -1.0]));
    let turning = WHEELS.wheel_speeds(&velocity(0.0, 0.0, 0.127 / 0.48428));
    assert!(near(&turning, &[-1.0, 1.0, -1.0, 1.0]));
}

#[test]
fn wheels_that_slip_contradict_each_other() {
    let mut wheels = WHEELS.wheel_speeds(&velocity(0.5, 0.2, 0.3));
    assert!(WHEELS.contradiction(&wheels).abs() < 1e-12);
    wheels[2] += 1.0;
    assert!((WHEELS.contradiction(&wheels) + 0.127 / 4.0).abs() < 1e-12);
}

proptest! {
    #[test]
    fn forward_undoes_inverse(x in -2.0..2.0, y in -2.0..2.0, w in -3.0..3.0) {
        let back = WHEELS.velocity(&WHEELS.wheel_speeds(&velocity(x, y, w)));
        prop_assert!(near(&[back.forward, back.left, back.yaw_rate], &[x, y, w]));
    }

    #[test]
    fn what_is_granted_goes_the_way_that_was_asked_and_within_limits(
        x in -5.0..5.0, y in -5.0..5.0, w in -9.0..9.0,
    ) {
        let asked = velocity(x, y, w);
        let (granted, cut) = WHEELS.limited(&LIMITS, &asked);
        let rim = WHEELS.wheel_speeds(&granted).into_iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        prop_assert!(rim * WHEELS.radius_m <= LIMITS.rim_speed + 1e-9);
        prop_assert!(f64::hypot(granted.forward, granted.left) <= LIMITS.speed + 1e-9);
        prop_assert!(granted.yaw_rate.abs() <= LIMITS.yaw_rate + 1e-9);
        prop_assert_eq!(cut, granted != asked);
        // Same direction: the cross products vanish.
        prop_assert!((granted.forward * y - granted.left * x).abs() < 1e-9);
        prop_assert!((granted.forward * w - granted.yaw_rate * x).abs() < 1e-9);
    }
}

#[test]
fn the_drive_keeps_the_promise_of_a_base() {
    let mut drive = TwistDrive::new(SimulatedBase::new(WHEELS, 250_000_000));
    check_base_drive(&mut drive, Stamp::from_nanos(9_000_000_000)).unwrap();
}

#[test]
fn a_base_on_wheels_holds_no_posture_and_stands_when_it_is_told_nothing() {
    let mut drive = TwistDrive::new(SimulatedBase::new(WHEELS, 250_000_000));
    let now = Stamp::from_nanos(1_000_000_000);
    let command = |action| BaseCommand {
        stamp: now,
        time_to_live_ns: 400_000_000,
        action,
    };
    let posture = command(BaseAction::Pose(BodyPosture::default()));
    assert!(drive.command(&posture, now).is_err());
    let walk = command(BaseAction::Move(velocity(0.3, 0.0, 0.0)));
    drive.command(&walk, now).unwrap();
    drive.service(now).unwrap();
    assert!(drive.sink().wheel_speeds(now + 1)[0] > 0.0);
    // Nobody calls `service` any more: the base itself gives up.
    assert_eq!(drive.sink().wheel_speeds(now + 250_000_000), [0.0; 4]);
}

#[test]
fn a_circle_ends_where_it_began() {
    let mut odometry = WheelOdometry::new(WHEELS, WheelOdometryConfig::default());
    // A circle of 1 m radius in 100 steps: to the right all the time, turning right.
    let steps = 100;
    let speeds = WHEELS.wheel_speeds(&velocity(0.0, -0.5, -0.5));
    let period_ns = (TAU / 0.5 / f64::from(steps) * 1e9) as i64;
    let mut last = None;
    for i in 0..=steps {
        let stamp = Stamp::from_nanos(i64::from(i) * period_ns);
        let estimate = odometry.step(stamp, &speeds).unwrap();
        if i == steps / 4 {
            // A quarter of it: (-1, -1) from the start, turned right by a quarter.
            let pose = estimate.sample.odom_from_base;
            let expected = Vector3::new(-1.0, -1.0, 0.0);
            assert!((pose.translation.vector - expected).norm() < 1e-6, "{pose}");
            let (_, _, yaw) = pose.rotation.euler_angles();
            assert!((yaw + FRAC_PI_2).abs() < 1e-6);
        }
        last = Some(estimate);
    }
    let last = last.unwrap();
    let off = last.sample.odom_from_base.translation.vector.norm();
    assert!(off < 1e-6, "{off}");
    // Half a metre a second with 5 % for a second at a time, over 12.6 s.
    let sigma = last.pose_covariance[(0, 0)].sqrt();
    assert!((0.02..0.5).contains(&sigma), "{sigma}");
}

#[test]
fn speeds_that_are_none_or_not_later_are_left_out() {
    let mut odometry = WheelOdometry::new(WHEELS, WheelOdometryConfig::default());
    odometry.step(Stamp::from_nanos(10), &[1.0; 4]).unwrap();
    assert!(odometry.step(Stamp::from_nanos(10), &[1.0; 4]).is_err());
    let nan = odometry.step(Stamp::from_nanos(20), &[1.0, f64::NAN, 1.0, 1.0]);
    assert!(nan.unwrap_err().to_string().contains("FR"));
    assert!(odometry.step(Stamp::from_nanos(30), &[1.0; 4]).is_ok());
}

#[test]
fn a_slipping_wheel_makes_the_velocity_uncertain() {
    let mut odometry = WheelOdometry::new(WHEELS, WheelOdometryConfig::default());
    let mut wheels = WHEELS.wheel_speeds(&velocity(0.5, 0.0, 0.0));
    let sure = odometry.step(Stamp::from_nanos(1), &wheels).unwrap();
    wheels[0] += 4.0;
    let unsure = odometry.step(Stamp::from_nanos(2), &wheels).unwrap();
    let sigma = |m: nalgebra::Matrix3<f64>| m[(0, 0)].sqrt();
    assert!(sigma(sure.velocity_covariance) < 0.011);
    assert!(sigma(unsure.velocity_covariance) > 0.12);
}

#[test]
fn the_footprint_is_a_wheel_s_radius_under_the_axles() {
    let mast = Pose::translation(-0.3, 0.0, 0.9);
    let footprint = footprint_from_lidar(&mast);
    let expected = Vector3::new(-0.3, 0.0, 1.027);
    assert!((footprint.translation.vector - expected).norm() < 1e-12);
}
