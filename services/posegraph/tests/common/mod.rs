//! Graphs with known truth.
#![allow(dead_code, reason = "each test file uses its own part")]

use hachi_posegraph::{Dense, Factor, Graph, Group, Isam2, Se2, Se3};
use nalgebra::{DMatrix, UnitQuaternion, Vector3};

/// Numbers that look random and are always the same.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal, of standard deviation one.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }
}

/// A group in which a walk on a grid can be drawn.
pub trait Walk: Group {
    fn at(x: f64, y: f64, heading: f64) -> Self;
}

impl Walk for Se2 {
    fn at(x: f64, y: f64, heading: f64) -> Self {
        Self::new(x, y, heading)
    }
}

impl Walk for Se3 {
    fn at(x: f64, y: f64, heading: f64) -> Self {
        let rotation = UnitQuaternion::from_euler_angles(0.1 * x.sin(), 0.1 * y.cos(), heading);
        Self::new(Vector3::new(x, y, 0.2 * (x + y).sin()), rotation)
    }
}

/// The true poses of a walk that turns now and then and comes back to where it was.
pub fn truth<G: Walk>(poses: usize, noise: &mut Noise) -> (Vec<G>, Vec<(i64, i64)>) {
    let (mut x, mut y, mut heading) = (0i64, 0i64, 0i64);
    let mut walk = Vec::new();
    let mut cells = Vec::new();
    for _ in 0..poses {
        walk.push(G::at(
            x as f64,
            y as f64,
            heading as f64 * std::f64::consts::FRAC_PI_2,
        ));
        cells.push((x, y));
        if noise.uniform() < 0.3 {
            heading += if noise.uniform() < 0.5 { 1 } else { -1 };
        }
        let (dx, dy) = [(1, 0), (0, 1), (-1, 0), (0, -1)][heading.rem_euclid(4) as usize];
        x += dx;
        y += dy;
    }
    (walk, cells)
}

/// A graph of that walk: a prior, noisy odometry, a noisy loop wherever a cell is entered again;
/// initial poses from odometry. Its noise is that of the information, which is a multiple of one.
pub fn grid_walk<G: Walk>(poses: usize, noise: &mut Noise, information: G::Matrix) -> Graph<G> {
    let (walk, cells) = truth::<G>(poses, noise);
    let sigma = 1.0 / information.numbers()[0].sqrt();
    let mut measured = |a: &G, b: &G| {
        let mut off = G::Tangent::zeros();
        let numbers = off.numbers_mut().iter_mut();
        numbers.for_each(|v| *v = sigma * noise.normal());
        a.between(b).retract(&off)
    };
    let mut graph = Graph::new();
    let mut pose = walk[0];
    graph.insert(0, pose).unwrap();
    graph.add(Factor::prior(0, pose, information)).unwrap();
    for k in 1..poses {
        let step = measured(&walk[k - 1], &walk[k]);
        pose = pose.compose(&step);
        let key = k as u64;
        graph.insert(key, pose).unwrap();
        let edge = Factor::between(key - 1, key, step, information);
        graph.add(edge).unwrap();
        if let Some(before) = (0..k.saturating_sub(5)).find(|&b| cells[b] == cells[k]) {
            let seen = measured(&walk[before], &walk[k]);
            let edge = Factor::loop_closure(before as u64, key, seen, information);
            graph.add(edge).unwrap();
        }
    }
    graph
}

/// The largest difference between the poses of two solutions.
pub fn step_sizes<G: Group>(isam: &Isam2<G>, graph: &Graph<G>) -> f64 {
    let off = graph.poses().map(|(key, pose)| {
        let step = isam.estimate(key).unwrap().local(pose);
        step.numbers().iter().fold(0.0, |m: f64, v| m.max(v.abs()))
    });
    off.fold(0.0, f64::max)
}

/// `J' W J` of all factors at the estimates, by numeric differentiation of their residuals.
pub fn dense_information<G: Group>(isam: &Isam2<G>) -> DMatrix<f64> {
    let d = G::DIM;
    let n = isam.len() * d;
    let mut sum = DMatrix::zeros(n, n);
    let index = |key: u64| isam.estimates().position(|(k, _)| k == key).unwrap();
    for (_, factor) in isam.factors() {
        let ends = [factor.from(), factor.to()];
        let poses = ends.map(|key| isam.estimate(key).unwrap());
        let mut jacobian = DMatrix::zeros(d, n);
        for (side, key) in ends.iter().enumerate() {
            if side == 0 && ends[0] == ends[1] {
                continue;
            }
            for k in 0..d {
                let moved = |by: f64| {
                    let mut step = G::Tangent::zeros();
                    step.numbers_mut()[k] = by;
                    let mut poses = poses;
                    poses[side] = poses[side].retract(&step);
                    factor.residual(&poses[0], &poses[1])
                };
                let h = 1e-5;
                let (plus, minus) = (moved(h), moved(-h));
                for r in 0..d {
                    jacobian[(r, index(*key) * d + k)] =
                        (plus.numbers()[r] - minus.numbers()[r]) / (2.0 * h);
                }
            }
        }
        let information = DMatrix::from_column_slice(d, d, factor.information().numbers());
        sum += jacobian.transpose() * information * &jacobian;
    }
    sum
}
