//! A storey with corridors on a grid: blocks of rooms between them, an open hall, and stretches
//! that look alike.
//!
//! In: a seed. Out: the scene, and a patrol of more than 300 m that comes back to corridors it
//! knows in the same and in the opposite direction. Elsewhere: rooms (`rooms`), what stands in
//! them (`furniture`).
//!
//! The first and the last column are furnished alike to the last chair, so a place in one is
//! told from its like in the other only by how the robot came there; and one corridor passes
//! cells of one pattern, as a hotel's does.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::furniture::{Area, furnish};
use super::ring::Ring;
use super::rooms::{CORNER_M, Row};
use super::{Side, WALL_M};
use crate::material::Material;
use crate::noise::{Purpose, generator};
use crate::preset::World;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// How deep the outer rooms are, metres.
const ROOM_DEPTH_M: f64 = 5.0;
/// Half the width of a corridor, metres.
const HALF_WIDTH_M: f64 = 1.1;
/// Width of a cell of the corridor of cells, metres.
const CELL_M: f64 = 3.6;
/// From the first corner to where the robot starts, metres.
const START_M: f64 = 4.0;
/// The blocks of the first and the last column share a pattern.
const PATTERN: [u64; 3] = [0, 1, 0];
/// Column and row of the open hall.
const HALL: [usize; 2] = [1, 1];
/// The column whose lower rows are cells.
const CELLS: usize = 1;

/// The patrol, from corner to corner: (column line, row line). It begins and ends on the first
/// row line after its first corner.
const PATROL: [[usize; 2]; 16] = [
    [3, 0],
    [3, 1],
    [0, 1],
    [0, 0],
    // Known from here on: the first loop closes.
    [1, 0],
    [1, 2],
    [3, 2],
    [3, 1],
    [2, 1],
    [2, 0],
    // Back along the first corridor, against the first direction.
    [0, 0],
    [0, 2],
    [1, 2],
    [1, 1],
    [0, 1],
    [0, 0],
];

/// The lines of the corridors.
struct Grid {
    columns: [f64; 4],
    rows: [f64; 3],
    ceiling: f64,
}

impl Grid {
    fn new(random: &mut ChaCha8Rng) -> Self {
        let outer = random.random_range(15.5..18.5);
        let middle = random.random_range(15.0..18.0);
        let rows = [
            random.random_range(11.0..12.5),
            random.random_range(11.0..12.5),
        ];
        let columns = [0.0, outer, outer + middle, 2.0 * outer + middle];
        Self {
            columns: columns.map(|x| x - START_M),
            rows: [0.0, rows[0], rows[0] + rows[1]],
            ceiling: random.random_range(2.6..2.9),
        }
    }

    fn corner(&self, [column, row]: [usize; 2]) -> [f64; 2] {
        [self.columns[column], self.rows[row]]
    }

    /// The corridors around the blocks from one corner to another.
    fn ring(&self, low: [usize; 2], high: [usize; 2]) -> Ring {
        Ring {
            low: self.corner(low),
            high: self.corner(high),
            half_width: HALF_WIDTH_M,
            ceiling: self.ceiling,
        }
    }
}

/// The storey of a seed, with a robot that patrols it.
pub(crate) fn storey(seed: u64, gait: Gait) -> World {
    let pattern = |index: u64| generator(seed, Purpose::Scene, 1 + index);
    let grid = Grid::new(&mut generator(seed, Purpose::Scene, 0));
    let whole = grid.ring([0, 0], [3, 2]);
    let mut builder = SceneBuilder::new();
    whole.floor_and_ceiling(&mut builder, Material::FLOOR, ROOM_DEPTH_M + 8.0);
    for (column, alike_to) in PATTERN.into_iter().enumerate() {
        for row in 0..2 {
            let block = grid.ring([column, row], [column + 1, row + 1]);
            block.lamps(&mut builder);
            let mut random = pattern(2 * alike_to + row as u64);
            if [column, row] == HALL {
                hall(&mut builder, &block, &mut random);
            } else {
                rooms(&mut builder, &block, column == CELLS, &mut random);
            }
        }
    }
    for i in 0..4 {
        outer_rooms(&mut builder, &grid, i, &pattern);
    }
    let scene = builder.build();
    let mut way: Vec<[f64; 2]> = PATROL.iter().map(|corner| grid.corner(*corner)).collect();
    way.push([0.0, 0.0]);
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
        .stand(1.0)
        .walk(&way)
        .build(scene.floor().clone())
        .expect("the walk ends at the start, along the first corridor");
    World { scene, trajectory }
}

/// A block of rooms, doors to the corridors below and above it.
fn rooms(builder: &mut SceneBuilder, block: &Ring, cells: bool, random: &mut ChaCha8Rng) {
    let depth = (block.length(1) - 2.0 * block.half_width - WALL_M) / 2.0;
    for i in 0..4 {
        let row = Row {
            side: block.inner(i),
            span: [0.0, block.length(i) - 2.0 * block.half_width],
            depth,
            closed: None,
            corner_m: CORNER_M,
            visited: false,
            windows: false,
        };
        if i % 2 == 1 {
            row.plain(builder, block.ceiling, random);
        } else if cells && i == 0 {
            alike(builder, &row, block.ceiling, random);
        } else {
            row.build(builder, block.ceiling, random);
        }
    }
    sign(builder, &block.inner(0), block);
}

/// A row of cells, each like the others.
fn alike(builder: &mut SceneBuilder, row: &Row, ceiling: f64, random: &ChaCha8Rng) {
    let [from, to] = row.span;
    let cells = ((to - from) / CELL_M).floor().max(1.0);
    let width = (to - from) / cells;
    for cell in 0..cells as usize {
        let begins = from + width * cell as f64;
        let row = Row {
            span: [begins, begins + width],
            corner_m: 0.0,
            ..*row
        };
        row.build(builder, ceiling, &mut random.clone());
    }
}

/// The rows of rooms outside side `i`, behind windows; column by column above and below.
fn outer_rooms(
    builder: &mut SceneBuilder,
    grid: &Grid,
    i: usize,
    pattern: &impl Fn(u64) -> ChaCha8Rng,
) {
    let whole = grid.ring([0, 0], [3, 2]);
    let side = whole.outer(i);
    let row = |from: f64, to: f64| Row {
        side,
        span: [from, to],
        depth: ROOM_DEPTH_M,
        closed: None,
        corner_m: CORNER_M,
        visited: false,
        windows: true,
    };
    let length = whole.length(i) + 2.0 * HALF_WIDTH_M;
    if i % 2 == 1 {
        let row = row(0.0, length);
        row.build(builder, grid.ceiling, &mut pattern(8 + i as u64));
        return;
    }
    for end in [
        [-WALL_M, HALF_WIDTH_M],
        [length - HALF_WIDTH_M, length + WALL_M],
    ] {
        side.wall(builder, end, 0.0, grid.ceiling, &[]);
    }
    for (column, alike_to) in PATTERN.into_iter().enumerate() {
        let [low, high] =
            [column, column + 1].map(|line| grid.columns[line] - grid.columns[0] + HALF_WIDTH_M);
        // The upper side runs against the columns.
        let row = if i == 0 {
            row(low, high)
        } else {
            row(length - high, length - low)
        };
        let mut random = pattern(16 + 4 * alike_to + i as u64);
        if i == 0 && column == CELLS {
            alike(builder, &row, grid.ceiling, &random);
        } else {
            row.build(builder, grid.ceiling, &mut random);
        }
    }
}

/// An open hall between the corridors: pillars, and furniture in its middle.
fn hall(builder: &mut SceneBuilder, block: &Ring, random: &mut ChaCha8Rng) {
    let side = block.inner(0);
    let [width, depth] = [0, 1].map(|i| block.length(i) - 2.0 * block.half_width);
    let pillars = (width / 4.5).round().max(1.0);
    for pillar in 0..=pillars as usize {
        let u = 0.3 + (width - 0.6) * pillar as f64 / pillars;
        for v in [0.3, depth - 0.3] {
            let [x, y] = side.place(u, v);
            builder.cylinder([x, y, 0.0], 0.22, block.ceiling, Material::CONCRETE);
        }
    }
    let counter = random.random_range(2.5..width - 5.5);
    let (low, high) = (
        [counter, depth / 2.0, 0.0],
        [counter + 3.0, depth / 2.0 + 0.7, 1.1],
    );
    side.block(builder, low, high, Material::WOOD);
    let middle = Area {
        low: [1.0, 1.0],
        high: [width - 1.0, depth - 1.0],
    };
    let free = Area {
        low: [counter - 0.8, depth / 2.0 - 1.0],
        high: [counter + 3.8, depth / 2.0 + 1.6],
    };
    furnish(builder, &side, middle, &[free], random);
}

/// A lit sign over the corridor below a block.
fn sign(builder: &mut SceneBuilder, side: &Side, block: &Ring) {
    let (u, v) = (block.length(0) / 2.0, -block.half_width);
    let (low, high) = ([u, v - 0.2, 2.25], [u + 0.03, v + 0.2, 2.4]);
    side.block(builder, low, high, Material::SIGN);
}
