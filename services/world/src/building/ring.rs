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
