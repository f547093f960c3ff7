//! Rolling ground: heights on a square grid, two triangles to a cell.
//!
//! In: the terrain's height function, the rectangle to cover. Out: where a ray meets it first.
//! No ground is steeper than the steepest triangle, nor does it bend faster than where it bends
//! most: so a ray leaps as far as it can't have met the ground, and looks at single cells only
//! where it comes near. Between the grid's
//! points the surface departs from the height function by an eighth of the curvature along
//! either axis: 2 mm on the ready-made terrains.

use parry3d::math::Vector;
use parry3d::query::Ray;

use crate::floor::Terrain;
use crate::scene::{Hit, ObjectId};

/// Edge of a cell, metres.
const CELL_M: f32 = 1.0;
/// So many firings of a laser are led over the ground together.
const ALIKE: usize = 8;
/// Shorter leaps than this are not worth their while: single cells are looked at instead.
const LEAST_LEAP_M: f32 = 0.5;
/// So many of them, before the next leap is tried.
const CELLS_A_TIME: usize = 4;
/// The slopes of two triangles differ by no more than the ground bends over the way between them
/// and this much beyond, metres: within a cell, a slope is that of some place in it.
const BESIDE_M: f32 = 3.0;
/// A leap ends so far before it might meet the ground, against rounding, metres.
const SAFETY_M: f32 = 1e-3;

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
    /// Cells along x and y.
    cells: [usize; 2],
    /// At the grid points, row by row: `cells[0] + 1` to a row.
    heights: Vec<f32>,
    /// The greatest height of all.
    top: f32,
    /// The steepest slope of all.
    steepest: f32,
    /// How much the slope changes at most, for each metre.
    bend: f32,
    /// What each cell is covered with, row by row.
    objects: Vec<ObjectId>,
}

/// A place of a ray over the ground.
struct Over {
    clearance: f32,
    /// How much of it the ray loses here, for each metre.
    closing: f32,
}

/// A walk along a ray from cell to cell.
struct Walk {
    at: [i32; 2],
    step: [i32; 2],
    /// Where along the ray the next line of either axis is crossed, and how far apart these are.
    next: [f32; 2],
    delta: [f32; 2],
}

impl Walk {
    fn new(from: [f32; 2], dir: [f32; 2], begin: f32, low: [f32; 2]) -> Self {
        let mut walk = Self {
            at: [0; 2],
            step: [0; 2],
            next: [f32::INFINITY; 2],
            delta: [f32::INFINITY; 2],
        };
        for axis in 0..2 {
            let place = (from[axis] + dir[axis] * begin - low[axis]) / CELL_M;
            walk.at[axis] = place.floor() as i32;
            if dir[axis] != 0.0 {
                walk.step[axis] = if dir[axis] > 0.0 { 1 } else { -1 };
                let ahead = walk.at[axis] + i32::from(dir[axis] > 0.0);
                let line = ahead as f32 * CELL_M + low[axis];
                walk.next[axis] = ((line - from[axis]) / dir[axis]).max(begin);
                walk.delta[axis] = (CELL_M / dir[axis]).abs();
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

/// How far a ray moves on the level for each metre.
fn level(ray: &Ray) -> f32 {
    (ray.dir.x * ray.dir.x + ray.dir.y * ray.dir.y).sqrt()
}

/// The steepest slope between neighbouring grid points, and the most that slopes change a metre.
fn extremes(heights: &[f32], cells: [usize; 2]) -> (f32, f32) {
    let row = cells[0] + 1;
    let (mut steepest, mut bend) = (0.0f32, 0.0f32);
    for j in 0..cells[1] {
        for at in j * row..j * row + cells[0] {
            let slope = |a: usize, b: usize| (heights[b] - heights[a]) / CELL_M;
            let (right, up) = (slope(at, at + 1), slope(at, at + row));
            let (far_right, far_up) = (slope(at + row, at + row + 1), slope(at + 1, at + row + 1));
            steepest = steepest.max(right.hypot(far_up)).max(far_right.hypot(up));
            let twist = (far_right - right) / CELL_M;
            // The cell before this one along either axis, if there is one.
            let along_x = if at > j * row {
                right - slope(at - 1, at)
            } else {
                0.0
            };
            let along_y = if j > 0 { up - slope(at - row, at) } else { 0.0 };
            let square = along_x * along_x + along_y * along_y + 2.0 * twist * twist;
            bend = bend.max(square.sqrt() / CELL_M);
        }
    }
    (steepest, bend)
}

impl Ground {
    /// The terrain over a rectangle. The first cover is everywhere where no later one is.
    pub fn new(terrain: &Terrain, low: [f64; 2], high: [f64; 2], covers: &[Cover]) -> Self {
        let edge = f64::from(CELL_M);
        let cells = [0, 1].map(|axis| ((high[axis] - low[axis]) / edge).ceil().max(1.0) as usize);
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
        let (steepest, bend) = extremes(&heights, cells);
        Self {
            low: low.map(|x| x as f32),
            cells,
            top: heights.iter().copied().fold(f32::MIN, f32::max),
            heights,
            steepest,
            bend,
            objects,
        }
    }

    /// Where a ray from above the ground meets it first.
    pub fn cast(&self, ray: &Ray, within: f32) -> Option<Hit> {
        self.cast_from(ray, 0.0, within)
    }

    /// As [`cast`](Self::cast) for each of the rays. Every `stride`-th ray is about the same, but
    /// for some thousandths of a turn: the same laser, fired again.
    pub fn cast_alike(&self, rays: &[Ray], stride: usize, within: f32, hits: &mut [Option<Hit>]) {
        for first in (0..rays.len()).step_by(stride * ALIKE) {
            let end = rays.len().min(first + stride * ALIKE);
            for laser in first..end.min(first + stride) {
                let alike = (laser..end).step_by(stride);
                let free = self.free(alike.clone().map(|ray| &rays[ray]), within);
                if free < within {
                    for ray in alike {
                        let begin = free / level(&rays[ray]);
                        hits[ray] = self.cast_from(&rays[ray], begin, within);
                    }
                }
            }
        }
    }

    /// How far on the level none of the rays can have met the ground: they lie over one ray that
    /// starts from the lowest of their places and rises like the least of them, or beside it by
    /// no more than they spread.
    fn free<'a>(&self, mut rays: impl Iterator<Item = &'a Ray>, within: f32) -> f32 {
        let Some(first) = rays.next() else {
            return 0.0;
        };
        let mut lowest = Ray::new(first.origin, first.dir / level(first));
        let (mut spread, mut apart) = (0.0f32, 0.0f32);
        for ray in rays {
            let dir = ray.dir / level(ray);
            spread = spread.max((dir - lowest.dir).truncate().length());
            apart = apart.max((ray.origin - lowest.origin).truncate().length());
            lowest.origin.z = lowest.origin.z.min(ray.origin.z);
            lowest.dir.z = lowest.dir.z.min(dir.z);
        }
        // The ground comes nearer by its slope, ahead and to the sides.
        let closing = self.steepest * (1.0 + spread) - lowest.dir.z;
        if closing.is_nan() || !self.covers(&lowest, 0.0) {
            return 0.0;
        }
        let mut at = 0.0;
        loop {
            let beside = self.steepest * (apart + spread * at);
            let over = self.over(&lowest, at);
            let clearance = over.clearance - beside - SAFETY_M;
            if clearance > 0.0 && closing <= 0.0 {
                return within;
            }
            let leap = self.leap(clearance, over.closing + self.steepest * spread, closing);
            if leap >= within - at {
                return within;
            }
            // Beyond the rectangle nothing is known of the ground.
            if leap < LEAST_LEAP_M || !self.covers(&lowest, at + leap) {
                return at;
            }
            at += leap;
        }
    }

    /// Whether a place of a ray is over the rectangle.
    fn covers(&self, ray: &Ray, at: f32) -> bool {
        let point = ray.point_at(at);
        [point.x, point.y].into_iter().enumerate().all(|(a, x)| {
            let within = x - self.low[a];
            within >= 0.0 && within < self.cells[a] as f32 * CELL_M
        })
    }

    fn cast_from(&self, ray: &Ray, free: f32, within: f32) -> Option<Hit> {
        let from = [ray.origin.x, ray.origin.y];
        let dir = [ray.dir.x, ray.dir.y];
        // Only where the ray is over the rectangle and not higher than all of the ground.
        let (mut begin, mut end) = (free, within);
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
        // How fast the ground can come nearer at most.
        let closing = self.steepest * level(ray) - ray.dir.z;
        if closing <= 0.0 {
            return None;
        }
        let mut at = begin;
        loop {
            loop {
                let over = self.over(ray, at);
                let leap = self.leap(over.clearance - SAFETY_M, over.closing, closing);
                if leap < LEAST_LEAP_M {
                    break;
                }
                at += leap;
                if at >= end {
                    return None;
                }
            }
            let mut walk = Walk::new(from, dir, at, self.low);
            for _ in 0..CELLS_A_TIME {
                let leaves = walk.leaves().min(end);
                if let Some(hit) = self.within_cell(ray, at, leaves, walk.at) {
                    return Some(hit);
                }
                at = leaves;
                if at >= end {
                    return None;
                }
                walk.advance();
            }
        }
    }

    /// How far a ray may go without meeting the ground: it loses clearance `now` by so much a metre
    /// (or gains it), and never by more than `most`.
    #[inline]
    fn leap(&self, clearance: f32, now: f32, most: f32) -> f32 {
        if clearance <= 0.0 {
            return 0.0;
        }
        // Where `clearance - now * t - bend * t * t / 2` is zero.
        let now = now + self.bend * BESIDE_M;
        let bending = 2.0 * clearance / (now + (now * now + 2.0 * self.bend * clearance).sqrt());
        bending.max(clearance / most)
    }

    /// How far over the ground a ray is; over what lies beyond the rectangle, not at all.
    #[inline]
    fn over(&self, ray: &Ray, at: f32) -> Over {
        let point = ray.point_at(at);
        let x = (point.x - self.low[0]) / CELL_M;
        let y = (point.y - self.low[1]) / CELL_M;
        let i = (x as i32).clamp(0, self.cells[0] as i32 - 1);
        let j = (y as i32).clamp(0, self.cells[1] as i32 - 1);
        let (u, v) = (x - i as f32, y - j as f32);
        let Some([h00, h10, h01, h11]) = self.corners(i as usize, j as usize) else {
            return Over {
                clearance: 0.0,
                closing: 0.0,
            };
        };
        let slope = if u >= v {
            [h10 - h00, h11 - h10]
        } else {
            [h11 - h01, h01 - h00]
        };
        Over {
            clearance: point.z - (h00 + slope[0] * u + slope[1] * v),
            closing: (slope[0] * ray.dir.x + slope[1] * ray.dir.y) / CELL_M - ray.dir.z,
        }
    }

    /// The heights at a cell's corners.
    #[inline]
    fn corners(&self, i: usize, j: usize) -> Option<[f32; 4]> {
        let row = self.cells[0] + 1;
        let corner = j * row + i;
        let near = self.heights.get(corner..corner + 2)?;
        let far = self.heights.get(corner + row..corner + row + 2)?;
        Some([near[0], near[1], far[0], far[1]])
    }

    /// A cell is cut along its diagonal; over each half the ray's clearance is a linear function
    /// of the way, so where it changes sign the ray meets the ground: no gap between triangles.
    fn within_cell(&self, ray: &Ray, enters: f32, leaves: f32, at: [i32; 2]) -> Option<Hit> {
        // Rounding may put an end of the ray beside the rectangle.
        let i = at[0].clamp(0, self.cells[0] as i32 - 1) as usize;
        let j = at[1].clamp(0, self.cells[1] as i32 - 1) as usize;
        let [h00, h10, h01, h11] = self.corners(i, j)?;
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
            // The clearance at the start of the ray, and how it changes.
            let start = ray.origin.z - (h00 + slope[0] * x + slope[1] * y);
            let change = ray.dir.z - (slope[0] * dx + slope[1] * dy);
            if start + change * end <= 0.0 && begin < end {
                // Below from the first: rounding at an edge that belongs to both.
                let distance = if change < 0.0 {
                    (-start / change).clamp(begin, end)
                } else {
                    begin
                };
                let [sx, sy] = slope.map(|s| s / CELL_M);
                return Some(Hit {
                    distance,
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
