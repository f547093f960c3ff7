//! Small worlds of points for the tests: rooms of a seed, seen from where the robot stands.

#![allow(dead_code, reason = "each test file uses its own part of it")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A yard of a seed: ground, walls around it at uneven distances, pillars and boxes in it; heights
/// from the ground, the robot at the origin, looking along x.
pub fn room(seed: u64) -> Vec<[f32; 4]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    // A wall in 12 pieces, each of its own distance and height.
    for piece in 0..12 {
        let (distance, height) = (
            random.random_range(12.0..45.0f32),
            random.random_range(2.0..12.0f32),
        );
        for i in 0..120 {
            let angle = (piece as f32 + i as f32 / 120.0) / 12.0 * std::f32::consts::TAU;
            for level in 0..12 {
                let z = height * level as f32 / 11.0;
                points.push([distance * angle.cos(), distance * angle.sin(), z, 60.0]);
            }
        }
    }
    for _ in 0..30 {
        let (x, y) = (
            random.random_range(-30.0..30.0f32),
            random.random_range(-30.0..30.0f32),
        );
        let (size, height) = (
            random.random_range(0.3..1.5f32),
            random.random_range(0.5..5.0f32),
        );
        let intensity = random.random_range(5.0..200.0f32);
        for _ in 0..150 {
            points.push([
                x + size * random.random_range(-1.0..1.0f32),
                y + size * random.random_range(-1.0..1.0f32),
                height * random.random::<f32>(),
                intensity,
            ]);
        }
    }
    for _ in 0..3000 {
        let (range, angle) = (
            random.random_range(2.0..20.0f32),
            random.random_range(0.0..std::f32::consts::TAU),
        );
        points.push([range * angle.cos(), range * angle.sin(), 0.0, 20.0]);
    }
    points
}

/// The cloud turned about z.
pub fn turned(points: &[[f32; 4]], yaw: f32) -> Vec<[f32; 4]> {
    let (sin, cos) = yaw.sin_cos();
    points
        .iter()
        .map(|&[x, y, z, i]| [cos * x - sin * y, sin * x + cos * y, z, i])
        .collect()
}

/// The cloud as seen from a place `(x, y)` of its own frame, the robot facing along `yaw` there.
pub fn seen_from(points: &[[f32; 4]], x: f32, y: f32, yaw: f32) -> Vec<[f32; 4]> {
    let moved: Vec<[f32; 4]> = points
        .iter()
        .map(|p| [p[0] - x, p[1] - y, p[2], p[3]])
        .collect();
    turned(&moved, -yaw)
}
