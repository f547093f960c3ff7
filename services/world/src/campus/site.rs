//! Puts things on rolling ground: places are given relative to a corner of a lot, heights over the
//! ground at that place.

use crate::building::Side;
use crate::floor::Terrain;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;

/// What stands on the ground reaches this far into it, so that no gap opens on a slope, metres.
const SUNK_M: f64 = 0.6;
/// Longer things are put together from pieces that follow the ground, metres.
const PIECE_M: f64 = 4.0;

/// A lot, and the scene it is part of.
pub(super) struct Site<'a> {
    pub builder: &'a mut SceneBuilder,
    pub terrain: &'a Terrain,
    /// The lot's corner in the map.
    pub origin: [f64; 2],
}

impl Site<'_> {
    /// A place of the lot, in the map.
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.origin[0] + x, self.origin[1] + y]
    }

    /// The ground's height at a place.
    pub fn ground(&self, at: [f64; 2]) -> f64 {
        let [x, y] = self.place(at);
        self.terrain.height(x, y)
    }

    /// A box of edges `size` whose foot is `lift` over the ground; one without lift is sunk in.
    pub fn stand(&mut self, at: [f64; 2], size: [f64; 3], lift: f64, yaw: f64, material: Material) {
        let [x, y] = self.place(at);
        let ground = self.ground(at);
        let bottom = ground + if lift > 0.0 { lift } else { -SUNK_M };
        let top = ground + lift + size[2];
        self.builder.cuboid(
            [x, y, (bottom + top) / 2.0],
            [size[0], size[1], top - bottom],
            yaw,
            material,
        );
    }

    /// An upright cylinder from `lift` over the ground to `top` over it.
    pub fn pole(&mut self, at: [f64; 2], radius: f64, lift: f64, top: f64, material: Material) {
        let [x, y] = self.place(at);
        let ground = self.ground(at);
        let bottom = if lift > 0.0 { lift } else { -SUNK_M };
        let base = [x, y, ground + bottom];
        self.builder.cylinder(base, radius, top - bottom, material);
    }

    /// A ball whose middle is `height` over the ground at `foot`, and `aside` from there.
    pub fn ball(
        &mut self,
        foot: [f64; 2],
        aside: [f64; 2],
        height: f64,
        radius: f64,
        material: Material,
    ) {
        let [x, y] = self.place(foot);
        let z = self.ground(foot) + height;
        self.builder
            .ball([x + aside[0], y + aside[1], z], radius, material);
    }

    /// A strip from place to place whose upper face is `top` over the ground, in pieces that follow
    /// it; `height` deep, sunk in if it is as deep as it is high.
    pub fn strip(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        width: f64,
        [bottom, top]: [f64; 2],
        material: Material,
    ) {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let pieces = (length / PIECE_M).ceil().max(1.0);
        let bottom = if bottom > 0.0 { bottom } else { -SUNK_M };
        let station = |i: usize| {
            let share = i as f64 / pieces;
            let at = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            let [x, y] = self.place(at);
            [x, y, self.ground(at) + top]
        };
        let stations: Vec<[f64; 3]> = (0..=pieces as usize).map(station).collect();
        for pair in stations.windows(2) {
            let (width, height) = (width, top - bottom);
            self.builder.beam(pair[0], pair[1], width, height, material);
        }
    }

    /// A frame beside a line from `from` on, its `v` to the left or the right of it.
    pub fn side(&self, from: [f64; 2], along: [f64; 2], out: [f64; 2]) -> Side {
        Side {
            origin: self.place(from),
            along,
            out,
        }
    }

    /// Least and greatest height of the ground at the corners of a rectangle.
    pub fn span(&self, low: [f64; 2], size: [f64; 2]) -> [f64; 2] {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        let heights =
            corners.map(|[u, v]| self.ground([low[0] + u * size[0], low[1] + v * size[1]]));
        heights
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &h| {
                [low.min(h), high.max(h)]
            })
    }
}
