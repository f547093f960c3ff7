//! A state's values in hal's terms: each ill value is named, and takes no other with it.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::{Leg, Stamp, Vector3};
use hachi_unitree::Quadruped;
use hachi_unitree::frame::{BodyReading, FieldError, HighState};
use hachi_unitree::reading::{attitude, battery, body_sample, imu_sample, leg_state};

const NOW: Stamp = Stamp::from_nanos(5);

/// A robot that stands, each joint a little different.
fn standing(robot: &Quadruped) -> BodyReading {
    let mut body = HighState::of(&robot.layout).body;
    body.imu.quaternion = [1.0, 0.0, 0.0, 0.0];
    body.imu.gyroscope = [0.1, 0.2, 0.3];
    body.imu.accelerometer = [0.0, 0.5, 9.8];
    for (i, motor) in body.motors.iter_mut().enumerate() {
        motor.angle = [0.0, 0.9, -1.8][i % 3] + 0.001 * i as f32;
        motor.speed = i as f32;
        motor.torque = -(i as f32);
    }
    body.foot_force = [10, 20, 30, 40];
    body.battery.charge_percent = 73;
    body.battery.current_ma = -2_500;
    body.battery.cycles = 12;
    for (i, cell) in body.battery.cells_mv.iter_mut().enumerate() {
        *cell = 4_000 + i as u16;
    }
    body.battery.controller_temperatures_c[1] = 41;
    body
}

#[test]
fn joints_come_by_leg_and_joint() {
    let body = standing(&GO1);
    let sample = body_sample(&body, &GO1.joints, NOW).unwrap();
    let legs = sample.legs;
    let rear_left = Leg::RearLeft.index();
    assert_eq!(legs.speeds[rear_left], Vector3::new(9.0, 10.0, 11.0));
    assert_eq!(
        legs.torques[Leg::FrontLeft.index()],
        Vector3::new(-3.0, -4.0, -5.0)
    );
    assert!((legs.angles[0].y - 0.901).abs() < 1e-6);
    assert_eq!(legs.foot_forces, [10.0, 20.0, 30.0, 40.0]);
    assert_eq!(legs.stamp, NOW);
    assert!((sample.imu.specific_force.z - 9.8).abs() < 1e-6);
    assert!(sample.attitude.level_from_base.angle() < 1e-9);
}

#[test]
fn one_ill_value_is_named_and_leaves_the_others() {
    let mut body = standing(&GO1);
    body.motors[7].speed = f32::NAN;
    let error = leg_state(&body, &GO1.joints, NOW).unwrap_err();
    assert!(
        matches!(
            error,
            FieldError::NotFinite {
                field: "joint speed",
                index: 7,
                ..
            }
        ),
        "{error}"
    );
    assert!(imu_sample(&body, NOW).is_ok() && attitude(&body, NOW).is_ok());

    let mut body = standing(&GO1);
    body.imu.gyroscope[2] = f32::INFINITY;
    let error = imu_sample(&body, NOW).unwrap_err();
    assert_eq!(
        error.to_string(),
        "gyroscope[2] is inf, not a finite number"
    );
    assert!(leg_state(&body, &GO1.joints, NOW).is_ok());
    // Motors without a leg say what they like.
    let mut body = standing(&GO1);
    body.motors[12].angle = f32::NAN;
    assert!(leg_state(&body, &GO1.joints, NOW).is_ok());
}

#[test]
fn a_joint_where_none_can_be_is_refused_with_its_ends() {
    for (robot, thigh) in [(GO1, 4.9_f32), (B1, 3.8)] {
        let mut body = standing(&robot);
        body.motors[4].angle = thigh;
        let error = leg_state(&body, &robot.joints, NOW).unwrap_err();
        let FieldError::OutOfRange {
            index, got, most, ..
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!((index, got), (4, thigh));
        assert!((f64::from(most) - robot.joints.mechanical[1].most).abs() < 1e-6);
    }
    // A zero that is a little off is none of its fault.
    let mut body = standing(&GO1);
    body.motors[5].angle = -2.9;
    assert!(leg_state(&body, &GO1.joints, NOW).is_ok());
}

#[test]
fn an_attitude_before_the_estimate_runs_is_none() {
    let mut body = standing(&GO1);
    body.imu.quaternion = [0.0; 4];
    let error = attitude(&body, NOW).unwrap_err();
    assert_eq!(error, FieldError::Quaternion { length: 0.0 });
    // Half a turn about z is w x y z = 0 0 0 1.
    body.imu.quaternion = [0.0, 0.0, 0.0, 1.0];
    let turned = attitude(&body, NOW).unwrap().level_from_base;
    let ahead = turned * Vector3::x();
    assert!((ahead + Vector3::x()).norm() < 1e-9);
}

#[test]
fn the_battery_in_volts_and_amperes() {
    let sample = battery(&standing(&GO1), &GO1.layout, NOW).unwrap();
    assert_eq!(sample.charge, 0.73);
    assert_eq!((sample.current, sample.cycles), (-2.5, 12));
    // Ten cells of 4.000 to 4.009 V.
    assert!((sample.voltage - 40.045).abs() < 1e-9);
    assert_eq!(sample.lowest_cell, 4.0);
    assert_eq!(sample.temperature_c, 41.0);
    let sample = battery(&standing(&B1), &B1.layout, NOW).unwrap();
    assert!((sample.voltage - 120.435).abs() < 1e-9);
    let mut body = standing(&GO1);
    body.battery.charge_percent = 255;
    assert!(battery(&body, &GO1.layout, NOW).is_err());
}
