//! Any tilt and height of the sensor lead to the same levelled cloud.

mod scenes;

use hachi_hal::{Pose, Rotation};
use hachi_place::{Ground, Leveller, leveller};
use scenes::room;

/// The room as a sensor at `height_m` with this tilt measures it.
fn measured(roll: f64, pitch: f64, height_m: f64) -> (Vec<[f32; 4]>, Pose) {
    let level_from_sensor = Pose::from_parts(
        nalgebra::Translation3::new(0.0, 0.0, height_m),
        Rotation::from_euler_angles(roll, pitch, 0.0),
    );
    let mut points = Vec::new();
    leveller::apply(&level_from_sensor.inverse(), &room(4), &mut points);
    (points, level_from_sensor)
}

#[test]
fn tilt_and_height_are_found_from_the_ground() {
    for (roll, pitch, height) in [(0.0, 0.0, 0.6), (0.15, -0.2, 1.0), (-0.1, 0.4, 1.9)] {
        let (points, truth) = measured(roll, pitch, height);
        let mut levelled = Vec::new();
        let found = Leveller::default().level(&points, None, &mut levelled);
        assert!(matches!(found.ground, Ground::Plane { .. }));
        let up = found.level_from_sensor.rotation.inverse() * hachi_hal::Vector3::z();
        let true_up = truth.rotation.inverse() * hachi_hal::Vector3::z();
        assert!(up.angle(&true_up) < 0.01, "{roll} {pitch}: {up}");
        let off = found.level_from_sensor.translation.z - height;
        assert!(off.abs() < 0.03, "{roll} {pitch}: {off}");
        assert_eq!(levelled.len(), points.len());
    }
}

#[test]
fn with_gravity_only_the_height_is_looked_for() {
    let (points, truth) = measured(0.3, -0.5, 1.2);
    let mut levelled = Vec::new();
    let found = Leveller::default().level(&points, Some(truth.rotation), &mut levelled);
    assert!(found.level_from_sensor.rotation.angle_to(&truth.rotation) < 1e-9);
    assert!((found.level_from_sensor.translation.z - 1.2).abs() < 0.03);
    let ground = levelled.iter().filter(|p| p[2].abs() < 0.05).count();
    assert!(ground > 2500, "{ground}");
}

#[test]
fn without_a_ground_the_lowest_returns_are_its_height() {
    // A wall before the sensor, from 0.8 m below it to 2 m above.
    let wall: Vec<[f32; 4]> = (0..2000)
        .map(|i| {
            [
                5.0,
                (i % 50) as f32 * 0.1 - 2.5,
                (i / 50) as f32 * 0.07 - 0.8,
                9.0,
            ]
        })
        .collect();
    let mut levelled = Vec::new();
    let found = Leveller::default().level(&wall, None, &mut levelled);
    assert_eq!(found.ground, Ground::LowestReturns);
    assert!((found.level_from_sensor.translation.z - 0.8).abs() < 0.1);
    let mut nothing = Vec::new();
    let found = Leveller::default().level(&[[f32::NAN; 4]; 100], None, &mut nothing);
    assert_eq!(found.ground, Ground::Nothing);
    assert!(nothing.is_empty());
}
