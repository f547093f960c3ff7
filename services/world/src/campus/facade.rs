//! Buildings seen from outside: storeys, piers and bands that leave windows recessed between them,
//! entrances with canopies, balconies, roofs.
//!
//! In: a lot, a rectangle on it, a style. Out: objects. A facade is a solid core, dark as a window
//! is, behind piers and bands that stand out from it: some twenty boxes to a side instead of a
//! box around each window.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::site::Site;
use crate::building::Side;
use crate::material::Material;

/// From floor to floor, metres.
const STOREY_M: f64 = 3.3;
/// Window panes with something behind them: little comes back.
const WINDOW: Material = Material::smooth(0.10);
/// Bricks.
pub(super) const BRICK: Material = Material::rough(0.38);
/// Roof tiles.
const TILES: Material = Material::rough(0.28);

/// What the sides of a building look like.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    wall: Material,
    storeys: usize,
    /// From pier to pier, metres.
    bay_m: f64,
    pier_m: f64,
    /// How far piers and bands stand out from the windows, metres.
    relief_m: [f64; 2],
    band_m: f64,
    balconies: f64,
    parapet_m: f64,
}

impl Style {
    pub fn random(random: &mut ChaCha8Rng, storeys: [usize; 2]) -> Self {
        let walls = [
            BRICK,
            Material::CONCRETE,
            Material::WALL,
            Material::rough(0.5),
        ];
        Self {
            wall: walls[random.random_range(0..walls.len())],
            storeys: random.random_range(storeys[0]..=storeys[1]),
            bay_m: random.random_range(2.6..5.2),
            pier_m: random.random_range(0.5..1.4),
            relief_m: [
                random.random_range(0.2..0.6),
                random.random_range(0.15..0.4),
            ],
            band_m: random.random_range(0.7..1.5),
            balconies: if random.random_bool(0.4) { 0.3 } else { 0.0 },
            parapet_m: random.random_range(0.3..1.2),
        }
    }

    fn height(&self) -> f64 {
        STOREY_M * self.storeys as f64
    }
}

/// The four sides of a rectangle, looked at from outside, counter-clockwise from the lowest.
fn sides(site: &Site<'_>, low: [f64; 2], size: [f64; 2]) -> [(Side, f64); 4] {
    let ([x, y], [w, h]) = (low, size);
    [
        (site.side([x, y], [1.0, 0.0], [0.0, -1.0]), w),
        (site.side([x + w, y], [0.0, 1.0], [1.0, 0.0]), h),
        (site.side([x + w, y + h], [-1.0, 0.0], [0.0, 1.0]), w),
        (site.side([x, y + h], [0.0, -1.0], [-1.0, 0.0]), h),
    ]
}

/// A building over a rectangle of the lot, with an entrance on the sides whose bit is set.
pub(super) fn building(
    site: &mut Site<'_>,
    low: [f64; 2],
    size: [f64; 2],
    style: &Style,
    entrances: [bool; 4],
    random: &mut ChaCha8Rng,
) {
    let [lowest, floor] = site.span(low, size);
    let (foot, top) = (lowest - 0.8, floor + style.height());
    let [x, y] = site.place([low[0] + size[0] / 2.0, low[1] + size[1] / 2.0]);
    let centre = [x, y, (foot + top) / 2.0];
    let core = [size[0], size[1], top - foot];
    site.builder.cuboid(centre, core, 0.0, WINDOW);
    for (i, (side, length)) in sides(site, low, size).into_iter().enumerate() {
        facade(
            site,
            &side,
            length,
            [foot, floor],
            style,
            entrances[i],
            random,
        );
    }
    // What stands on the roof is seen from afar.
    for _ in 0..random.random_range(1..4) {
        let place = [0, 1].map(|axis| low[axis] + size[axis] * random.random_range(0.25..0.75));
        let [x, y] = site.place(place);
        let edges = [
            random.random_range(1.5..5.0),
            random.random_range(1.5..4.0),
            random.random_range(1.0..3.0),
        ];
        let centre = [x, y, top + edges[2] / 2.0];
        site.builder.cuboid(centre, edges, 0.0, Material::METAL);
    }
}

fn facade(
    site: &mut Site<'_>,
    side: &Side,
    length: f64,
    [foot, floor]: [f64; 2],
    style: &Style,
    entrance: bool,
    random: &mut ChaCha8Rng,
) {
    let top = floor + style.height();
    let [pier, band] = style.relief_m;
    let mut block = |low: [f64; 3], high: [f64; 3], material| {
        side.block(site.builder, low, high, material);
    };
    let bays = (length / style.bay_m).round().max(1.0);
    let bay = length / bays;
    let door = entrance.then(|| random.random_range(0..bays as usize));
    // The plinth leaves room for the entrance.
    let mut plinth = |from: f64, to: f64| {
        if to > from {
            block(
                [from, 0.0, foot],
                [to, pier + 0.08, floor + 0.5],
                Material::CONCRETE,
            );
        }
    };
    match door {
        Some(door) => {
            plinth(-pier, bay * door as f64);
            plinth(bay * (door + 1) as f64, length + pier);
        }
        None => plinth(-pier, length + pier),
    }
    for line in 0..=bays as usize {
        let u = bay * line as f64;
        let half = style.pier_m / 2.0;
        block([u - half, 0.0, foot], [u + half, pier, top], style.wall);
    }
    for storey in 1..style.storeys {
        let z = floor + STOREY_M * storey as f64;
        block(
            [0.0, 0.0, z - 0.4],
            [length, band, z - 0.4 + style.band_m],
            style.wall,
        );
    }
    let crown = [length + pier, pier + 0.1, top + style.parapet_m];
    block([-pier, -0.3, top - 0.5], crown, style.wall);
    if style.balconies > 0.0 {
        for storey in 1..style.storeys {
            for index in 0..bays as usize {
                if random.random_bool(style.balconies) {
                    let (u, z) = (bay * index as f64, floor + STOREY_M * storey as f64);
                    let out = random.random_range(1.0..1.6);
                    block(
                        [u + 0.2, 0.0, z - 0.15],
                        [u + bay - 0.2, out, z],
                        Material::CONCRETE,
                    );
                    block(
                        [u + 0.2, out - 0.08, z],
                        [u + bay - 0.2, out, z + 1.0],
                        Material::METAL,
                    );
                }
            }
        }
    }
    if let Some(door) = door {
        let (from, to) = (bay * door as f64, bay * (door + 1) as f64);
        block(
            [from - 0.3, 0.0, floor + 2.6],
            [to + 0.3, 2.2, floor + 2.85],
            Material::CONCRETE,
        );
        for u in [from - 0.1, to - 0.1] {
            block([u, 1.9, foot], [u + 0.2, 2.1, floor + 2.6], Material::METAL);
        }
        block(
            [from, 0.0, foot],
            [to, 1.4, floor + 0.02],
            Material::CONCRETE,
        );
        block(
            [from, 1.4, foot],
            [to, 1.75, floor - 0.14],
            Material::CONCRETE,
        );
        let middle = (from + to) / 2.0;
        block(
            [middle - 0.06, 0.0, floor],
            [middle + 0.06, 0.1, floor + 2.6],
            Material::METAL,
        );
    }
    // A pipe down the wall, now and then a box of a machine that cools.
    if random.random_bool(0.7) {
        let u = random.random_range(0.1..0.9) * length;
        let [x, y] = side.place(u, pier + 0.12);
        site.builder
            .cylinder([x, y, foot], 0.07, top - foot, Material::METAL);
    }
    for _ in 0..random.random_range(0..3) {
        let u = random.random_range(0.05..0.85) * length;
        let z = floor + random.random_range(0.6..2.6);
        let (low, high) = ([u, pier, z], [u + 0.9, pier + 0.35, z + 0.65]);
        side.block(site.builder, low, high, Material::METAL);
    }
}

/// A house with a gabled roof, whose front looks down the lot.
pub(super) fn house(
    site: &mut Site<'_>,
    low: [f64; 2],
    size: [f64; 2],
    wall: Material,
    random: &mut ChaCha8Rng,
) {
    let [lowest, floor] = site.span(low, size);
    let (foot, eaves) = (lowest - 0.8, floor + random.random_range(3.0..6.2));
    let ridge = eaves + size[1] * random.random_range(0.3..0.5);
    let [x, y] = site.place([low[0] + size[0] / 2.0, low[1] + size[1] / 2.0]);
    let centre = [x, y, (foot + eaves) / 2.0];
    let core = [size[0], size[1], eaves - foot];
    site.builder.cuboid(centre, core, 0.0, wall);
    // Eaves over the long sides; the gables stand between.
    let (west, east) = (x - size[0] / 2.0, x + size[0] / 2.0);
    let (front, back) = (y - size[1] / 2.0, y + size[1] / 2.0);
    let over = 0.4;
    let fall = over * (ridge - eaves) / (size[1] / 2.0);
    let vertices = [
        [west, front - over, eaves - fall],
        [east, front - over, eaves - fall],
        [east, y, ridge],
        [west, y, ridge],
        [east, back + over, eaves - fall],
        [west, back + over, eaves - fall],
    ];
    let roof = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]];
    site.builder.mesh(&vertices, &roof, TILES);
    let gables = [
        [west, front, eaves],
        [west, back, eaves],
        [west, y, ridge],
        [east, front, eaves],
        [east, back, eaves],
        [east, y, ridge],
    ];
    site.builder.mesh(&gables, &[[0, 1, 2], [3, 4, 5]], wall);
    let chimney = [
        x + size[0] * random.random_range(-0.35..0.35),
        y + size[1] * random.random_range(0.05..0.25),
        ridge - 0.2,
    ];
    site.builder.cuboid(chimney, [0.7, 0.6, 2.0], 0.0, BRICK);
    // The front: a frame around door and windows, a step, a porch on posts.
    let side = site.side(low, [1.0, 0.0], [0.0, -1.0]);
    let door = size[0] * random.random_range(0.2..0.7);
    let mut block = |low: [f64; 3], high: [f64; 3], material| {
        side.block(site.builder, low, high, material);
    };
    block(
        [door - 0.8, 0.0, floor + 2.3],
        [door + 0.8, 1.3, floor + 2.45],
        Material::WOOD,
    );
    for u in [door - 0.75, door + 0.65] {
        block(
            [u, 1.15, foot],
            [u + 0.1, 1.25, floor + 2.3],
            Material::WOOD,
        );
    }
    block(
        [door - 0.8, 0.0, foot],
        [door + 0.8, 1.3, floor + 0.05],
        Material::CONCRETE,
    );
    let storeys = if eaves - floor > 5.0 { 2 } else { 1 };
    for storey in 0..storeys {
        let z = floor + 0.9 + 2.8 * f64::from(storey);
        let mut u = 0.6;
        while u + 1.3 < size[0] {
            let clear = storey > 0 || u > door + 1.0 || u + 1.3 < door - 1.0;
            if clear {
                block([u, 0.0, z], [u + 1.2, 0.04, z + 1.2], WINDOW);
                block(
                    [u - 0.1, 0.0, z - 0.12],
                    [u + 1.3, 0.16, z],
                    Material::CONCRETE,
                );
            }
            u += random.random_range(1.8..2.8);
        }
    }
    for u in [0.0, size[0] - 0.25] {
        block([u, 0.0, foot], [u + 0.25, 0.12, eaves], BRICK);
    }
}
