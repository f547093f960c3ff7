//! What stands in rooms and corridors.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Side;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;

/// A rectangle on the floor, in the coordinates of a [`Side`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl Area {
    fn around(u: f64, v: f64, size: [f64; 2]) -> Self {
        Self {
            low: [u - size[0] / 2.0, v - size[1] / 2.0],
            high: [u + size[0] / 2.0, v + size[1] / 2.0],
        }
    }

    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] < other.high[axis] && other.low[axis] < self.high[axis])
    }
}

#[derive(Debug, Clone, Copy)]
enum Piece {
    Desk,
    Shelf,
    Cabinet,
    Plant,
    Boxes,
    Sofa,
}

const PIECES: [Piece; 8] = [
    Piece::Desk,
    Piece::Desk,
    Piece::Desk,
    Piece::Shelf,
    Piece::Cabinet,
    Piece::Plant,
    Piece::Boxes,
    Piece::Sofa,
];

impl Piece {
    /// Width and depth of the floor it takes, metres; a desk's includes its chair.
    fn size(self) -> [f64; 2] {
        match self {
            Self::Desk => [1.5, 1.4],
            Self::Shelf => [1.0, 0.35],
            Self::Cabinet => [0.6, 0.5],
            Self::Plant => [0.6, 0.6],
            Self::Boxes => [0.7, 0.6],
            Self::Sofa => [1.6, 0.8],
        }
    }

    /// Whether it stands with its back to a wall.
    fn by_the_wall(self) -> bool {
        matches!(self, Self::Shelf | Self::Cabinet | Self::Sofa)
    }

    fn put(self, builder: &mut SceneBuilder, side: &Side, u: f64, v: f64, random: &mut ChaCha8Rng) {
        let mut block = |low: [f64; 3], size: [f64; 3], material| {
            let low = [u + low[0], v + low[1], low[2]];
            let high = [low[0] + size[0], low[1] + size[1], low[2] + size[2]];
            side.block(builder, low, high, material);
        };
        match self {
            Self::Desk => {
                block([-0.75, -0.1, 0.71], [1.5, 0.75, 0.03], Material::WOOD);
                for x in [-0.75, 0.70] {
                    block([x, -0.1, 0.0], [0.05, 0.75, 0.71], Material::METAL);
                }
                block([-0.3, 0.4, 0.84], [0.6, 0.04, 0.36], Material::CLOTH);
                // The chair, pushed back a little.
                let back = -0.70 + random.random_range(0.0..0.15);
                block([-0.22, back, 0.43], [0.44, 0.44, 0.06], Material::CLOTH);
                block([-0.20, back, 0.49], [0.40, 0.05, 0.50], Material::CLOTH);
                for (x, y) in [(-0.21, 0.0), (0.17, 0.0), (-0.21, 0.39), (0.17, 0.39)] {
                    block([x, back + y, 0.0], [0.04, 0.04, 0.43], Material::METAL);
                }
            }
            Self::Shelf => {
                let height = random.random_range(1.6..2.1);
                block([-0.5, 0.14, 0.0], [1.0, 0.03, height], Material::WOOD);
                for x in [-0.5, 0.47] {
                    block([x, -0.17, 0.0], [0.03, 0.31, height], Material::WOOD);
                }
                let mut z = 0.1;
                while z < height {
                    block([-0.47, -0.17, z], [0.94, 0.31, 0.03], Material::WOOD);
                    let filled = random.random_range(0.2..0.9);
                    block(
                        [-0.47, -0.1, z + 0.03],
                        [filled, 0.22, 0.24],
                        Material::CLOTH,
                    );
                    z += 0.38;
                }
            }
            Self::Cabinet => {
                let height = random.random_range(0.8..1.4);
                block([-0.3, -0.25, 0.0], [0.6, 0.5, height], Material::METAL);
            }
            Self::Plant => {
                let [x, y] = side.place(u, v);
                builder.cylinder([x, y, 0.0], 0.18, 0.4, Material::CONCRETE);
                builder.cylinder([x, y, 0.4], 0.03, 0.4, Material::WOOD);
                builder.cylinder([x, y, 0.8], 0.28, 0.7, Material::rough(0.4));
            }
            Self::Boxes => {
                block([-0.35, -0.3, 0.0], [0.6, 0.5, 0.4], Material::WOOD);
                let turned = random.random_range(-0.4..0.4);
                let [x, y] = side.place(u - 0.03, v - 0.02);
                let yaw = side.heading() + turned;
                builder.cuboid([x, y, 0.55], [0.4, 0.35, 0.3], yaw, Material::WOOD);
            }
            Self::Sofa => {
                block([-0.8, -0.4, 0.1], [1.6, 0.8, 0.33], Material::CLOTH);
                block([-0.8, 0.2, 0.43], [1.6, 0.2, 0.4], Material::CLOTH);
            }
        }
    }
}

/// Furnishes a room, leaving `free` areas empty.
pub(crate) fn furnish(
    builder: &mut SceneBuilder,
    side: &Side,
    room: Area,
    free: &[Area],
    random: &mut ChaCha8Rng,
) {
    let mut taken: Vec<Area> = free.to_vec();
    let floor = (room.high[0] - room.low[0]) * (room.high[1] - room.low[1]);
    let wanted = (floor / 4.0) as usize;
    let mut stand = 0;
    for _ in 0..6 * wanted {
        if stand == wanted {
            break;
        }
        let piece = PIECES[random.random_range(0..PIECES.len())];
        let size = piece.size();
        let margin = [size[0] / 2.0 + 0.05, size[1] / 2.0 + 0.05];
        let span = [0, 1].map(|axis| {
            (
                room.low[axis] + margin[axis],
                room.high[axis] - margin[axis],
            )
        });
        if span.iter().any(|(low, high)| high <= low) {
            continue;
        }
        let u = random.random_range(span[0].0..span[0].1);
        let v = if piece.by_the_wall() {
            span[1].1
        } else {
            random.random_range(span[1].0..span[1].1)
        };
        let area = Area::around(u, v, size);
        if taken.iter().any(|other| other.meets(&area)) {
            continue;
        }
        piece.put(builder, side, u, v, random);
        taken.push(area);
        stand += 1;
    }
}

/// Puts something small beside a corridor's wall; the robot keeps to the middle. `u` is along the
/// wall and the corridor lies at negative `v`.
pub(crate) fn wall_feature(
    builder: &mut SceneBuilder,
    side: &Side,
    u: f64,
    ceiling: f64,
    random: &mut ChaCha8Rng,
) {
    match random.random_range(0..6) {
        0 | 1 => {
            let (low, high) = ([u - 0.2, -0.25, 0.0], [u + 0.2, 0.0, ceiling]);
            side.block(builder, low, high, Material::CONCRETE);
        }
        2 => {
            let [x, y] = side.place(u, -0.12);
            builder.cylinder([x, y, 0.8], 0.08, 0.5, Material::METAL);
        }
        3 => {
            let [x, y] = side.place(u, -0.2);
            builder.cylinder([x, y, 0.0], 0.17, 0.65, Material::METAL);
        }
        4 => {
            let (low, high) = ([u - 0.6, -0.4, 0.38], [u + 0.6, 0.0, 0.44]);
            side.block(builder, low, high, Material::WOOD);
            for x in [u - 0.55, u + 0.5] {
                let (low, high) = ([x, -0.38, 0.0], [x + 0.05, -0.02, 0.38]);
                side.block(builder, low, high, Material::METAL);
            }
        }
        _ => {
            let (low, high) = ([u - 0.6, -0.03, 1.1], [u + 0.6, 0.0, 2.0]);
            side.block(builder, low, high, Material::WOOD);
        }
    }
}
