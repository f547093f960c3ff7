//! The hall that scenes are played in: 18 m x 14 m, with things about that are no people. The robot
//! begins in the origin and looks along x.

use std::f64::consts::PI;

use crate::material::Material;
use crate::preset::World;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// What the robot does meanwhile.
#[derive(Debug, Clone, Copy)]
pub(super) enum Robot {
    /// Stands.
    Stands,
    /// Walks ahead slowly, so many metres.
    Walks(f64),
    /// Looks to the left and to the right by so many radians, again and again.
    Turns(f64),
}

/// No scene lasts longer, seconds.
const LONGEST_S: f64 = 300.0;
const LOW: [f64; 2] = [-5.0, -7.0];
const HIGH: [f64; 2] = [13.0, 7.0];
const HEIGHT_M: f64 = 3.2;

/// Slow enough to walk behind, m/s and rad/s.
const SLOWLY: (f64, f64) = (0.12, 0.35);
/// Between two turns the robot looks for so long, seconds.
const LOOKS_S: f64 = 9.0;

pub(super) fn hall(robot: Robot) -> World {
    let mut builder = SceneBuilder::new();
    builder.floor_slab(LOW, HIGH, 0.0, Material::FLOOR);
    let [width, depth] = [HIGH[0] - LOW[0], HIGH[1] - LOW[1]];
    let middle = [(LOW[0] + HIGH[0]) / 2.0, 0.0];
    let mut block = |at: [f64; 3], size: [f64; 3], yaw: f64, material| {
        builder.cuboid([at[0], at[1], at[2] + size[2] / 2.0], size, yaw, material);
    };
    block(
        [middle[0], 0.0, HEIGHT_M],
        [width, depth, 0.2],
        0.0,
        Material::CEILING,
    );
    for side in [-1.0, 1.0] {
        let across = middle[0] + side * (width / 2.0 + 0.1);
        block(
            [across, 0.0, 0.0],
            [0.2, depth, HEIGHT_M],
            0.0,
            Material::WALL,
        );
        let along = side * (depth / 2.0 + 0.1);
        block(
            [middle[0], along, 0.0],
            [width, 0.2, HEIGHT_M],
            0.0,
            Material::WALL,
        );
    }
    // The partition that people come from behind, and a pillar that hides them for a moment.
    block([9.0, 4.75, 0.0], [0.2, 4.5, 2.6], 0.0, Material::WALL);
    block(
        [5.6, -2.4, 0.0],
        [0.5, 0.5, HEIGHT_M],
        0.0,
        Material::CONCRETE,
    );
    block([12.6, -1.5, 0.0], [0.7, 2.4, 1.9], 0.0, Material::WOOD);
    block([12.7, 1.4, 0.0], [0.5, 1.2, 2.1], 0.0, Material::METAL);
    block([8.5, -5.2, 0.0], [1.6, 0.8, 0.75], 0.4, Material::WOOD);
    block([11.0, -4.6, 0.0], [0.5, 0.5, 1.3], 0.8, Material::DARK);
    block([6.0, 5.6, 0.0], [2.0, 0.9, 0.78], -0.2, Material::WOOD);
    block([12.85, -4.8, 0.9], [0.1, 1.6, 1.1], 0.0, Material::SIGN);
    let scene = builder.build();

    let patrol = match robot {
        Robot::Stands => TrajectoryBuilder::new([0.0; 2], 0.0, Gait::quadruped()).stand(LONGEST_S),
        Robot::Walks(far_m) => {
            let gait = Gait {
                speed: SLOWLY.0,
                ..Gait::quadruped()
            };
            TrajectoryBuilder::new([0.0; 2], 0.0, gait)
                .stand(8.0)
                .walk(&[[far_m, 0.0]])
                .stand(LONGEST_S)
                .turn(PI)
                .walk(&[[0.0; 2]])
                .turn(PI)
        }
        Robot::Turns(angle) => {
            let gait = Gait {
                turn_rate: SLOWLY.1,
                ..Gait::quadruped()
            };
            TrajectoryBuilder::new([0.0; 2], 0.0, gait)
                .stand(LOOKS_S)
                .turn(angle)
                .stand(LOOKS_S)
                .turn(-2.0 * angle)
                .stand(LOOKS_S)
                .turn(angle)
        }
    };
    let trajectory = patrol
        .build(scene.floor().clone())
        .expect("every patrol ends where it begins");
    World { scene, trajectory }
}
