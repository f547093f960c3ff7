//! Rolling ground: heights on a square grid, two triangles to a cell.
//!
//! In: the terrain's height function, the rectangle to cover. Out: where a ray meets it first.
//! The heights within a block of cells are bounded, so a ray steps over blocks that it passes
//! above, and looks at single cells only where it may meet the ground. Between the grid's
//! points the surface departs from the height function by an eighth of the curvature along
//! either axis: 2 mm on the ready-made terrains.

use parry3d::math::Vector;
use parry3d::query::Ray;

use crate::floor::Terrain;
use crate::scene::{Hit, ObjectId};

/// Edge of a cell, metres.
const CELL_M: f32 = 1.0;
/// Cells along the edge of a block.
const BLOCK: usize = 16;

/// What the cells of a rectangle are covered with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cover {
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub object: ObjectId,
}

#[derive(Debug)]
pub(crate) struct Ground {
    /// The place of the first grid point.
    low: [f32; 2],
    /// Cells along x and y, whole blocks.
    cells: [usize; 2],
    /// At the grid points, row by row: `cells[0] + 1` to a row.
    heights: Vec<f32>,
    /// The greatest height of each block, row by row.
    tops: Vec<f32>,
    /// The greatest height of all.
    top: f32,
    /// What each cell is covered with, row by row.
    objects: Vec<ObjectId>,
}

/// The stretch of a ray over one cell or block, and the way to the next.
struct Walk {
    at: [isize; 2],
    step: [isize; 2],
    /// Where along the ray the next line of either axis is crossed, and how far apart these are.
    next: [f32; 2],
    delta: [f32; 2],
}

impl Walk {
    /// From a point of the grid, both in units of `edge`.
    fn new(from: [f32; 2], dir: [f32; 2], begin: f32, edge: f32, low: [f32; 2]) -> Self {
        let mut walk = Self {
            at: [0; 2],
            step: [0; 2],
            next: [f32::INFINITY; 2],
            delta: [f32::INFINITY; 2],
        };
        for axis in 0..2 {
            let place = (from[axis] + dir[axis] * begin - low[axis]) / edge;
            walk.at[axis] = place.floor() as isize;
            if dir[axis] != 0.0 {
                walk.step[axis] = if dir[axis] > 0.0 { 1 } else { -1 };
                let ahead = walk.at[axis] + isize::from(dir[axis] > 0.0);
                let line = ahead as f32 * edge + low[axis];
                walk.next[axis] = ((line - from[axis]) / dir[axis]).max(begin);
                walk.delta[axis] = (edge / dir[axis]).abs();
            }
        }
        walk
    }

    fn leaves(&self) -> f32 {
        self.next[0].min(self.next[1])
    }

    fn advance(&mut self) {
        let axis = usize::from(self.next[1] < self.next[0]);
        self.at[axis] += self.step[axis];
        self.next[axis] += self.delta[axis];
    }
}

impl Ground {
    /// The terrain over a rectangle. The first cover is everywhere where no later one is.
    pub fn new(terrain: &Terrain, low: [f64; 2], high: [f64; 2], covers: &[Cover]) -> Self {
        let edge = f64::from(CELL_M);
        let cells = [0, 1].map(|axis| {
            let cells = ((high[axis] - low[axis]) / edge).ceil().max(1.0) as usize;
            cells.div_ceil(BLOCK) * BLOCK
        });
        let place = |i: usize, axis: usize| low[axis] + edge * i as f64;
        let mut heights = Vec::with_capacity((cells[0] + 1) * (cells[1] + 1));
        for j in 0..=cells[1] {
            for i in 0..=cells[0] {
                heights.push(terrain.height(place(i, 0), place(j, 1)) as f32);
            }
        }
        let mut objects = Vec::with_capacity(cells[0] * cells[1]);
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let middle = [place(i, 0) + edge / 2.0, place(j, 1) + edge / 2.0];
                let covers_it = |cover: &&Cover| {
                    (0..2).all(|a| cover.low[a] <= middle[a] && middle[a] < cover.high[a])
                };
                let cover = covers.iter().rev().find(covers_it).or(covers.first());
                objects.push(cover.map_or(0, |cover| cover.object));
            }
        }
        let mut tops = Vec::with_capacity(cells[0] * cells[1] / (BLOCK * BLOCK));
        for block_j in 0..cells[1] / BLOCK {
            for block_i in 0..cells[0] / BLOCK {
                let mut top = f32::MIN;
                for j in block_j * BLOCK..=(block_j + 1) * BLOCK {
                    for i in block_i * BLOCK..=(block_i + 1) * BLOCK {
                        top = top.max(heights[j * (cells[0] + 1) + i]);
                    }
                }
                tops.push(top);
            }
        }
        Self {
            low: low.map(|x| x as f32),
            cells,
            heights,
            top: tops.iter().copied().fold(f32::MIN, f32::max),
            tops,
            objects,
        }
    }

    /// Where a ray from above the ground meets it first.
    pub fn cast(&self, ray: &Ray, within: f32) -> Option<Hit> {
        let from = [ray.origin.x, ray.origin.y];
        let dir = [ray.dir.x, ray.dir.y];
        // Only where the ray is over the rectangle and not higher than all of the ground.
        let (mut begin, mut end) = (0.0f32, within);
        for axis in 0..2 {
            let high = self.low[axis] + self.cells[axis] as f32 * CELL_M;
            if dir[axis] == 0.0 {
                if from[axis] < self.low[axis] || from[axis] >= high {
                    return None;
                }
                continue;
            }
            let (a, b) = (
                (self.low[axis] - from[axis]) / dir[axis],
                (high - from[axis]) / dir[axis],
            );
            begin = begin.max(a.min(b));
            end = end.min(a.max(b));
        }
        let over = (self.top - ray.origin.z) / ray.dir.z;
        if ray.dir.z > 0.0 {
            end = end.min(over);
        } else if ray.origin.z > self.top {
            begin = begin.max(over);
        }
        if begin.is_nan() || begin >= end {
            return None;
        }
        let edge = BLOCK as f32 * CELL_M;
        let blocks = self.cells.map(|cells| (cells / BLOCK) as isize);
        let mut walk = Walk::new(from, dir, begin, edge, self.low);
        let mut enters = begin;
        while enters < end {
            let leaves = walk.leaves().min(end);
            if (0..2).all(|axis| (0..blocks[axis]).contains(&walk.at[axis])) {
                let top = self.tops[(walk.at[1] * blocks[0] + walk.at[0]) as usize];
                let lowest =
                    ray.origin.z + ray.dir.z * if ray.dir.z < 0.0 { leaves } else { enters };
                if lowest <= top
                    && let Some(hit) = self.within_block(ray, enters, leaves, walk.at)
                {
                    return Some(hit);
                }
            }
            enters = leaves;
            walk.advance();
        }
        None
    }

    fn within_block(&self, ray: &Ray, begin: f32, end: f32, block: [isize; 2]) -> Option<Hit> {
        let from = [ray.origin.x, ray.origin.y];
        let dir = [ray.dir.x, ray.dir.y];
        let mut walk = Walk::new(from, dir, begin, CELL_M, self.low);
        // Rounding may put the first cell beside the block: it belongs to the block's edge.
        let first = block.map(|b| b * BLOCK as isize);
        for (axis, least) in first.into_iter().enumerate() {
            let clamped = walk.at[axis].clamp(least, least + BLOCK as isize - 1);
            if clamped != walk.at[axis] && walk.step[axis] == clamped - walk.at[axis] {
                walk.next[axis] += walk.delta[axis];
            }
            walk.at[axis] = clamped;
        }
        let mut enters = begin;
        loop {
            let leaves = walk.leaves().min(end);
            if let Some(hit) = self.within_cell(ray, enters, leaves, walk.at) {
                return Some(hit);
            }
            if leaves >= end {
                return None;
            }
            enters = leaves;
            walk.advance();
            if (0..2).any(|a| walk.at[a] < first[a] || walk.at[a] >= first[a] + BLOCK as isize) {
                return None;
            }
        }
    }

    /// A cell is cut along its diagonal; over each half the ray's clearance is a linear function
    /// of the way, so where it changes sign the ray meets the ground: no gap between triangles.
    fn within_cell(&self, ray: &Ray, enters: f32, leaves: f32, at: [isize; 2]) -> Option<Hit> {
        let [i, j] = at.map(|a| a as usize);
        let row = self.cells[0] + 1;
        let corner = j * row + i;
        let (near, far) = (
            self.heights.get(corner..corner + 2)?,
            self.heights.get(corner + row..corner + row + 2)?,
        );
        let [h00, h10, h01, h11] = [near[0], near[1], far[0], far[1]];
        let high = h00.max(h10).max(h01).max(h11);
        let z = |t: f32| ray.origin.z + ray.dir.z * t;
        if z(enters).min(z(leaves)) > high {
            return None;
        }
        let (x, y) = (
            (ray.origin.x - self.low[0]) / CELL_M - i as f32,
            (ray.origin.y - self.low[1]) / CELL_M - j as f32,
        );
        let (dx, dy) = (ray.dir.x / CELL_M, ray.dir.y / CELL_M);
        // Where the ray crosses the diagonal from the first corner to the last.
        let crossing = (y - x) / (dx - dy);
        let pieces = if crossing > enters && crossing < leaves {
            [(enters, crossing), (crossing, leaves)]
        } else {
            [(enters, leaves), (leaves, leaves)]
        };
        for (begin, end) in pieces {
            let middle = (begin + end) / 2.0;
            let below_diagonal = x + dx * middle >= y + dy * middle;
            let slope = if below_diagonal {
                [h10 - h00, h11 - h10]
            } else {
                [h11 - h01, h01 - h00]
            };
            let clearance =
                |t: f32| z(t) - (h00 + slope[0] * (x + dx * t) + slope[1] * (y + dy * t));
            let (before, after) = (clearance(begin), clearance(end));
            if after <= 0.0 && begin < end {
                // Below from the first: rounding at an edge that belongs to both.
                let share = if before <= 0.0 {
                    0.0
                } else {
                    before / (before - after)
                };
                let [sx, sy] = slope.map(|s| s / CELL_M);
                return Some(Hit {
                    distance: begin + share * (end - begin),
                    normal: Vector::new(-sx, -sy, 1.0) / (1.0 + sx * sx + sy * sy).sqrt(),
                    object: self.objects[j * self.cells[0] + i],
                });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::Wave;

    fn rolling() -> Terrain {
        let wave = |amplitude_m, length_m, along: [f64; 2]| Wave {
            amplitude_m,
            length_m,
            along,
            phase_rad: 1.0,
        };
        Terrain {
            waves: vec![wave(1.5, 120.0, [0.96, 0.28]), wave(0.5, 70.0, [-0.6, 0.8])],
            level_m: 8.0,
            blend_m: 30.0,
        }
    }

    #[test]
    fn a_ray_meets_the_ground_where_the_height_function_says() {
        let terrain = rolling();
        let cover = Cover {
            low: [-100.0; 2],
            high: [100.0; 2],
            object: 7,
        };
        let ground = Ground::new(&terrain, [-100.0; 2], [100.0; 2], &[cover]);
        let mut met = 0;
        for k in 0..4000 {
            let azimuth = f64::from(k) * 0.777;
            let down = f64::from(k % 41) * 0.01 - 0.05;
            let (x, y) = (
                f64::from(k % 13) * 11.0 - 66.0,
                f64::from(k % 17) * 8.0 - 64.0,
            );
            let eye = terrain.height(x, y) + 0.65;
            let dir = [
                azimuth.cos() * (1.0 - down * down).sqrt(),
                azimuth.sin() * (1.0 - down * down).sqrt(),
                -down,
            ];
            let ray = Ray::new(
                Vector::new(x as f32, y as f32, eye as f32),
                Vector::new(dir[0] as f32, dir[1] as f32, dir[2] as f32),
            );
            // Small steps along the ray until it is under the ground.
            let clearance =
                |t: f64| eye + dir[2] * t - terrain.height(x + dir[0] * t, y + dir[1] * t);
            let inside = |t: f64| (x + dir[0] * t).abs() < 99.0 && (y + dir[1] * t).abs() < 99.0;
            let expected = (0..8000)
                .map(|i| f64::from(i) * 0.01)
                .take_while(|t| inside(*t))
                .find(|t| clearance(*t) <= 0.0);
            let hit = ground.cast(&ray, 80.0);
            match (expected, hit) {
                (Some(expected), Some(hit)) => {
                    let t = f64::from(hit.distance);
                    assert!(clearance(t).abs() < 5e-3, "ray {k}: {t} and {expected}");
                    // Where the ray grazes a crest, it may pass by a little.
                    assert!(
                        (t - expected).abs() < 0.3 || down < 0.06,
                        "ray {k}: {t}, {expected}"
                    );
                    assert_eq!(hit.object, 7);
                    met += 1;
                }
                (None, None) => {}
                (_, Some(hit)) => {
                    // The step walk stops a metre before the edge.
                    assert!(clearance(f64::from(hit.distance)).abs() < 5e-3, "ray {k}");
                }
                (Some(t), None) => assert!(down < 0.06, "ray {k} passes the ground at {t}"),
            }
        }
        assert!(met > 2000, "{met}");
    }
}
