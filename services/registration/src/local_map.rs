//! A growing local map: one piece of surface for each occupied cell of space.
//!
//! In: points in the map's frame, scan after scan. Out: the nearest surface, as a
//! [`SurfaceTarget`]. Every cell keeps the count, mean and scatter of what fell into it, so that
//! noise averages out over scans and rings that sweep past fill in the surface between them; its
//! normal comes from its own scatter, or with its neighbours' where its own is a bare line.
//!
//! Cells live in an open-addressing table of fixed slots; those far from the robot are dropped
//! when it has moved on, so memory stays flat however long the walk.

use hachi_cloud::surface::least_eigenvector;

use crate::cloud::SurfacePoint;
use crate::linearize::SurfaceTarget;

const FREE: u32 = u32::MAX;

/// Cells there is room for from the start, 2 MB: a floor of a building needs no more, and growing
/// costs a millisecond when it comes. A power of two.
const CELLS: usize = 1 << 15;

/// After this many points, and as many scans, a cell forgets half: what moved away fades. Beside a
/// wall one scan fills a cell, and a map of the last scan alone moves along with whatever pulls on
/// it.
const FULL: f32 = 400.0;
const FULL_SCANS: u16 = 12;

/// Fewer points than this say nothing about a surface.
const LEAST: f32 = 6.0;

/// Settings of a local map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalMapConfig {
    /// Edge of a cell.
    pub cell_m: f32,
    /// Cells farther from the robot than this are dropped.
    pub range_m: f32,
}

#[derive(Debug, Clone, Copy)]
struct Cell {
    key: [i32; 3],
    count: f32,
    /// Scans that fell into it, halved whenever the count is.
    scans: u16,
    mean: [f32; 3],
    scatter: [f32; 6],
    normal: [f32; 3],
    touched: bool,
    /// In which stretch of the way a point last fell into it.
    seen: u32,
}

/// The map.
#[derive(Debug, Clone)]
pub struct LocalMap {
    config: LocalMapConfig,
    cells: Vec<Cell>,
    slots: Vec<u32>,
    touched: Vec<u32>,
    scans: u32,
    /// Stretches of the way so far, as [`LocalMap::keep_around`] counts them.
    stretch: u32,
}

impl LocalMap {
    /// An empty map. Cells are never larger than the range.
    pub fn new(config: LocalMapConfig) -> Self {
        Self {
            config,
            cells: Vec::with_capacity(CELLS),
            slots: vec![FREE; 2 * CELLS],
            touched: Vec::with_capacity(CELLS / 4),
            scans: 0,
            stretch: 0,
        }
    }

    /// Edge of a cell, metres.
    pub fn cell_m(&self) -> f32 {
        self.config.cell_m
    }

    /// How many cells are occupied.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// How many scans it is made of.
    pub fn scans(&self) -> u32 {
        self.scans
    }

    /// Whether nothing was inserted yet.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Empties the map.
    pub fn clear(&mut self) {
        self.cells.clear();
        self.slots.fill(FREE);
        self.scans = 0;
    }

    /// The surfaces known, for those who draw them.
    pub fn surfaces(&self) -> impl Iterator<Item = SurfacePoint> + '_ {
        self.cells.iter().map(|c| SurfacePoint {
            position: c.mean,
            normal: c.normal,
        })
    }

    /// Adds a scan's points (map frame, metres); those that are not finite are passed over.
    pub fn insert(&mut self, points: impl Iterator<Item = [f32; 3]>) {
        let inverse = 1.0 / self.config.cell_m;
        self.scans = self.scans.saturating_add(1);
        for p in points {
            let Some(key) = key_of(p, inverse) else {
                continue;
            };
            let index = self.find_or_add(key, p);
            let cell = &mut self.cells[index];
            if !cell.touched {
                cell.touched = true;
                cell.seen = self.stretch;
                cell.begin_scan();
                self.touched.push(index as u32);
            }
            cell.add(p);
        }
        for i in 0..self.touched.len() {
            let index = self.touched[i] as usize;
            self.cells[index].touched = false;
            self.cells[index].normal = self.normal_of(index);
        }
        self.touched.clear();
    }

    /// Ends a stretch of the way at `centre`. Drops every cell farther than the map's range from there,
    /// and every cell into which nothing fell during the last `stretches` of them: poses drift
    /// meanwhile, and what was seen before the drift contradicts what is seen after it.
    pub fn keep_around(&mut self, centre: [f32; 3], stretches: u32) {
        self.stretch = self.stretch.wrapping_add(1);
        let stretch = self.stretch;
        let range_sq = self.config.range_m * self.config.range_m;
        let near = |c: &Cell| -> bool {
            let d: [f32; 3] = std::array::from_fn(|a| c.mean[a] - centre[a]);
            let is_recent = stretch.wrapping_sub(c.seen) <= stretches;
            is_recent && d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= range_sq
        };
        self.cells.retain(near);
        self.rebuild_slots();
    }

    /// Moves the map's origin by whole cells; for a robot that walks farther than single precision
    /// reaches. Every position becomes smaller by `cells` times the cell's edge.
    pub fn shift_origin(&mut self, cells: [i32; 3]) {
        let shift = cells.map(|c| c as f32 * self.config.cell_m);
        for cell in &mut self.cells {
            for a in 0..3 {
                cell.key[a] -= cells[a];
                cell.mean[a] -= shift[a];
            }
        }
        self.rebuild_slots();
    }

    /// Changes the cell size: cells merge into larger ones, or stand as single ones in finer.
    pub fn rescale(&mut self, cell_m: f32) {
        let old = std::mem::take(&mut self.cells);
        self.config.cell_m = cell_m;
        self.slots.fill(FREE);
        for cell in &old {
            let Some(key) = key_of(cell.mean, 1.0 / cell_m) else {
                continue;
            };
            let known = self.cells.len();
            let index = self.find_or_add(key, cell.mean);
            let into = &mut self.cells[index];
            into.merge(cell);
            into.seen = if index < known {
                into.seen.max(cell.seen)
            } else {
                cell.seen
            };
        }
        for index in 0..self.cells.len() {
            self.cells[index].normal = self.normal_of(index);
        }
    }

    fn rebuild_slots(&mut self) {
        self.slots.fill(FREE);
        for index in 0..self.cells.len() {
            let slot = self.free_slot(self.cells[index].key);
            self.slots[slot] = index as u32;
        }
    }

    fn normal_of(&self, index: usize) -> [f32; 3] {
        let cell = &self.cells[index];
        if cell.count >= LEAST
            && let Some(normal) = flat_normal(cell.count, cell.scatter)
        {
            return normal;
        }
        // Too few, or a line: look at the cells around as well.
        let (mut count, mut sum, mut scatter) = (0.0f32, [0.0f32; 3], [0.0f32; 6]);
        for around in neighbourhood() {
            let key = std::array::from_fn(|a| cell.key[a] + around[a]);
            let Some(other) = self.find(key) else {
                continue;
            };
            let d: [f32; 3] = std::array::from_fn(|a| other.mean[a] - cell.mean[a]);
            count += other.count;
            for a in 0..3 {
                sum[a] += other.count * d[a];
            }
            let spread = products(d);
            for i in 0..6 {
                scatter[i] += other.scatter[i] + other.count * spread[i];
            }
        }
        if count < LEAST {
            return [0.0; 3];
        }
        let mean = products(sum.map(|s| s / count));
        for i in 0..6 {
            scatter[i] -= count * mean[i];
        }
        flat_normal(count, scatter).unwrap_or([0.0; 3])
    }

    fn find(&self, key: [i32; 3]) -> Option<&Cell> {
        let mask = self.slots.len() - 1;
        let mut at = hash(key) & mask;
        loop {
            let index = self.slots[at];
            if index == FREE {
                return None;
            }
            let cell = &self.cells[index as usize];
            if cell.key == key {
                return Some(cell);
            }
            at = (at + 1) & mask;
        }
    }

    fn find_or_add(&mut self, key: [i32; 3], p: [f32; 3]) -> usize {
        if (self.cells.len() + 1) * 2 > self.slots.len() {
            self.grow();
        }
        let mask = self.slots.len() - 1;
        let mut at = hash(key) & mask;
        loop {
            let index = self.slots[at];
            if index == FREE {
                let new = self.cells.len();
                self.slots[at] = new as u32;
                self.cells.push(Cell {
                    key,
                    count: 0.0,
                    scans: 0,
                    mean: p,
                    scatter: [0.0; 6],
                    normal: [0.0; 3],
                    touched: false,
                    seen: self.stretch,
                });
                return new;
            }
            if self.cells[index as usize].key == key {
                return index as usize;
            }
            at = (at + 1) & mask;
        }
    }

    fn grow(&mut self) {
        let size = self.slots.len() * 2;
        self.slots.resize(size, FREE);
        self.rebuild_slots();
    }

    fn free_slot(&self, key: [i32; 3]) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = hash(key) & mask;
        while self.slots[at] != FREE {
            at = (at + 1) & mask;
        }
        at
    }
}

impl SurfaceTarget for LocalMap {
    /// Looks at the eight cells whose common corner is nearest to `point`, which hold every mean
    /// within half a cell; with a reach beyond a cell, at all 27 around.
    fn closest(&self, point: [f32; 3], max_distance_sq: f32) -> Option<SurfacePoint> {
        let inverse = 1.0 / self.config.cell_m;
        let key = key_of(point, inverse)?;
        let wide = max_distance_sq > self.config.cell_m * self.config.cell_m;
        let mut best: Option<&Cell> = None;
        let mut best_sq = max_distance_sq;
        let (low, high): ([i32; 3], [i32; 3]) = if wide {
            (key.map(|k| k - 1), key.map(|k| k + 1))
        } else {
            let low: [i32; 3] = std::array::from_fn(|a| {
                let within = point[a] * inverse - key[a] as f32;
                if within < 0.5 { key[a] - 1 } else { key[a] }
            });
            (low, low.map(|k| k + 1))
        };
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let Some(cell) = self.find([x, y, z]) else {
                        continue;
                    };
                    let d: [f32; 3] = std::array::from_fn(|a| cell.mean[a] - point[a]);
                    let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                    if distance_sq < best_sq {
                        best_sq = distance_sq;
                        best = Some(cell);
                    }
                }
            }
        }
        best.map(|c| SurfacePoint {
            position: c.mean,
            normal: c.normal,
        })
    }
}

impl Cell {
    /// Forgets half of a full cell, before a scan falls into it.
    fn begin_scan(&mut self) {
        if self.count >= FULL && self.scans >= FULL_SCANS {
            self.count *= 0.5;
            self.scans /= 2;
            self.scatter = self.scatter.map(|s| s * 0.5);
        }
        self.scans += 1;
    }

    fn add(&mut self, p: [f32; 3]) {
        let before = self.count;
        self.count += 1.0;
        let d: [f32; 3] = std::array::from_fn(|a| p[a] - self.mean[a]);
        for (mean, d) in self.mean.iter_mut().zip(d) {
            *mean += d / self.count;
        }
        let share = before / self.count;
        for (s, product) in self.scatter.iter_mut().zip(products(d)) {
            *s += share * product;
        }
    }

    /// Takes in all that fell into another cell.
    fn merge(&mut self, other: &Self) {
        let total = self.count + other.count;
        if total <= 0.0 {
            return;
        }
        let d: [f32; 3] = std::array::from_fn(|a| other.mean[a] - self.mean[a]);
        let share = self.count * other.count / total;
        for (i, product) in products(d).into_iter().enumerate() {
            self.scatter[i] += other.scatter[i] + share * product;
        }
        for (mean, d) in self.mean.iter_mut().zip(d) {
            *mean += d * other.count / total;
        }
        self.count = total;
        self.scans = self.scans.max(other.scans);
    }
}

/// The normal, if the spread is that of a surface and not of a line or a ball.
fn flat_normal(count: f32, scatter: [f32; 6]) -> Option<[f32; 3]> {
    let (variances, normal) = least_eigenvector(scatter.map(|s| f64::from(s / count)));
    let [least, middle, largest] = variances;
    (middle > 0.04 * largest && least < 0.25 * middle).then(|| normal.map(|v| v as f32))
}

fn neighbourhood() -> impl Iterator<Item = [i32; 3]> {
    (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])))
}

#[inline]
fn key_of(p: [f32; 3], inverse: f32) -> Option<[i32; 3]> {
    const LIMIT: f32 = (1 << 30) as f32;
    let mut key = [0; 3];
    for a in 0..3 {
        let scaled = (p[a] * inverse).floor();
        if scaled.is_nan() || scaled.abs() >= LIMIT {
            return None;
        }
        key[a] = scaled as i32;
    }
    Some(key)
}

#[inline]
fn hash(key: [i32; 3]) -> usize {
    let mixed = (key[0] as u32 as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (key[1] as u32 as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (key[2] as u32 as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    (mixed >> 32) as usize
}

#[inline]
fn products(d: [f32; 3]) -> [f32; 6] {
    [
        d[0] * d[0],
        d[0] * d[1],
        d[0] * d[2],
        d[1] * d[1],
        d[1] * d[2],
        d[2] * d[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall 0.2 m beside a standing robot, seen by 2000 points a scan, `x` away.
    fn wall(x: f32) -> impl Iterator<Item = [f32; 3]> {
        (0..2000u16).map(move |i| [x, f32::from(i % 50) * 0.01, f32::from(i / 50) * 0.01])
    }

    #[test]
    fn one_scan_does_not_move_a_wall_however_many_points_it_has() {
        let mut map = LocalMap::new(LocalMapConfig {
            cell_m: 0.5,
            range_m: 100.0,
        });
        for _ in 0..50 {
            map.insert(wall(0.2));
        }
        map.insert(wall(0.22));
        let moved = map
            .surfaces()
            .map(|s| s.position[0] - 0.2)
            .fold(0.0, f32::max);
        assert!(moved > 0.0 && moved < 0.004, "{moved}");
        // What has really moved is where it is now after some seconds.
        for _ in 0..50 {
            map.insert(wall(0.22));
        }
        let off = map
            .surfaces()
            .map(|s| (s.position[0] - 0.22).abs())
            .fold(0.0, f32::max);
        assert!(off < 0.001, "{off}");
    }

    #[test]
    fn surfaces_leave_that_are_far_or_were_not_seen_for_long() {
        let mut map = LocalMap::new(LocalMapConfig {
            cell_m: 1.0,
            range_m: 50.0,
        });
        let (seen_once, seen_again, far) = ([1.5, 0.5, 0.5], [5.5, 0.5, 0.5], [90.5, 0.5, 0.5]);
        map.insert([seen_once, seen_again, far].into_iter());
        let positions = |map: &LocalMap| map.surfaces().map(|s| s.position).collect::<Vec<_>>();
        map.keep_around([0.0; 3], 2);
        assert_eq!(positions(&map), [seen_once, seen_again]);
        map.insert([seen_again].into_iter());
        map.rescale(0.9);
        map.keep_around([0.0; 3], 2);
        assert_eq!(positions(&map).len(), 2);
        map.keep_around([0.0; 3], 2);
        assert_eq!(positions(&map), [seen_again]);
        assert!(map.closest(seen_once, 0.1).is_none());
    }
}
