//! Submaps: the surfaces seen around a node, in the node's levelled frame.
//!
//! In: scans placed in the node's frame. Out: one piece of surface for each occupied cube, with a
//! normal, an intensity and the place it was first seen from; never more than a set number, the
//! cubes grow instead. Elsewhere: bytes ([`codec`](crate::codec)), placing scans (odometry).

use hachi_cloud::surface::least_eigenvector;
use rayon::prelude::*;

/// A submap's most points. Six thousand tell a room or a street corner apart from any other, and
/// are 60 kB on disk.
pub const MOST_POINTS: usize = 6_000;

/// Finest cubes: below, a LiDAR's noise fills them one by one.
pub const FINEST_M: f32 = 0.1;

/// Most places a submap's points are said to have been seen from.
pub const MOST_VIEWPOINTS: usize = 32;

/// Fewer returns than this say nothing about a surface.
const LEAST: f32 = 6.0;

/// A cube counts for at most this many returns in a neighbour's normal.
const MOST_IN_NEIGHBOUR: f32 = 20.0;

/// Cubes beyond `MOST_POINTS` times this are merged while the submap still grows.
const ROOM: usize = 4;

/// Points handed to one task, fixed for the same work with any number of threads.
const CHUNK: usize = 256;

const FREE: u32 = u32::MAX;

/// A piece of surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SubmapPoint {
    /// Node frame, metres.
    pub position: [f32; 3],
    /// Unit normal, towards where it was seen from; zero where there is no one surface.
    pub normal: [f32; 3],
    /// 0 to 255.
    pub intensity: u8,
    /// Index into the submap's viewpoints.
    pub viewpoint: u8,
}

/// The surfaces around a node.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Submap {
    /// Edge of the cubes it was reduced by, metres.
    pub voxel_m: f32,
    /// Where the sensor was when it saw the points, node frame.
    pub viewpoints: Vec<[f32; 3]>,
    /// The surfaces, in the order in which their cubes were first met.
    pub points: Vec<SubmapPoint>,
}

impl Submap {
    /// Bytes it takes in memory.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.points.capacity() * size_of::<SubmapPoint>()
            + self.viewpoints.capacity() * size_of::<[f32; 3]>()
    }
}

#[derive(Debug, Clone, Copy)]
struct Cell {
    key: [i32; 3],
    count: f32,
    mean: [f32; 3],
    scatter: [f32; 6],
    intensity: f32,
    viewpoint: u8,
}

/// Gathers a submap, scan by scan; keeps its buffers.
#[derive(Debug, Clone)]
pub struct SubmapBuilder {
    voxel_m: f32,
    cells: Vec<Cell>,
    slots: Vec<u32>,
    viewpoints: Vec<[f32; 3]>,
    scans: usize,
    normals: Vec<[f32; 3]>,
}

impl Default for SubmapBuilder {
    fn default() -> Self {
        Self {
            voxel_m: FINEST_M,
            cells: Vec::new(),
            slots: vec![FREE; 1 << 14],
            viewpoints: Vec::new(),
            scans: 0,
            normals: Vec::new(),
        }
    }
}

impl SubmapBuilder {
    /// Empties it for the next node. Its cubes stay the size that the last one ended with, or a
    /// little finer if that one was far from full.
    pub fn clear(&mut self) {
        if self.cells.len() < MOST_POINTS / 2 {
            self.voxel_m = (self.voxel_m / GROWTH).max(FINEST_M);
        }
        self.cells.clear();
        self.slots.fill(FREE);
        self.viewpoints.clear();
        self.scans = 0;
    }

    /// Edge of a cube so far, metres.
    pub fn voxel_m(&self) -> f32 {
        self.voxel_m
    }

    /// How many scans joined.
    pub fn scans(&self) -> usize {
        self.scans
    }

    /// Whether no point joined.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Adds a scan seen from `viewpoint`: positions in the node's frame with intensities. What is
    /// not finite, or farther than 10 km, is passed over.
    pub fn add(&mut self, viewpoint: [f32; 3], points: impl Iterator<Item = ([f32; 3], f32)>) {
        self.scans += 1;
        let viewpoint = if self.viewpoints.len() < MOST_VIEWPOINTS {
            self.viewpoints.push(viewpoint);
            self.viewpoints.len() - 1
        } else {
            MOST_VIEWPOINTS - 1
        };
        for (p, intensity) in points {
            let Some(key) = key_of(p, 1.0 / self.voxel_m) else {
                continue;
            };
            let index = self.find_or_add(key, p, viewpoint as u8);
            self.cells[index].add(p, intensity);
        }
        while self.cells.len() > ROOM * MOST_POINTS {
            self.coarsen();
        }
    }

    /// The submap so far; merges cubes until there are few enough.
    pub fn finish(&mut self, out: &mut Submap) {
        while self.cells.len() > MOST_POINTS {
            self.coarsen();
        }
        let mut normals = std::mem::take(&mut self.normals);
        normals.clear();
        normals.resize(self.cells.len(), [0.0; 3]);
        normals
            .par_chunks_mut(CHUNK)
            .zip(self.cells.par_chunks(CHUNK))
            .for_each(|(normals, cells)| {
                for (normal, cell) in normals.iter_mut().zip(cells) {
                    *normal = self.normal_of(cell);
                }
            });
        out.voxel_m = self.voxel_m;
        out.viewpoints.clear();
        out.viewpoints.extend_from_slice(&self.viewpoints);
        out.points.clear();
        out.points
            .extend(self.cells.iter().zip(&normals).map(|(cell, &normal)| {
                let eye = self.viewpoints[usize::from(cell.viewpoint)];
                let towards: f32 = (0..3).map(|a| normal[a] * (eye[a] - cell.mean[a])).sum();
                SubmapPoint {
                    position: cell.mean,
                    normal: if towards < 0.0 {
                        normal.map(|n| -n)
                    } else {
                        normal
                    },
                    intensity: (cell.intensity / cell.count).round() as u8,
                    viewpoint: cell.viewpoint,
                }
            }));
        self.normals = normals;
    }

    /// Makes the cubes larger, merging what falls together.
    fn coarsen(&mut self) {
        self.voxel_m *= GROWTH;
        let old = std::mem::take(&mut self.cells);
        self.slots.fill(FREE);
        for cell in &old {
            if let Some(key) = key_of(cell.mean, 1.0 / self.voxel_m) {
                let index = self.find_or_add(key, cell.mean, cell.viewpoint);
                self.cells[index].merge(cell);
            }
        }
    }

    fn normal_of(&self, cell: &Cell) -> [f32; 3] {
        if cell.count >= LEAST
            && let Some(normal) = flat_normal(cell.count, cell.scatter)
        {
            return normal;
        }
        // Too few returns, or one ring's line: look at the cubes around as well.
        let (mut count, mut sum, mut scatter) = (0.0f32, [0.0f32; 3], [0.0f32; 6]);
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let key = [cell.key[0] + x, cell.key[1] + y, cell.key[2] + z];
                    let Some(other) = self.find(key) else {
                        continue;
                    };
                    let weight = other.count.min(MOST_IN_NEIGHBOUR);
                    let share = weight / other.count;
                    let d: [f32; 3] = std::array::from_fn(|a| other.mean[a] - cell.mean[a]);
                    count += weight;
                    for a in 0..3 {
                        sum[a] += weight * d[a];
                    }
                    for (i, product) in products(d).into_iter().enumerate() {
                        scatter[i] += share * other.scatter[i] + weight * product;
                    }
                }
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
            match self.slots[at] {
                FREE => return None,
                index if self.cells[index as usize].key == key => {
                    return Some(&self.cells[index as usize]);
                }
                _ => at = (at + 1) & mask,
            }
        }
    }

    fn find_or_add(&mut self, key: [i32; 3], mean: [f32; 3], viewpoint: u8) -> usize {
        if (self.cells.len() + 1) * 2 > self.slots.len() {
            self.grow();
        }
        let mask = self.slots.len() - 1;
        let mut at = hash(key) & mask;
        loop {
            let index = self.slots[at];
            if index == FREE {
                self.slots[at] = self.cells.len() as u32;
                self.cells.push(Cell {
                    key,
                    count: 0.0,
                    mean,
                    scatter: [0.0; 6],
                    intensity: 0.0,
                    viewpoint,
                });
                return self.cells.len() - 1;
            }
            if self.cells[index as usize].key == key {
                return index as usize;
            }
            at = (at + 1) & mask;
        }
    }

    fn grow(&mut self) {
        let size = self.slots.len() * 2;
        self.slots.clear();
        self.slots.resize(size, FREE);
        let mask = size - 1;
        for (index, cell) in self.cells.iter().enumerate() {
            let mut at = hash(cell.key) & mask;
            while self.slots[at] != FREE {
                at = (at + 1) & mask;
            }
            self.slots[at] = index as u32;
        }
    }
}

/// Cubes grow by this when there are too many: surfaces then halve.
const GROWTH: f32 = std::f32::consts::SQRT_2;

impl Cell {
    fn add(&mut self, p: [f32; 3], intensity: f32) {
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
        if intensity.is_finite() {
            self.intensity += intensity.clamp(0.0, 255.0);
        }
    }

    fn merge(&mut self, other: &Self) {
        let total = self.count + other.count;
        let d: [f32; 3] = std::array::from_fn(|a| other.mean[a] - self.mean[a]);
        let share = self.count * other.count / total;
        for (i, product) in products(d).into_iter().enumerate() {
            self.scatter[i] += other.scatter[i] + share * product;
        }
        for (mean, d) in self.mean.iter_mut().zip(d) {
            *mean += d * other.count / total;
        }
        self.intensity += other.intensity;
        self.count = total;
    }
}

/// The normal, if the spread is that of a surface and not of a line or a ball.
fn flat_normal(count: f32, scatter: [f32; 6]) -> Option<[f32; 3]> {
    let (variances, normal) = least_eigenvector(scatter.map(|s| f64::from(s / count)));
    let [least, middle, largest] = variances;
    (middle > 0.04 * largest && least < 0.25 * middle).then(|| normal.map(|v| v as f32))
}

#[inline]
fn key_of(p: [f32; 3], inverse: f32) -> Option<[i32; 3]> {
    const FAR_M: f32 = 1e4;
    let within = p.iter().all(|c| c.abs() < FAR_M);
    // Also false for what is not a number.
    within.then(|| p.map(|c| (c * inverse).floor() as i32))
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

    /// A floor at -0.5 m and a wall at x = 4 m, `step_m` apart.
    fn corner(step_m: f32) -> Vec<([f32; 3], f32)> {
        let n = (8.0 / step_m) as i32;
        let at = |i: i32| i as f32 * step_m - 4.0;
        let mut points = Vec::new();
        for i in 0..n {
            for j in 0..n {
                points.push(([at(i), at(j), -0.5], 40.0));
                points.push(([4.0, at(i), -0.5 + (at(j) + 4.0) * 0.3], 90.0));
            }
        }
        points
    }

    #[test]
    fn surfaces_carry_their_normal_and_intensity() {
        let mut builder = SubmapBuilder::default();
        builder.add([0.0; 3], corner(0.04).into_iter());
        let mut submap = Submap::default();
        builder.finish(&mut submap);
        assert!(submap.points.len() <= MOST_POINTS);
        for p in &submap.points {
            let [x, y, z] = p.position;
            if x < 3.0 && x.abs() < 3.5 && y.abs() < 3.5 {
                assert!(
                    p.normal[2] > 0.99,
                    "the floor looks up at the sensor: {p:?}"
                );
                assert_eq!(p.intensity, 40);
            }
            if z > 0.0 && z < 1.4 && y.abs() < 3.5 {
                assert!(p.normal[0] < -0.99, "{p:?}");
                assert_eq!(p.intensity, 90);
            }
        }
    }

    #[test]
    fn a_large_scene_makes_larger_cubes_and_never_more_points() {
        let mut builder = SubmapBuilder::default();
        for _ in 0..3 {
            builder.add(
                [0.0; 3],
                corner(0.02)
                    .into_iter()
                    .map(|(p, i)| (p.map(|c| c * 8.0), i)),
            );
        }
        let mut submap = Submap::default();
        builder.finish(&mut submap);
        assert!(submap.points.len() <= MOST_POINTS && submap.points.len() > MOST_POINTS / 4);
        assert!(submap.voxel_m > FINEST_M);
    }

    #[test]
    fn points_that_are_not_numbers_are_passed_over() {
        let mut builder = SubmapBuilder::default();
        let odd = [
            [f32::NAN, 0.0, 0.0],
            [f32::INFINITY, 1.0, 1.0],
            [1e9, 0.0, 0.0],
        ];
        builder.add([0.0; 3], odd.into_iter().map(|p| (p, f32::NAN)));
        assert!(builder.is_empty());
        let mut submap = Submap::default();
        builder.finish(&mut submap);
        assert!(submap.points.is_empty());
    }
}
