//! A corridor that runs around a rectangle: its sides, floor, ceiling and lamps.

use super::Side;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;

/// A rectangular corridor by its centre line, walked counter-clockwise from the first corner.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring {
    /// The corner with the least x and y.
    pub low: [f64; 2],
    /// The corner with the greatest x and y.
    pub high: [f64; 2],
    /// From the centre line to either wall, metres.
    pub half_width: f64,
    /// Height of the ceiling, metres.
    pub ceiling: f64,
}

impl Ring {
    /// The corners of the centre line; side `i` runs from corner `i` to the next.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }

    fn along(i: usize) -> [f64; 2] {
        [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][i % 4]
    }

    /// All the way round, metres.
    pub fn round_m(&self) -> f64 {
        2.0 * (self.length(0) + self.length(1))
    }

    /// How far along the centre line the place nearest to this one is, metres from the first corner.
    pub fn nearest(&self, [x, y]: [f64; 2]) -> f64 {
        let corners = self.corners();
        let mut begins_m = 0.0;
        let mut best = (f64::INFINITY, 0.0);
        for (i, corner) in corners.iter().enumerate() {
            let (along, length) = (Self::along(i), self.length(i));
            let to = [x - corner[0], y - corner[1]];
            let way = (to[0] * along[0] + to[1] * along[1]).clamp(0.0, length);
            let off = (to[0] - way * along[0]).hypot(to[1] - way * along[1]);
            if off < best.0 {
                best = (off, begins_m + way);
            }
            begins_m += length;
        }
        best.1
    }

    /// The way from one place to a further one, metres along the centre line, over the corners
    /// between them and so far to its left, metres.
    pub fn between(&self, from_m: f64, to_m: f64, left_m: f64) -> Vec<[f64; 2]> {
        let mut path = vec![self.place(from_m, left_m)];
        let round_m = self.round_m();
        let mut corner_m = (from_m / round_m).floor() * round_m;
        for i in 0.. {
            if corner_m >= to_m {
                break;
            }
            if corner_m > from_m {
                path.push(self.place(corner_m, left_m));
            }
            corner_m += self.length(i);
        }
        path.push(self.place(to_m, left_m));
        path
    }

    /// A place along the centre line and to its left.
    pub fn place(&self, way_m: f64, left_m: f64) -> [f64; 2] {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        let within = Self {
            low: [x0 + left_m, y0 + left_m],
            high: [x1 - left_m, y1 - left_m],
            ..*self
        };
        let mut left = way_m.rem_euclid(self.round_m());
        let mut side = 0;
        while side < 3 && left > self.length(side) {
            left -= self.length(side);
            side += 1;
        }
        let share = left / self.length(side);
        let corners = within.corners();
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    }

    /// From corner to corner, metres.
    pub fn length(&self, i: usize) -> f64 {
        let axis = i % 2;
        self.high[axis] - self.low[axis]
    }

    /// The wall outside side `i`; it is `length + 2 half_width` long.
    pub fn outer(&self, i: usize) -> Side {
        let (along, corner) = (Self::along(i), self.corners()[i % 4]);
        let out = [along[1], -along[0]];
        let w = self.half_width;
        Side {
            origin: [
                corner[0] + w * (out[0] - along[0]),
                corner[1] + w * (out[1] - along[1]),
            ],
            along,
            out,
        }
    }

    /// The wall inside side `i`; it is `length - 2 half_width` long.
    pub fn inner(&self, i: usize) -> Side {
        let (along, corner) = (Self::along(i), self.corners()[i % 4]);
        let out = [-along[1], along[0]];
        let w = self.half_width;
        Side {
            origin: [
                corner[0] + w * (out[0] + along[0]),
                corner[1] + w * (out[1] + along[1]),
            ],
            along,
            out,
        }
    }

    /// Floor and ceiling over the corridor and `beyond` metres outside it, and lamps along the
    /// corridor's ceiling.
    pub fn floor_and_ceiling(&self, builder: &mut SceneBuilder, floor: Material, beyond: f64) {
        let margin = self.half_width + beyond;
        let low = [self.low[0] - margin, self.low[1] - margin];
        let high = [self.high[0] + margin, self.high[1] + margin];
        builder.floor_slab(low, high, 0.0, floor);
        builder.cuboid(
            [
                (low[0] + high[0]) / 2.0,
                (low[1] + high[1]) / 2.0,
                self.ceiling + 0.1,
            ],
            [high[0] - low[0], high[1] - low[1], 0.2],
            0.0,
            Material::CEILING,
        );
        self.lamps(builder);
    }

    /// Lamps along the corridor's ceiling.
    pub fn lamps(&self, builder: &mut SceneBuilder) {
        for i in 0..4 {
            let side = self.inner(i);
            let lamps = (self.length(i) / 3.0) as usize;
            for lamp in 0..lamps {
                let u = 3.0 * lamp as f64;
                let v = -self.half_width;
                side.block(
                    builder,
                    [u, v - 0.1, self.ceiling - 0.08],
                    [u + 1.2, v + 0.1, self.ceiling],
                    Material::METAL,
                );
            }
        }
    }
}
