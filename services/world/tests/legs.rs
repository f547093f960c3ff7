//! The simulated legs fit one motion: speeds are derivatives, feet that stand stay or roll, loads
//! and torques hold the body, and one seed gives one walk.

use hachi_hal::{Leg, Stamp, Vector3};
use hachi_world::legs::{Footfall, LegDimensions, LegSensorConfig, SlipConfig};
use hachi_world::{
    Floor, GRAVITY, Gait, LegTick, LegsConfig, Trajectory, TrajectoryBuilder, WalkingLegs,
};

/// About a Unitree B1.
const DIMENSIONS: LegDimensions = LegDimensions {
    hip_forward: 0.3455,
    hip_sideways: 0.072,
    abduction: 0.12675,
    thigh: 0.35,
    calf: 0.35,
    foot_radius: 0.04,
    mass_kg: 62.6,
    thigh_kg: 4.3,
    calf_kg: 1.1,
};

const DT_S: f64 = 0.001;

fn path() -> Trajectory {
    TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::quadruped())
        .stand(0.5)
        .walk(&[[3.0, 0.0]])
        .walk(&[[0.0, 0.0]])
        .turn_to(0.0)
        .build(Floor::default())
        .unwrap()
}

fn config(sensors: LegSensorConfig) -> LegsConfig {
    LegsConfig {
        dimensions: DIMENSIONS,
        footfall: Footfall::trot(),
        floor: Floor::default(),
        imu_in_base: Vector3::zeros(),
        sensors,
        slips: SlipConfig::NONE,
        seed: 7,
    }
}

fn walk(config: LegsConfig, seconds: f64) -> Vec<LegTick> {
    let path = path();
    let mut legs = WalkingLegs::new(config, &path.map_from_base(0.0));
    let steps = (seconds / DT_S) as usize;
    (0..steps)
        .map(|i| {
            let time_s = i as f64 * DT_S;
            let stamp = Stamp::from_nanos((time_s * 1e9) as i64);
            let dt_s = if i == 0 { 0.0 } else { DT_S };
            legs.step(
                stamp,
                dt_s,
                &path.map_from_base(time_s),
                &path.twist(time_s),
            )
        })
        .collect()
}

#[test]
fn joint_speeds_are_the_derivative_of_joint_angles() {
    let ticks = walk(config(LegSensorConfig::NONE), 4.0);
    for window in ticks.windows(3) {
        let [before, now, after] = window else {
            panic!("windows of three")
        };
        for leg in 0..4 {
            // A foot that lifts or lands changes its speed at once.
            let stands = [before, now, after].map(|t| t.truth.standing[leg]);
            if stands != [stands[0]; 3] {
                continue;
            }
            let numeric = (after.legs.angles[leg] - before.legs.angles[leg]) / (2.0 * DT_S);
            let off = (numeric - now.legs.speeds[leg]).amax();
            assert!(off < 0.05, "{}: {off} rad/s", now.legs.stamp);
        }
    }
}

#[test]
fn standing_feet_only_roll_and_swinging_feet_are_lifted() {
    let ticks = walk(config(LegSensorConfig::NONE), 6.0);
    let mut highest = 0.0_f64;
    for pair in ticks.windows(2) {
        for leg in Leg::ALL.map(Leg::index) {
            let stands = pair[0].truth.standing[leg] && pair[1].truth.standing[leg];
            let moved = pair[1].truth.feet_in_map[leg] - pair[0].truth.feet_in_map[leg];
            if stands {
                // The shank turns by less than 4 rad/s.
                assert!(
                    moved.norm() < 4.0 * DIMENSIONS.foot_radius * DT_S,
                    "{moved}"
                );
                let height = pair[1].truth.feet_in_map[leg].z;
                assert!((height - DIMENSIONS.foot_radius).abs() < 1e-9);
            }
            highest = highest.max(pair[1].truth.feet_in_map[leg].z);
        }
        assert!(pair[1].truth.reached);
    }
    let lifted = highest - DIMENSIONS.foot_radius;
    assert!((lifted - Footfall::trot().lift_m).abs() < 0.002, "{lifted}");
}

#[test]
fn a_standing_robot_s_feet_share_its_weight_and_its_torques_hold_it() {
    let ticks = walk(config(LegSensorConfig::NONE), 0.4);
    let tick = &ticks[100];
    let share = DIMENSIONS.mass_kg * GRAVITY / 4.0;
    for (force, load) in tick.legs.foot_forces.iter().zip(tick.truth.loads) {
        assert!((load - share).abs() < 1e-6 && (force - load).abs() <= 0.5);
    }
    assert!((tick.imu.specific_force - Vector3::new(0.0, 0.0, GRAVITY)).norm() < 1e-6);
    // By hand, at 0.45 m: thigh and calf lean by acos(0.41 / 0.7), so that the foot is 0.28369 m
    // before the knee and 0.12675 m beside the hip's axis; the links' middles are half as far.
    let (ahead, beside) = (0.28369, 0.12675);
    let knee = share * ahead - 1.1 * GRAVITY * ahead / 2.0;
    let hip = (share - (4.3 + 1.1) * GRAVITY) * beside;
    for leg in Leg::ALL {
        let torque = tick.legs.torques[leg.index()];
        assert!((torque.z - knee).abs() < 0.01, "{torque} {knee}");
        assert!((torque.x + leg.side() * hip).abs() < 0.01, "{torque} {hip}");
    }
}

#[test]
fn a_slip_moves_the_foot_over_the_ground_and_is_said() {
    let slipping = LegsConfig {
        slips: SlipConfig {
            share: 1.0,
            speed: [0.5, 0.5],
            lasts_s: [0.1, 0.1],
        },
        ..config(LegSensorConfig::NONE)
    };
    let ticks = walk(slipping, 4.0);
    let slid: f64 = ticks.iter().map(|t| t.truth.slip_speeds[0] * DT_S).sum();
    // Five to seven steps of a foot, each 0.1 s at 0.5 m/s but for its edges.
    assert!((0.2..0.4).contains(&slid), "{slid} m");
    assert!(ticks.iter().all(|t| t.truth.reached));
}

#[test]
fn one_seed_gives_one_walk_and_another_another() {
    let run = |seed| {
        let config = LegsConfig {
            seed,
            ..config(LegSensorConfig::default())
        };
        walk(config, 1.0)
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}
