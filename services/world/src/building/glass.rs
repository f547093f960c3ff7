//! A building whose long corridors have glass on both sides: rooms, dark facades and the open air
//! lie behind, and the opposite side of the corridor stands mirrored in the panes. Here and there
//! the floor is wet, and mirrors what stands on it.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::furniture::{Area, furnish, wall_feature};
use super::ring::Ring;
use super::{Side, WALL_M};
use crate::material::Material;
use crate::preset::World;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// The panes begin and end at these heights, metres.
const PANE_M: [f64; 2] = [0.06, 2.5];
/// How deep what lies behind the outer panes is, metres.
const DEPTH_M: f64 = 4.0;

/// The glass corridor of a seed, with a robot that walks around it.
pub(crate) fn glass_corridor(random: &mut ChaCha8Rng, gait: Gait) -> World {
    let ring = Ring {
        low: [-3.0, 0.0],
        high: [
            random.random_range(17.0..20.0),
            random.random_range(9.0..10.0),
        ],
        half_width: 1.2,
        ceiling: random.random_range(2.7..3.0),
    };
    let mut builder = SceneBuilder::new();
    ring.floor_and_ceiling(&mut builder, Material::FLOOR, 12.0);
    wet_patches(&mut builder, &ring, random);
    let inner_depth = (ring.length(1) - 2.0 * ring.half_width - WALL_M) / 2.0;
    for i in 0..4 {
        let (outer, inner) = (ring.outer(i), ring.inner(i));
        let outer_span = [0.0, ring.length(i) + 2.0 * ring.half_width];
        let inner_span = [0.0, ring.length(i) - 2.0 * ring.half_width];
        if i % 2 == 0 {
            let corridor = [ring.half_width, outer_span[1] - ring.half_width];
            for end in [
                [outer_span[0] - WALL_M, corridor[0]],
                [corridor[1], outer_span[1] + WALL_M],
            ] {
                outer.wall(&mut builder, end, 0.0, ring.ceiling, &[]);
            }
            glass_front(&mut builder, &outer, corridor, ring.ceiling, random);
            behind(
                &mut builder,
                &outer,
                corridor,
                DEPTH_M,
                ring.ceiling,
                random,
            );
            glass_front(&mut builder, &inner, inner_span, ring.ceiling, random);
            behind(
                &mut builder,
                &inner,
                inner_span,
                inner_depth,
                ring.ceiling,
                random,
            );
        } else {
            let outer_span = [outer_span[0] - WALL_M, outer_span[1] + WALL_M];
            for (side, span) in [(&outer, outer_span), (&inner, inner_span)] {
                side.wall(&mut builder, span, 0.0, ring.ceiling, &[]);
                let mut u = span[0] + 1.5;
                while u < span[1] - 1.0 {
                    wall_feature(&mut builder, side, u, ring.ceiling, random);
                    u += random.random_range(1.6..2.8);
                }
            }
        }
    }
    let scene = builder.build();
    let [c0, c1, c2, c3] = ring.corners();
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
        .stand(1.0)
        .walk(&[c1, c2, c3, c0, [0.0, 0.0]])
        .build(scene.floor().clone())
        .expect("the walk ends at the start, along the first side");
    World { scene, trajectory }
}

/// One on each of the long sides, as wide as the corridor, 1 mm over the floor.
fn wet_patches(builder: &mut SceneBuilder, ring: &Ring, random: &mut ChaCha8Rng) {
    for y in [ring.low[1], ring.high[1]] {
        let x = random.random_range(ring.low[0] + 3.0..ring.high[0] - 6.0);
        let length = random.random_range(2.0..3.5);
        builder.floor_slab(
            [x, y - ring.half_width],
            [x + length, y + ring.half_width],
            0.001,
            Material::POLISHED_FLOOR,
        );
    }
}

/// Panes between posts, here and there a bay of wall.
fn glass_front(
    builder: &mut SceneBuilder,
    side: &Side,
    [from, to]: [f64; 2],
    ceiling: f64,
    random: &mut ChaCha8Rng,
) {
    let bays = ((to - from) / 2.2).round().max(1.0);
    let width = (to - from) / bays;
    let (low, high) = ([from, 0.0, PANE_M[1]], [to, WALL_M, ceiling]);
    side.block(builder, low, high, Material::WALL);
    let (low, high) = ([from, 0.02, 0.0], [to, WALL_M - 0.02, PANE_M[0]]);
    side.block(builder, low, high, Material::METAL);
    let mut u = from;
    for bay in 0..bays as usize {
        let post = ([u - 0.04, -0.03, 0.0], [u + 0.04, WALL_M, PANE_M[1]]);
        side.block(builder, post.0, post.1, Material::METAL);
        // The first bay is always glass; about one in six of the others is wall.
        if bay > 0 && random.random_bool(0.16) {
            let (low, high) = ([u, 0.0, 0.0], [u + width, WALL_M, PANE_M[1]]);
            side.block(builder, low, high, Material::WALL);
        } else {
            builder.pane(
                side.place(u, WALL_M / 2.0),
                side.place(u + width, WALL_M / 2.0),
                PANE_M[0],
                PANE_M[1],
                Material::COATED_GLASS,
            );
        }
        u += width;
    }
    let post = ([u - 0.04, -0.03, 0.0], [u + 0.04, WALL_M, PANE_M[1]]);
    side.block(builder, post.0, post.1, Material::METAL);
}

/// What lies behind the panes, section by section: a furnished room, a dark facade or nothing.
fn behind(
    builder: &mut SceneBuilder,
    side: &Side,
    [from, to]: [f64; 2],
    depth: f64,
    ceiling: f64,
    random: &mut ChaCha8Rng,
) {
    let sections = ((to - from) / 4.4).round().max(1.0);
    let width = (to - from) / sections;
    for section in 0..=sections as usize {
        let u = from + width * section as f64;
        let (low, high) = ([u - 0.06, WALL_M, 0.0], [u + 0.06, depth, ceiling]);
        side.block(builder, low, high, Material::WALL);
        if section == sections as usize {
            break;
        }
        let back = |builder: &mut SceneBuilder, v: f64, material| {
            let (low, high) = ([u, v, 0.0], [u + width, v + WALL_M, ceiling]);
            side.block(builder, low, high, material);
        };
        match random.random_range(0..6) {
            0 | 1 => {
                back(builder, depth, Material::WALL);
                let room = Area {
                    low: [u + 0.1, WALL_M + 0.1],
                    high: [u + width - 0.1, depth],
                };
                furnish(builder, side, room, &[], random);
            }
            2..=4 => back(builder, (depth * 0.8).min(2.8), Material::DARK),
            _ => {}
        }
    }
}
