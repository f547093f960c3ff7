//! Patrols behind the gate, among walls that a LiDAR sees: through doors, and past those that are too
//! narrow.

mod rooms;
mod walk;

use hachi_behaviour::{Patrol, PatrolConfig, PlaceEstimate, SafetyConfig};
use hachi_hal::Pose;
use rooms::{Building, Robot};
use walk::{STEP_MS, Walk};

/// On a robot that does what it is told, the patrol goes round its places and stops where it is
/// lost.
#[test]
fn a_patrol_reaches_its_places_in_turn() {
    let places = vec![[2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
    let mut patrol = Patrol::new(
        PatrolConfig {
            places: places.clone(),
            ..PatrolConfig::default()
        },
        SafetyConfig::default(),
    );
    let mut walk = Walk::new(SafetyConfig::default());
    let (mut x, mut y, mut heading) = (0.0f64, 0.0f64, 1.0f64);
    let mut visits = Vec::new();
    for _ in 0..6_000 {
        let place = PlaceEstimate {
            stamp: walk.now,
            map_from_base: Pose::new(
                hachi_hal::Vector3::new(x, y, 0.6),
                hachi_hal::Vector3::z() * heading,
            ),
            trusted: true,
        };
        let wish = patrol.step(walk.now, &place, &walk.obstacles).unwrap();
        let v = walk.step(wish.action).velocity();
        let dt_s = STEP_MS as f64 * 1e-3;
        x += v.forward * heading.cos() * dt_s;
        y += v.forward * heading.sin() * dt_s;
        heading += v.yaw_rate * dt_s;
        let near = places.iter().position(|p| (p[0] - x).hypot(p[1] - y) < 0.4);
        if let Some(near) = near.filter(|n| visits.last() != Some(n)) {
            visits.push(near);
        }
        let lost = PlaceEstimate {
            trusted: false,
            ..place
        };
        assert_eq!(patrol.step(walk.now, &lost, &walk.obstacles), None);
    }
    assert!(patrol.rounds() >= 2, "{}", patrol.rounds());
    // It starts where the last place is.
    assert_eq!(visits[..9], [3, 0, 1, 2, 3, 0, 1, 2, 3]);
}

/// The office's: 1.0 m wide, where a B1 with its margins is 0.94 m wide. The robot comes along the
/// corridor, goes in to the room and comes out again, round after round.
#[test]
fn a_door_as_narrow_as_the_offices_is_passed_in_and_out() {
    // Afterwards on along the corridor, back along it, and to a place a little behind it.
    for next in [[4.0, -1.1], [-4.0, -1.1], [-4.0, -1.4]] {
        let mut robot = Robot::new(
            Building::with_door(1.0),
            &[[0.0, -1.1], [0.0, 2.3], [0.0, -1.1], next],
        );
        robot.walk_for(200.0);
        assert_eq!(robot.given_up, [], "{next:?}");
        let rounds = robot.patrol.rounds();
        assert!(rounds >= 2, "{rounds} rounds by {next:?}");
        let margin_m = SafetyConfig::default().margin_m;
        assert!(robot.clearance_m > margin_m - 0.03, "{}", robot.clearance_m);
    }
}

/// 0.9 m: the body fits through, its margins do not.
#[test]
fn a_door_that_is_too_narrow_is_not_entered_and_the_patrol_goes_on_to_the_next_place() {
    let mut robot = Robot::new(
        Building::with_door(0.9),
        &[[0.0, -1.1], [0.0, 2.3], [4.0, -1.1]],
    );
    robot.walk_for(120.0);
    assert!(robot.given_up.starts_with(&[1]), "{:?}", robot.given_up);
    assert!(
        robot.given_up.iter().all(|place| *place == 1),
        "{:?}",
        robot.given_up
    );
    assert!(
        robot.patrol.rounds() >= 1,
        "{} rounds",
        robot.patrol.rounds()
    );
    assert!(
        robot.farthest_in_m < 0.0,
        "its middle came to {}",
        robot.farthest_in_m
    );
}
