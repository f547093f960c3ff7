//! A campus: streets on an irregular grid, and blocks of offices, houses, halls and parks between
//! them, on rolling ground.
//!
//! In: a seed. Out: the scene, and a patrol along the middle of the streets that comes back to
//! places it knows in the same and in the opposite direction. Elsewhere: the patrols (`route`),
//! the streets (`street`), the lots (`lots`), facades (`facade`), trees (`greenery`).
//!
//! The campus proper lies in a belt of blocks that are seen but not visited. Two of its columns
//! are as wide as each other and hold the same lots to the last bench, so that a street of one is
//! told from its like in the other by the slope of the ground and what is seen farther away.

mod facade;
mod greenery;
mod lots;
mod route;
mod site;
mod street;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use self::lots::{Lot, footpath};
use self::route::{Grid, Stop, explore};
use self::site::Site;
use self::street::{KERB_M, streets};
use crate::floor::{Terrain, Wave};
use crate::material::Material;
use crate::noise::{Purpose, generator};
use crate::preset::World;
use crate::scene::Scene;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// From the first crossing of the campus proper to where the robot starts, metres.
const START_M: f64 = 20.0;
/// How far ground reaches beyond the last street, metres.
const BEYOND_M: f64 = 40.0;
const ASPHALT: Material = Material {
    incidence_exponent: 0.5,
    ..Material::rough(0.17)
};
const GRASS: Material = Material {
    incidence_exponent: 0.5,
    ..Material::rough(0.45)
};

/// Where the park is that the patrol walks through.
const PARK: [usize; 2] = [3, 1];
/// What the campus' lots are used for, from below; the first and the third column are alike in
/// the lower two rows.
const LOTS: [[Lot; 4]; 3] = [
    [Lot::Houses, Lot::Tower, Lot::Houses, Lot::CarPark],
    [Lot::Offices, Lot::Halls, Lot::Offices, Lot::Park],
    [Lot::Sports, Lot::Offices, Lot::Houses, Lot::Offices],
];

/// The patrol of the campus: crossings (column line, row line) of the campus proper.
const PATROL: [Stop; 35] = {
    const fn at(column: usize, row: usize) -> Stop {
        Stop::Crossing([column, row])
    }
    [
        at(1, 0),
        at(2, 0),
        at(2, 1),
        at(1, 1),
        at(0, 1),
        at(0, 0),
        // Known from here on: the first loop closes, in the same direction.
        at(1, 0),
        at(1, 1),
        at(1, 2),
        at(2, 2),
        at(2, 1),
        at(3, 1),
        at(3, 0),
        // Back along the first street, against the first direction.
        at(2, 0),
        at(1, 0),
        at(1, 1),
        at(0, 1),
        at(0, 2),
        at(0, 3),
        at(1, 3),
        at(2, 3),
        at(3, 3),
        at(4, 3),
        at(4, 2),
        at(4, 1),
        at(4, 0),
        at(3, 0),
        at(3, 1),
        // Through the park to its far corner, and back along the rim.
        Stop::Park(PARK),
        at(4, 3),
        at(3, 3),
        at(3, 2),
        at(1, 2),
        at(0, 2),
        at(0, 0),
    ]
};

/// The campus of a seed, with a robot that patrols more than 2 km of it.
pub(crate) fn campus(seed: u64, gait: Gait) -> World {
    let mut random = generator(seed, Purpose::Scene, 0);
    let alike = random.random_range(68.0..78.0);
    let widths = [
        alike,
        random.random_range(66.0..80.0),
        alike,
        random.random_range(70.0..84.0),
    ];
    let heights: [f64; 3] = std::array::from_fn(|_| random.random_range(60.0..70.0));
    let grid = Grid::new(&widths, &heights, &mut random);
    let scene = grid_scene(seed, &grid, &mut random, |[column, row], _| {
        let pattern = match (column, row) {
            (2, 0 | 1) => row,
            _ => 4 * column + row,
        };
        (LOTS[row][column], pattern as u64)
    });
    world(scene, grid.way(&PATROL, footpath), gait)
}

/// Blocks of the large campus, across and up.
const LARGE: [usize; 2] = [10, 9];
/// How far its patrol goes at least, metres.
const LARGE_PATROL_M: f64 = 20_000.0;

/// A campus of ninety blocks, with a patrol of more than 20 km that prefers streets it has not
/// been in.
pub(crate) fn large_campus(seed: u64, gait: Gait) -> World {
    let mut random = generator(seed, Purpose::Scene, 0);
    // Few widths, so that here and there two blocks are as wide as each other.
    let kinds: [f64; 3] = std::array::from_fn(|_| random.random_range(64.0..84.0));
    let widths: Vec<f64> = (0..LARGE[0])
        .map(|_| kinds[random.random_range(0..kinds.len())])
        .collect();
    let heights: Vec<f64> = (0..LARGE[1])
        .map(|_| random.random_range(58.0..72.0))
        .collect();
    let grid = Grid::new(&widths, &heights, &mut random);
    let scene = grid_scene(seed, &grid, &mut random, |_, random| {
        let lot = Lot::ALL[random.random_range(0..Lot::ALL.len())];
        (lot, random.random_range(0..40))
    });
    let stops = explore(&grid, LARGE_PATROL_M, &mut random);
    world(scene, grid.way(&stops, footpath), gait)
}

fn world(scene: Scene, way: Vec<[f64; 2]>, gait: Gait) -> World {
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, gait)
        .stand(1.0)
        .walk(&way)
        .build(scene.floor().clone())
        .expect("every way ends at the start, along the first street");
    World { scene, trajectory }
}

/// Ground and blocks. `lot_of` gives the use of a block of the campus proper, and the pattern by
/// whose number it is laid out.
fn grid_scene(
    seed: u64,
    grid: &Grid,
    random: &mut ChaCha8Rng,
    mut lot_of: impl FnMut([usize; 2], &mut ChaCha8Rng) -> (Lot, u64),
) -> Scene {
    let mut builder = SceneBuilder::new();
    let terrain = terrain(random);
    let [low, high] = grid.bounds();
    let streets_of = |axis: usize| {
        grid.lines[axis].iter().map(move |&line| {
            let (mut from, mut to) = (low, high);
            (from[axis], to[axis]) = (line - KERB_M, line + KERB_M);
            (from, to, ASPHALT)
        })
    };
    let paved: Vec<_> = streets_of(0).chain(streets_of(1)).collect();
    builder.terrain(
        terrain.clone(),
        low.map(|x| x - BEYOND_M),
        high.map(|x| x + BEYOND_M),
        GRASS,
        &paved,
    );
    let blocks = [0, 1].map(|axis| grid.lines[axis].len() - 1);
    for column in 0..blocks[0] {
        for row in 0..blocks[1] {
            let inside = column > 0 && row > 0 && column + 1 < blocks[0] && row + 1 < blocks[1];
            let (lot, pattern) = if inside {
                lot_of([column - 1, row - 1], random)
            } else {
                let lot = Lot::ALL[random.random_range(0..Lot::ALL.len())];
                (lot, 1000 + (column * blocks[1] + row) as u64)
            };
            let mut pattern = generator(seed, Purpose::Scene, 1 + pattern);
            let (origin, size) = grid.block([column, row]);
            let mut site = Site {
                builder: &mut builder,
                terrain: &terrain,
                origin,
            };
            streets(&mut site, size, lot == Lot::Park, &mut pattern);
            lot.fill(&mut site, size, &mut pattern);
        }
    }
    builder.build()
}

/// Three waves whose slopes add up to 8.5 % at most, level where the robot starts.
fn terrain(random: &mut ChaCha8Rng) -> Terrain {
    let waves = [(0.035, 150.0), (0.03, 115.0), (0.02, 85.0)].map(|(slope, length)| {
        let length_m = length * random.random_range(0.9..1.2);
        let (sin, cos) = random.random_range(0.0..std::f64::consts::PI).sin_cos();
        Wave {
            amplitude_m: slope * length_m / std::f64::consts::TAU,
            length_m,
            along: [cos, sin],
            phase_rad: random.random_range(0.0..std::f64::consts::TAU),
        }
    });
    Terrain {
        waves: waves.to_vec(),
        level_m: 10.0,
        blend_m: 50.0,
    }
}
