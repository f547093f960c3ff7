//! Leg kinematics against the table worked out from the robots' descriptions, numeric
//! differentiation, and their own inverse.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::conformance::check_leg_kinematics;
use hachi_hal::{Leg, LegKinematics, Vector3};
use hachi_unitree::{LegGeometry, Quadruped};
use proptest::prelude::*;

/// Foot against the hip joint.
fn foot_under_hip(geometry: &LegGeometry, leg: Leg, q: [f64; 3]) -> Vector3 {
    geometry.foot_in_base(leg, &Vector3::from(q)) - geometry.hip(leg)
}

#[test]
fn feet_are_where_the_description_s_chain_puts_them() {
    let table = [
        (
            GO1,
            Leg::FrontLeft,
            [0.0, 0.9, -1.8],
            [0.0, 0.08, -0.264806],
        ),
        (
            GO1,
            Leg::FrontLeft,
            [0.3, 0.7, -1.5],
            [0.015578, 0.168425, -0.273764],
        ),
        (
            GO1,
            Leg::RearLeft,
            [-0.4, 1.2, -2.0],
            [-0.045727, -0.014160, -0.238927],
        ),
        (
            GO1,
            Leg::FrontRight,
            [0.3, 0.7, -1.5],
            [0.015578, 0.015571, -0.321047],
        ),
        (
            GO1,
            Leg::RearRight,
            [-0.4, 1.2, -2.0],
            [-0.045727, -0.161530, -0.176620],
        ),
        (
            B1,
            Leg::FrontLeft,
            [0.0, 0.9, -1.8],
            [0.0, 0.12675, -0.435127],
        ),
        (
            B1,
            Leg::RearLeft,
            [0.3, 0.7, -1.5],
            [0.025598, 0.272260, -0.451238],
        ),
        (
            B1,
            Leg::RearRight,
            [0.3, 0.7, -1.5],
            [0.025598, 0.030082, -0.526152],
        ),
    ];
    for (robot, leg, q, expected) in table {
        let foot = foot_under_hip(&robot.geometry, leg, q);
        let off = (foot - Vector3::from(expected)).amax();
        assert!(off < 1e-6, "{} {leg:?} {q:?}: {foot}", robot.name());
    }
}

#[test]
fn hips_sit_where_the_description_puts_them() {
    let hip = |robot: &Quadruped, leg| <[f64; 3]>::from(robot.geometry.hip(leg));
    assert_eq!(hip(&GO1, Leg::FrontRight), [0.1881, -0.04675, 0.0]);
    assert_eq!(hip(&GO1, Leg::RearLeft), [-0.1881, 0.04675, 0.0]);
    assert_eq!(hip(&B1, Leg::FrontLeft), [0.3455, 0.072, 0.0]);
    assert_eq!(hip(&B1, Leg::RearRight), [-0.3455, -0.072, 0.0]);
}

#[test]
fn home_poses_stand_at_the_maker_s_height() {
    let height = GO1.geometry.standing_height(&hachi_go1::home());
    // 0.2648 of leg and the foot's radius.
    assert!((height - 0.284806).abs() < 1e-6, "{height}");
    let height = B1.geometry.standing_height(&hachi_b1::home());
    assert!(
        (height - hachi_b1::STANDING_HEIGHT).abs() < 1e-5,
        "{height}"
    );
}

#[test]
fn commanded_joints_keep_to_mechanics_and_library_both() {
    let spans = GO1.joints.commanded().map(|s| (s.least, s.most));
    assert_eq!(spans, [(-0.863, 0.863), (-0.663, 2.966), (-2.721, -0.888)]);
    let spans = B1.joints.commanded().map(|s| (s.least, s.most));
    assert_eq!(spans, [(-0.75, 0.75), (-1.0, 3.5), (-2.6, -0.6)]);
}

#[test]
fn out_of_reach_is_said_and_the_leg_stretches_towards_it() {
    for robot in [GO1, B1] {
        let geometry = robot.geometry;
        for leg in Leg::ALL {
            let hip = geometry.hip(leg);
            let aside = Vector3::new(0.0, leg.side() * geometry.abduction, 0.0);
            let reach = geometry.thigh + geometry.calf;
            let down = |metres: f64| hip + aside - Vector3::new(0.0, 0.0, metres);
            assert!(geometry.joints_for(leg, &down(reach)).reachable);
            let far = geometry.joints_for(leg, &down(2.0 * reach));
            assert!(!far.reachable);
            let foot = geometry.foot_in_base(leg, &far.angles);
            assert!((foot - down(reach)).norm() < 1e-9, "{foot}");
            // Nearer to the hip's axis than the abduction link is long.
            assert!(!geometry.joints_for(leg, &hip).reachable);
            let nowhere = Vector3::new(f64::NAN, 0.0, -0.3);
            assert!(!geometry.joints_for(leg, &nowhere).reachable);
        }
    }
}

fn within_limits(robot: &'static Quadruped) -> impl Strategy<Value = Vector3> {
    let [hip, thigh, calf] = robot.joints.commanded();
    (
        hip.least..hip.most,
        thigh.least..thigh.most,
        calf.least..calf.most,
    )
        .prop_map(|(a, b, c)| Vector3::new(a, b, c))
        // The foot below its hip, where a robot that stands has it.
        .prop_filter("the foot is above its hip", move |q| {
            let plane = Vector3::new(0.0, q.y, q.z);
            robot.geometry.foot_in_base(Leg::FrontLeft, &plane).z < -0.01
        })
}

static GO1_REF: Quadruped = GO1;
static B1_REF: Quadruped = B1;

proptest! {
    #[test]
    fn jacobian_and_inverse_fit_the_forward_kinematics_of_a_go1(q in within_limits(&GO1_REF)) {
        check_leg_kinematics(&GO1.geometry, &q).unwrap();
    }

    #[test]
    fn jacobian_and_inverse_fit_the_forward_kinematics_of_a_b1(q in within_limits(&B1_REF)) {
        check_leg_kinematics(&B1.geometry, &q).unwrap();
    }

    #[test]
    fn the_shank_turns_as_its_axes_say(q in within_limits(&GO1_REF), dq in prop::array::uniform3(-5.0..5.0)) {
        // Knee and foot move apart by the shank's turn: v_foot - v_knee = w x (foot - knee).
        let geometry = GO1.geometry;
        let dq = Vector3::from(dq);
        let knee = LegGeometry { calf: 0.0, ..geometry };
        for leg in Leg::ALL {
            let apart = geometry.foot_in_base(leg, &q) - knee.foot_in_base(leg, &q);
            let speed = geometry.jacobian(leg, &q) * dq - knee.jacobian(leg, &q) * dq;
            let turn = geometry.shank_axes(leg, &q) * dq;
            prop_assert!((speed - turn.cross(&apart)).norm() < 1e-9);
        }
    }
}
