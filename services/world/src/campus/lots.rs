//! What a lot is used for: offices, houses, a tower, halls, a car park, a park, a sports field.
//!
//! In: a lot's size, a seeded generator. Out: objects on the lot, clear of the streets around it.

use std::f64::consts::{FRAC_PI_2, TAU};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::facade::{BRICK, Style, building, house};
use super::greenery::{bush, conifer, hedge, tree};
use super::site::Site;
use super::street::{LOT_M, car};
use crate::material::Material;

/// From a park's footpath to what stands beside it, metres.
const FOOTPATH_CLEAR_M: f64 = 2.6;
/// From the middles of both streets to where the footpath has left the crossing, metres.
const GATE_M: f64 = 9.5;

/// The use of a lot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lot {
    Offices,
    Houses,
    Tower,
    Halls,
    CarPark,
    Park,
    Sports,
}

impl Lot {
    pub const ALL: [Self; 7] = [
        Self::Offices,
        Self::Houses,
        Self::Tower,
        Self::Halls,
        Self::CarPark,
        Self::Park,
        Self::Sports,
    ];

    /// Fills a block of a size, measured between the middles of the streets around it.
    pub fn fill(self, site: &mut Site<'_>, size: [f64; 2], random: &mut ChaCha8Rng) {
        let low = [LOT_M + 1.2; 2];
        let size = [0, 1].map(|axis| size[axis] - 2.0 * low[axis]);
        let plot = Plot { low, size };
        match self {
            Self::Offices => offices(site, plot, random),
            Self::Houses => houses(site, plot, random),
            Self::Tower => tower(site, plot, random),
            Self::Halls => halls(site, plot, random),
            Self::CarPark => car_park(site, plot, random),
            Self::Park => park(site, plot, random),
            Self::Sports => sports(site, plot, random),
        }
    }
}

/// A rectangle of a block.
#[derive(Debug, Clone, Copy)]
struct Plot {
    low: [f64; 2],
    size: [f64; 2],
}

impl Plot {
    /// A place by its shares of the edges.
    fn at(&self, u: f64, v: f64) -> [f64; 2] {
        [
            self.low[0] + u * self.size[0],
            self.low[1] + v * self.size[1],
        ]
    }

    /// The part from shares to shares.
    fn part(&self, from: [f64; 2], to: [f64; 2]) -> Self {
        Self {
            low: self.at(from[0], from[1]),
            size: [0, 1].map(|axis| (to[axis] - from[axis]) * self.size[axis]),
        }
    }

    fn anywhere(&self, random: &mut ChaCha8Rng) -> [f64; 2] {
        self.at(random.random_range(0.0..1.0), random.random_range(0.0..1.0))
    }
}

/// Wings around a court, in the shape of an L, a U, a T or a bar, set back from the street by
/// different measures.
fn offices(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let style = Style::random(random, [2, 6]);
    let lower = Style::random(random, [1, 3]);
    let deep = random.random_range(0.26..0.36);
    let wide = random.random_range(0.22..0.34);
    let set_back = random.random_range(0.0..0.12);
    let mut wing = |site: &mut Site<'_>, from: [f64; 2], to: [f64; 2], style: &Style, doors| {
        let part = plot.part(from, to);
        building(site, part.low, part.size, style, doors, random);
    };
    let shape = {
        let [u, v] = [plot.size[0] * wide, plot.size[1] * deep];
        // Which of the shapes follows from the measures drawn: no two styles go together twice.
        ((u * 7.0 + v * 13.0) as usize) % 4
    };
    let front = [true, false, true, false];
    let flank = [false, true, false, true];
    match shape {
        0 => {
            wing(site, [0.0, set_back], [1.0, set_back + deep], &style, front);
            wing(site, [0.0, set_back + deep], [wide, 1.0], &lower, flank);
        }
        1 => {
            wing(site, [0.0, 1.0 - deep], [1.0, 1.0], &style, front);
            wing(site, [0.0, set_back], [wide, 1.0 - deep], &style, flank);
            wing(site, [1.0 - wide, 0.1], [1.0, 1.0 - deep], &lower, flank);
        }
        2 => {
            wing(site, [0.0, 0.0], [1.0, deep], &lower, front);
            let middle = 0.5 - wide / 2.0;
            wing(site, [middle, deep], [middle + wide, 1.0], &style, flank);
        }
        _ => {
            wing(site, [set_back, 0.0], [set_back + wide, 1.0], &style, flank);
            wing(site, [1.0 - wide, 0.0], [1.0, 1.0], &lower, flank);
        }
    }
    let court = plot.part([wide + 0.05, deep + 0.1], [0.95 - wide, 0.95 - deep]);
    for _ in 0..3 {
        tree(site, court.anywhere(random), random);
    }
}

/// Rows of houses along the two long streets, gardens between them.
fn houses(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let wall = [BRICK, Material::WALL, Material::rough(0.5)][random.random_range(0..3)];
    for row in 0..2 {
        let mut x = plot.low[0] + random.random_range(0.0..2.0);
        let end = plot.low[0] + plot.size[0];
        while x < end - 7.0 {
            let width = random.random_range(6.5..9.5_f64).min(end - x);
            let depth = random.random_range(7.5..10.0);
            let back = random.random_range(1.0..4.0);
            let y = if row == 0 {
                plot.low[1] + back
            } else {
                plot.low[1] + plot.size[1] - back - depth
            };
            house(site, [x, y], [width, depth], wall, random);
            // A garden hedge to the next house.
            let gap = if random.random_bool(0.5) {
                random.random_range(2.5..6.0)
            } else {
                0.4
            };
            if gap > 2.0 {
                let [near, far] = if row == 0 {
                    [-back, 2.0]
                } else {
                    [depth - 2.0, depth + back]
                };
                let u = x + width + gap / 2.0;
                hedge(site, [u, y + near], [u, y + far], random);
            }
            x += width + gap;
        }
    }
    let gardens = plot.part([0.05, 0.42], [0.95, 0.58]);
    for _ in 0..random.random_range(4..9) {
        let at = gardens.anywhere(random);
        match random.random_range(0..3) {
            0 => tree(site, at, random),
            1 => bush(site, at, random),
            _ => site.stand(
                at,
                [2.4, 1.8, 2.1],
                0.0,
                random.random_range(0.0..1.5),
                Material::WOOD,
            ),
        }
    }
}

/// A round tower with ribs, and a low wing beside it.
fn tower(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let radius = plot.size[0].min(plot.size[1]) * random.random_range(0.2..0.28);
    let height = random.random_range(16.0..30.0);
    let middle = plot.at(
        random.random_range(0.35..0.45),
        random.random_range(0.35..0.5),
    );
    site.pole(middle, radius, 0.0, height, Material::smooth(0.12));
    let ribs = random.random_range(14..26);
    for rib in 0..ribs {
        let angle = TAU * f64::from(rib) / f64::from(ribs);
        let at = [
            middle[0] + radius * angle.cos(),
            middle[1] + radius * angle.sin(),
        ];
        site.stand(at, [0.9, 0.5, height], 0.0, angle, Material::CONCRETE);
    }
    let mut z = 4.0;
    while z < height {
        site.pole(middle, radius + 0.3, z, z + 0.9, Material::CONCRETE);
        z += 3.6;
    }
    let style = Style::random(random, [1, 2]);
    let wing = plot.part([0.15, 0.8], [0.95, 1.0]);
    let doors = [true, false, true, false];
    building(site, wing.low, wing.size, &style, doors, random);
    for _ in 0..6 {
        let at = plot.part([0.82, 0.0], [1.0, 0.7]).anywhere(random);
        tree(site, at, random);
    }
}

/// Two long halls with ribs, and containers in between.
fn halls(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    for (from, to) in [([0.0, 0.0], [1.0, 0.34]), ([0.1, 0.7], [0.9, 1.0])] {
        let part = plot.part(from, to);
        let height = random.random_range(6.0..9.0);
        let middle = part.at(0.5, 0.5);
        let [w, h] = part.size;
        site.stand(middle, [w, h, height], 0.0, 0.0, Material::METAL);
        site.stand(
            middle,
            [w + 0.8, h + 0.8, 0.5],
            height,
            0.0,
            Material::rough(0.25),
        );
        let ribs = (w / random.random_range(5.0..7.0)).round();
        for rib in 0..=ribs as usize {
            for v in [0.0, 1.0] {
                let at = part.at(rib as f64 / ribs, v);
                site.stand(at, [0.4, 0.5, height], 0.0, 0.0, Material::CONCRETE);
            }
        }
        // Gates between some of the ribs.
        for gate in 0..ribs as usize {
            if random.random_bool(0.4) {
                let at = part.at((gate as f64 + 0.5) / ribs, 0.0);
                site.stand(
                    at,
                    [w / ribs * 0.7, 0.3, 3.8],
                    0.0,
                    0.0,
                    Material::rough(0.55),
                );
            }
        }
    }
    for _ in 0..random.random_range(4..9) {
        let at = plot.part([0.1, 0.44], [0.9, 0.62]).anywhere(random);
        let yaw = random.random_range(-0.2..0.2);
        let paint = Material::rough(random.random_range(0.2..0.6));
        let stacked = if random.random_bool(0.3) { 2.0 } else { 1.0 };
        site.stand(at, [6.1, 2.4, 2.6 * stacked], 0.0, yaw, paint);
    }
    for u in 0..12 {
        let at = plot.at(f64::from(u) / 11.0, 0.66);
        site.pole(at, 0.04, 0.0, 2.0, Material::METAL);
    }
    for top in [1.0, 1.9] {
        let (from, to) = (plot.at(0.0, 0.66), plot.at(1.0, 0.66));
        site.strip(from, to, 0.05, [top - 0.08, top], Material::METAL);
    }
}

/// Rows of cars, lamps, a hedge around.
fn car_park(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let taken = random.random_range(0.45..0.85);
    let mut y = plot.low[1] + 4.0;
    while y < plot.low[1] + plot.size[1] - 3.0 {
        let mut x = plot.low[0] + 3.0;
        while x < plot.low[0] + plot.size[0] - 2.0 {
            if random.random_bool(taken) {
                let length = random.random_range(3.6..4.9);
                car(site, [x, y], length, FRAC_PI_2, random);
            }
            x += 2.7;
        }
        y += if random.random_bool(0.5) { 11.0 } else { 5.4 };
    }
    for u in [0.2, 0.5, 0.8] {
        site.pole(plot.at(u, 0.5), 0.1, 0.0, 8.0, Material::METAL);
        site.stand(plot.at(u, 0.5), [2.4, 0.3, 0.15], 8.0, 0.0, Material::METAL);
    }
    for (from, to) in [
        ([0.0, 0.0], [0.4, 0.0]),
        ([0.6, 0.0], [1.0, 0.0]),
        ([0.0, 1.0], [1.0, 1.0]),
    ] {
        hedge(
            site,
            plot.at(from[0], from[1]),
            plot.at(to[0], to[1]),
            random,
        );
    }
    for v in [0.15, 0.4, 0.65, 0.9] {
        tree(site, plot.at(0.0, v), random);
        tree(site, plot.at(1.0, v), random);
    }
}

/// The footpath through a park, from its first crossing to the opposite one: places relative to
/// the block's corner.
pub(super) fn footpath(size: [f64; 2]) -> Vec<[f64; 2]> {
    let bend = |u: f64, v: f64| [u * size[0], v * size[1]];
    let [w, h] = size;
    vec![
        bend(0.0, 0.0),
        [GATE_M, GATE_M],
        bend(0.24, 0.16),
        bend(0.42, 0.46),
        bend(0.62, 0.58),
        bend(0.80, 0.80),
        [w - GATE_M, h - GATE_M],
        bend(1.0, 1.0),
    ]
}

/// Trees and bushes on both sides of a footpath, a pavilion, a statue.
fn park(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let size = [0, 1].map(|axis| plot.size[axis] + 2.0 * plot.low[axis]);
    let path = footpath(size);
    let pavilion = plot.at(
        random.random_range(0.2..0.3),
        random.random_range(0.65..0.75),
    );
    let statue = plot.at(
        random.random_range(0.72..0.8),
        random.random_range(0.25..0.35),
    );
    let mut taken = vec![(pavilion, 5.0), (statue, 2.0)];
    for _ in 0..random.random_range(26..40) {
        let at = plot.anywhere(random);
        let kind = random.random_range(0..5);
        let reach = if kind == 4 { 1.2 } else { 2.0 };
        let clear = away(&path, at) > FOOTPATH_CLEAR_M + reach
            && (taken.iter()).all(|(other, r)| distance(*other, at) > r + reach);
        if !clear {
            continue;
        }
        taken.push((at, reach));
        match kind {
            0..=2 => tree(site, at, random),
            3 => conifer(site, at, random),
            _ => bush(site, at, random),
        }
    }
    for post in 0..8 {
        let angle = TAU * f64::from(post) / 8.0;
        let at = [
            pavilion[0] + 3.2 * angle.cos(),
            pavilion[1] + 3.2 * angle.sin(),
        ];
        site.pole(at, 0.12, 0.0, 2.8, Material::WOOD);
    }
    site.pole(pavilion, 3.9, 2.8, 3.1, Material::WOOD);
    site.pole(pavilion, 2.0, 3.1, 3.9, Material::WOOD);
    site.stand(statue, [1.4, 1.4, 1.1], 0.0, 0.4, Material::CONCRETE);
    site.pole(statue, 0.3, 1.1, 2.9, Material::METAL);
    // Benches along the path, looking at it.
    for pair in path.windows(2).skip(2).take(3) {
        let heading = (pair[1][1] - pair[0][1]).atan2(pair[1][0] - pair[0][0]);
        let middle = [0, 1].map(|a| (pair[0][a] + pair[1][a]) / 2.0);
        let at = [
            middle[0] - FOOTPATH_CLEAR_M * heading.sin(),
            middle[1] + FOOTPATH_CLEAR_M * heading.cos(),
        ];
        site.stand(at, [1.8, 0.5, 0.08], 0.4, heading, Material::WOOD);
        site.stand(at, [0.2, 0.4, 0.4], 0.0, heading, Material::CONCRETE);
    }
}

/// A field between fences, goals and masts.
fn sports(site: &mut Site<'_>, plot: Plot, random: &mut ChaCha8Rng) {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for (i, from) in corners.iter().enumerate() {
        let to = corners[(i + 1) % 4];
        let (from, to) = (plot.at(from[0], from[1]), plot.at(to[0], to[1]));
        let posts = (distance(from, to) / 4.0).round();
        for post in 0..posts as usize {
            let share = post as f64 / posts;
            let at = [0, 1].map(|a| from[a] + share * (to[a] - from[a]));
            site.pole(at, 0.05, 0.0, 3.0, Material::METAL);
        }
        for top in [0.6, 1.4, 2.2, 3.0] {
            site.strip(from, to, 0.06, [top - 0.06, top], Material::METAL);
        }
    }
    for v in [0.1, 0.9] {
        for u in [0.42, 0.58] {
            site.pole(plot.at(u, v), 0.06, 0.0, 2.4, Material::METAL);
        }
        let (from, to) = (plot.at(0.42, v), plot.at(0.58, v));
        site.strip(from, to, 0.12, [2.3, 2.42], Material::METAL);
    }
    for (u, v) in [(0.03, 0.05), (0.97, 0.05), (0.97, 0.95), (0.03, 0.95)] {
        site.pole(plot.at(u, v), 0.18, 0.0, 14.0, Material::METAL);
        site.stand(plot.at(u, v), [1.8, 0.4, 1.2], 13.0, 0.8, Material::METAL);
    }
    let stand = plot.at(0.12, random.random_range(0.35..0.65));
    for step in 0..4 {
        let at = [stand[0] + 0.8 * f64::from(step), stand[1]];
        let height = 1.8 - 0.4 * f64::from(step);
        site.stand(at, [0.8, 14.0, height], 0.0, 0.0, Material::CONCRETE);
    }
    let shed = plot.at(
        random.random_range(0.75..0.88),
        random.random_range(0.4..0.6),
    );
    site.stand(shed, [3.5, 6.0, 2.6], 0.0, 0.0, BRICK);
    site.stand(shed, [4.3, 6.8, 0.2], 2.6, 0.0, Material::WOOD);
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// How far a place is from a line of places.
fn away(path: &[[f64; 2]], at: [f64; 2]) -> f64 {
    path.windows(2)
        .map(|pair| {
            let along = [0, 1].map(|a| pair[1][a] - pair[0][a]);
            let to = [0, 1].map(|a| at[a] - pair[0][a]);
            let square = along[0] * along[0] + along[1] * along[1];
            let share = ((to[0] * along[0] + to[1] * along[1]) / square).clamp(0.0, 1.0);
            distance(at, [0, 1].map(|a| pair[0][a] + share * along[a]))
        })
        .fold(f64::INFINITY, f64::min)
}
