//! Streets between buildings, trees and parked cars, driven through twice and once in reverse.

use std::f64::consts::{PI, TAU};

use hachi_hal::Vector3;
use hachi_place::Leveller;
use hachi_world::{Material, Scene, SceneBuilder};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::keyframes::{Keyframe, Level};

const BLOCKS: [f64; 2] = [90.0, 70.0];
const SIDE: usize = 3;

fn scene(seed: u64, cars: u64) -> Scene {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let mut b = SceneBuilder::new();
    b.floor_slab(
        [-100.0, -100.0],
        [BLOCKS[0] * 3.0 + 100.0, BLOCKS[1] * 3.0 + 100.0],
        0.0,
        Material::FLOOR,
    );
    let mut car = ChaCha8Rng::seed_from_u64(cars);
    for i in -1..=SIDE as i32 {
        for j in -1..=SIDE as i32 {
            let low = [f64::from(i) * BLOCKS[0], f64::from(j) * BLOCKS[1]];
            let road = 6.0;
            let edges = [
                (
                    [low[0] + road, low[1] + road],
                    [1.0, 0.0],
                    BLOCKS[0] - 2.0 * road,
                ),
                (
                    [low[0] + BLOCKS[0] - road, low[1] + road],
                    [0.0, 1.0],
                    BLOCKS[1] - 2.0 * road,
                ),
                (
                    [low[0] + BLOCKS[0] - road, low[1] + BLOCKS[1] - road],
                    [-1.0, 0.0],
                    BLOCKS[0] - 2.0 * road,
                ),
                (
                    [low[0] + road, low[1] + BLOCKS[1] - road],
                    [0.0, -1.0],
                    BLOCKS[1] - 2.0 * road,
                ),
            ];
            for (from, along, length) in edges {
                let inward = [-along[1], along[0]];
                let at = |s: f64, d: f64| {
                    [
                        from[0] + along[0] * s + inward[0] * d,
                        from[1] + along[1] * s + inward[1] * d,
                    ]
                };
                let yaw = f64::atan2(along[1], along[0]);
                let mut s = r.random_range(0.0..4.0);
                while s < length - 6.0 {
                    let w = r.random_range(7.0..22.0f64).min(length - s);
                    let (setback, depth, h) = (
                        r.random_range(0.5..7.0),
                        r.random_range(6.0..11.0),
                        r.random_range(3.0..16.0),
                    );
                    let c = at(s + w / 2.0, setback + depth / 2.0);
                    b.cuboid([c[0], c[1], h / 2.0], [w, depth, h], yaw, Material::WALL);
                    if setback > 2.5 && r.random_bool(0.5) {
                        let c = at(s + w / 2.0, 0.3);
                        b.cuboid([c[0], c[1], 0.6], [w, 0.3, 1.2], yaw, Material::WALL);
                    }
                    s += w + if r.random_bool(0.3) {
                        r.random_range(1.0..9.0)
                    } else {
                        0.0
                    };
                }
                let mut s = r.random_range(2.0..12.0);
                while s < length {
                    let c = at(s, -0.7);
                    if r.random_bool(0.6) {
                        let t = r.random_range(2.0..3.2);
                        b.cylinder([c[0], c[1], 0.0], 0.18, t, Material::CONCRETE);
                        b.cylinder(
                            [c[0], c[1], t],
                            r.random_range(1.0..2.4),
                            r.random_range(2.0..5.0),
                            Material::CONCRETE,
                        );
                    } else {
                        b.cylinder([c[0], c[1], 0.0], 0.1, 6.0, Material::CONCRETE);
                    }
                    s += r.random_range(7.0..16.0);
                }
                let mut s = car.random_range(1.0..5.0);
                while s < length - 5.0 {
                    if car.random_bool(0.5) {
                        let c = at(s + 2.2, -1.9);
                        b.cuboid([c[0], c[1], 0.75], [4.4, 1.8, 1.5], yaw, Material::METAL);
                    }
                    s += 5.5;
                }
            }
        }
    }
    b.build()
}

/// Way points of the drive, street corners in blocks.
const WAY: [[f64; 2]; 9] = [
    [0., 0.],
    [2., 0.],
    [2., 1.],
    [1., 1.],
    [1., 2.],
    [3., 2.],
    [3., 3.],
    [0., 3.],
    [0., 0.],
];

pub fn drive(seed: u64, level: Level, hdl: bool, gap_m: f64) -> Vec<Keyframe> {
    let mut out = Vec::new();
    let mut r = ChaCha8Rng::seed_from_u64(seed ^ 0x55);
    let mut leveller = Leveller::default();
    for round in 0..3u64 {
        let scene = scene(seed, seed * 10 + round);
        let mut way: Vec<[f64; 2]> = WAY
            .iter()
            .map(|p| [p[0] * BLOCKS[0], p[1] * BLOCKS[1]])
            .collect();
        if round == 2 {
            way.reverse();
        }
        for w in way.windows(2) {
            let (dx, dy) = (w[1][0] - w[0][0], w[1][1] - w[0][1]);
            let length = dx.hypot(dy);
            let heading = dy.atan2(dx);
            let mut s = r.random_range(0.0..gap_m);
            while s < length {
                let lane = -1.6 + r.random_range(-0.4..0.4);
                let p = [
                    w[0][0] + dx / length * s - heading.sin() * lane,
                    w[0][1] + dy / length * s + heading.cos() * lane,
                ];
                let yaw = heading + r.random_range(-0.05..0.05);
                let turn = hachi_hal::Rotation::from_euler_angles(
                    r.random_range(-0.008..0.008),
                    r.random_range(-0.012..0.012),
                    yaw,
                );
                let points = scan(&scene, [p[0], p[1], 1.73], turn, level, hdl, &mut r);
                let mut levelled = Vec::new();
                leveller.level(&points, None, &mut levelled);
                out.push(Keyframe {
                    position: [p[0], p[1], 1.73],
                    heading_rad: yaw,
                    points: levelled,
                });
                s += gap_m;
            }
        }
    }
    let _ = PI;
    out
}

fn scan(
    scene: &Scene,
    from: [f64; 3],
    turn: hachi_hal::Rotation,
    level: Level,
    hdl: bool,
    r: &mut ChaCha8Rng,
) -> Vec<[f32; 4]> {
    let (beams, low, high, steps) = if hdl {
        (64, -24.8f64, 2.0f64, 360)
    } else {
        (16, -15.0, 15.0, 900)
    };
    let mut out = Vec::new();
    for a in 0..steps {
        let azimuth = f64::from(a) / f64::from(steps) * TAU;
        for e in 0..beams {
            let elevation = (low + (high - low) * f64::from(e) / f64::from(beams - 1)).to_radians();
            let local = Vector3::new(
                elevation.cos() * azimuth.cos(),
                elevation.cos() * azimuth.sin(),
                elevation.sin(),
            );
            let Some(d) = scene.distance(Vector3::from(from), turn * local, 100.0) else {
                continue;
            };
            let noise: f64 = (0..12).map(|_| r.random::<f64>()).sum::<f64>() - 6.0;
            let d = if r.random::<f64>() < level.outliers {
                r.random_range(1.0..80.0)
            } else {
                d + noise * level.range_sigma_m
            };
            let p = local * d;
            out.push([p.x as f32, p.y as f32, p.z as f32, 0.0]);
        }
    }
    out
}
