//! Parts that buildings are made of, and the buildings.
//!
//! In: a builder and a seeded generator. Out: walls with openings, doors, rows of rooms, corridors
//! in the builder's scene. Elsewhere: what stands in the rooms (`furniture`).

mod furniture;
mod glass;
mod office;
mod passers;
mod ring;
mod rooms;
mod storey;

pub(crate) use glass::glass_corridor;
pub(crate) use office::{office, office_people};
pub(crate) use storey::storey;

use crate::material::Material;
use crate::scene::ObjectId;
use crate::scene_builder::SceneBuilder;

/// Thickness of inner walls, metres.
pub(crate) const WALL_M: f64 = 0.12;
/// Height of doors, metres.
pub(crate) const DOOR_HEIGHT_M: f64 = 2.1;
/// Width of doors, metres.
pub(crate) const DOOR_WIDTH_M: f64 = 1.0;

/// A frame beside a wall: `u` runs along it, `v` away from it into what lies behind, both metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    pub origin: [f64; 2],
    pub along: [f64; 2],
    /// Across, a unit vector perpendicular to `along`, to its left or right.
    pub out: [f64; 2],
}

impl Side {
    /// The place at `u`, `v`, in the map.
    pub fn place(&self, u: f64, v: f64) -> [f64; 2] {
        [
            self.origin[0] + u * self.along[0] + v * self.out[0],
            self.origin[1] + u * self.along[1] + v * self.out[1],
        ]
    }

    /// The heading of `along`, radians.
    pub fn heading(&self) -> f64 {
        self.along[1].atan2(self.along[0])
    }

    /// A box between two corners, `[u, v, z]`.
    pub fn block(
        &self,
        builder: &mut SceneBuilder,
        low: [f64; 3],
        high: [f64; 3],
        material: Material,
    ) -> ObjectId {
        let [x, y] = self.place((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0);
        builder.cuboid(
            [x, y, (low[2] + high[2]) / 2.0],
            [high[0] - low[0], high[1] - low[1], high[2] - low[2]],
            self.heading(),
            material,
        )
    }

    /// A wall from `u` to `u`, its near face at `v`, with openings in ascending order.
    pub fn wall(
        &self,
        builder: &mut SceneBuilder,
        [from, to]: [f64; 2],
        v: f64,
        height: f64,
        openings: &[Opening],
    ) {
        let mut piece = |u: [f64; 2], z: [f64; 2]| {
            if u[1] - u[0] > 1e-6 && z[1] - z[0] > 1e-6 {
                let (low, high) = ([u[0], v, z[0]], [u[1], v + WALL_M, z[1]]);
                self.block(builder, low, high, Material::WALL);
            }
        };
        let mut at = from;
        for opening in openings {
            piece([at, opening.from], [0.0, height]);
            piece([opening.from, opening.to], [0.0, opening.bottom]);
            piece([opening.from, opening.to], [opening.top, height]);
            at = opening.to;
        }
        piece([at, to], [0.0, height]);
    }
}

/// A hole in a wall, metres along it and over the floor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Opening {
    pub from: f64,
    pub to: f64,
    pub bottom: f64,
    pub top: f64,
}

impl Opening {
    /// A door around `centre`.
    pub fn door(centre: f64) -> Self {
        Self {
            from: centre - DOOR_WIDTH_M / 2.0,
            to: centre + DOOR_WIDTH_M / 2.0,
            bottom: 0.0,
            top: DOOR_HEIGHT_M,
        }
    }
}
