//! The half of the streets around a block: kerbs, parked cars, trees, lamps, benches, shelters.
//!
//! In: the block's size, from the middle of one street to the middle of the next. Out: objects
//! between the lane that the robot keeps to and the lot.

use std::f64::consts::FRAC_PI_2;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::greenery::{bush, conifer, hedge, tree};
use super::site::Site;
use crate::material::Material;

/// From the middle of a street to its kerb, metres.
pub(super) const KERB_M: f64 = 4.2;
/// From the middle of a street to the lots beside it, metres.
pub(super) const LOT_M: f64 = 6.8;
/// Nothing stands in the street nearer to a crossing than this, metres: robots round the corners.
const CROSSING_M: f64 = 16.0;
/// Nothing stands behind the kerb nearer to a crossing than this where there are gates, metres.
const GATE_M: f64 = 20.0;
/// How high a kerb is, metres.
const KERB_HEIGHT_M: f64 = 0.13;
/// A street sign's face.
const SIGN: Material = Material::SIGN;

/// One side of a block: `u` along it from crossing to crossing, `v` from the middle of the street
/// to the lot.
#[derive(Clone, Copy)]
struct Edge {
    size: [f64; 2],
    index: usize,
}

impl Edge {
    fn length(&self) -> f64 {
        self.size[self.index % 2]
    }

    fn at(&self, u: f64, v: f64) -> [f64; 2] {
        let [w, h] = self.size;
        [[u, v], [w - v, u], [w - u, h - v], [v, h - u]][self.index]
    }

    fn heading(&self) -> f64 {
        FRAC_PI_2 * self.index as f64
    }
}

/// What stands along the four sides of a block. With `gates`, a footpath leads into the block from
/// its first crossing and out at the opposite one.
pub(super) fn streets(site: &mut Site<'_>, size: [f64; 2], gates: bool, random: &mut ChaCha8Rng) {
    for index in 0..4 {
        let edge = Edge { size, index };
        kerb(site, edge, gates && index % 2 == 1);
        parked_cars(site, edge, random);
        verge(site, edge, if gates { GATE_M } else { LOT_M }, random);
        lamps(site, edge, random);
        corner(site, edge, random);
    }
}

fn kerb(site: &mut Site<'_>, edge: Edge, gate: bool) {
    let height = [0.0, KERB_HEIGHT_M];
    let end = edge.length() - LOT_M;
    let (from, to) = (edge.at(LOT_M, KERB_M), edge.at(end, KERB_M));
    site.strip(from, to, 0.15, height, Material::CONCRETE);
    if !gate {
        // Cut across the corner to where the next side's kerb begins.
        let next = edge.at(edge.length() - KERB_M, LOT_M);
        site.strip(to, next, 0.15, height, Material::CONCRETE);
    }
}

fn parked_cars(site: &mut Site<'_>, edge: Edge, random: &mut ChaCha8Rng) {
    let share = if random.random_bool(0.6) {
        random.random_range(0.25..0.85)
    } else {
        0.0
    };
    let mut u = CROSSING_M;
    while u < edge.length() - CROSSING_M - 5.0 {
        let length = random.random_range(3.6..4.9);
        if random.random_bool(share) {
            let at = edge.at(u + length / 2.0, KERB_M - 1.1);
            car(site, at, length, edge.heading(), random);
        }
        u += length + random.random_range(0.6..2.4);
    }
}

/// A parked car, or a van.
pub(super) fn car(
    site: &mut Site<'_>,
    at: [f64; 2],
    length: f64,
    heading: f64,
    random: &mut ChaCha8Rng,
) {
    let paint = Material::rough([0.08, 0.25, 0.4, 0.6][random.random_range(0..4)]);
    let yaw = heading + random.random_range(-0.03..0.03);
    let (sin, cos) = yaw.sin_cos();
    let ahead = |s: f64, l: f64| [at[0] + s * cos - l * sin, at[1] + s * sin + l * cos];
    let width = random.random_range(1.6..1.8);
    let van = random.random_bool(0.15);
    let body = if van {
        1.75
    } else {
        random.random_range(0.5..0.7)
    };
    site.stand(at, [length, width, body], 0.25, yaw, paint);
    if !van {
        let back = random.random_range(-0.45..-0.1);
        let cabin = [length * 0.52, width - 0.16, 0.55];
        site.stand(
            ahead(back, 0.0),
            cabin,
            0.25 + body,
            yaw,
            Material::smooth(0.12),
        );
        let roof = [length * 0.44, width - 0.24, 0.06];
        site.stand(ahead(back, 0.0), roof, 0.8 + body, yaw, paint);
    }
    for axle in [-0.3, 0.3] {
        let wheels = [0.6, width - 0.04, 0.6];
        site.stand(ahead(axle * length, 0.0), wheels, 0.02, yaw, Material::DARK);
    }
    let (plate, out) = ([0.02, 0.5, 0.11], length / 2.0 + 0.01);
    for end in [-out, out] {
        site.stand(ahead(end, 0.0), plate, 0.45, yaw, SIGN);
    }
}

/// Between kerb and lot: trees, bushes, benches, bins, a shelter, a wall or hedge behind.
fn verge(site: &mut Site<'_>, edge: Edge, ends: f64, random: &mut ChaCha8Rng) {
    let length = edge.length();
    let trees = random.random_range(0..4);
    let spacing = random.random_range(8.0..15.0);
    let mut u = ends + random.random_range(1.0..6.0);
    while u < length - ends - 2.0 {
        let at = edge.at(u, KERB_M + 0.9);
        match (trees, random.random_range(0..10)) {
            (0, 0..=3) => bush(site, edge.at(u, LOT_M - 0.4), random),
            (1, 0..=7) => tree(site, at, random),
            (2, 0..=6) => conifer(site, edge.at(u, LOT_M + 0.2), random),
            (3, 0..=2) => tree(site, edge.at(u, LOT_M - 0.3), random),
            (_, 8) => bench(site, edge, u),
            (_, 9) => site.pole(edge.at(u, KERB_M + 1.2), 0.22, 0.0, 0.9, Material::METAL),
            _ => {}
        }
        u += spacing * random.random_range(0.6..1.4);
    }
    if random.random_bool(0.25) {
        shelter(site, edge, random);
    }
    if random.random_bool(0.4) {
        let reach = (length - 2.0 * ends) * 0.3;
        let from = ends + random.random_range(1.0..reach);
        let to = length - ends - random.random_range(1.0..reach);
        let gap = (from + to) / 2.0;
        for [from, to] in [[from, gap - 1.5], [gap + 1.5, to]] {
            hedge(
                site,
                edge.at(from, LOT_M + 0.1),
                edge.at(to, LOT_M + 0.1),
                random,
            );
        }
    }
}

fn bench(site: &mut Site<'_>, edge: Edge, u: f64) {
    let yaw = edge.heading();
    let at = edge.at(u, KERB_M + 1.5);
    site.stand(at, [1.6, 0.45, 0.06], 0.40, yaw, Material::WOOD);
    site.stand(
        edge.at(u, KERB_M + 1.72),
        [1.6, 0.06, 0.45],
        0.5,
        yaw,
        Material::WOOD,
    );
    for end in [-0.65, 0.65] {
        site.stand(
            edge.at(u + end, KERB_M + 1.5),
            [0.08, 0.4, 0.4],
            0.0,
            yaw,
            Material::METAL,
        );
    }
}

/// Panes on three sides, a roof, a seat.
fn shelter(site: &mut Site<'_>, edge: Edge, random: &mut ChaCha8Rng) {
    let u = random.random_range(0.3..0.6) * edge.length();
    let yaw = edge.heading();
    let back = KERB_M + 2.1;
    site.stand(
        edge.at(u, back - 0.7),
        [4.2, 1.6, 0.1],
        2.4,
        yaw,
        Material::METAL,
    );
    for end in [-2.0, 2.0] {
        site.stand(
            edge.at(u + end, back),
            [0.08, 0.08, 2.4],
            0.0,
            yaw,
            Material::METAL,
        );
        site.stand(
            edge.at(u + end, back - 0.6),
            [0.01, 1.0, 1.9],
            0.2,
            yaw,
            Material::CLEAR_GLASS,
        );
    }
    site.stand(
        edge.at(u, back),
        [4.0, 0.01, 1.9],
        0.2,
        yaw,
        Material::CLEAR_GLASS,
    );
    site.stand(
        edge.at(u, back - 0.3),
        [2.6, 0.35, 0.05],
        0.45,
        yaw,
        Material::WOOD,
    );
}

fn lamps(site: &mut Site<'_>, edge: Edge, random: &mut ChaCha8Rng) {
    let spacing = random.random_range(18.0..30.0);
    let height = random.random_range(4.5..7.5);
    let mut u = LOT_M + random.random_range(2.0..10.0);
    while u < edge.length() - LOT_M {
        let v = KERB_M + 0.35;
        site.pole(edge.at(u, v), 0.08, 0.0, height, Material::METAL);
        let head = edge.at(u, v - 0.6);
        site.stand(
            head,
            [0.3, 1.4, 0.12],
            height,
            edge.heading(),
            Material::METAL,
        );
        u += spacing;
    }
}

/// A street sign, a box of switches or bollards at the corner before the next side.
fn corner(site: &mut Site<'_>, edge: Edge, random: &mut ChaCha8Rng) {
    let u = edge.length() - LOT_M - random.random_range(0.5..3.0);
    let at = edge.at(u, KERB_M + 0.5);
    match random.random_range(0..4) {
        0 => {
            site.pole(at, 0.04, 0.0, 2.9, Material::METAL);
            site.stand(at, [0.6, 0.1, 0.6], 2.2, edge.heading() + FRAC_PI_2, SIGN);
        }
        1 => site.stand(at, [1.1, 0.4, 1.3], 0.0, edge.heading(), Material::METAL),
        2 => {
            for step in 0..4 {
                let at = edge.at(u - 1.4 * f64::from(step), KERB_M + 0.5);
                site.pole(at, 0.09, 0.0, 0.95, Material::METAL);
            }
        }
        _ => {}
    }
}
