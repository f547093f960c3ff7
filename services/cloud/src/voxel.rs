//! Voxel grid: one point for each occupied cube of space, the mean of what fell into it.
//!
//! In: positions. Out: the means, in the order in which their cubes were first met. A hash table
//! from cube to output is kept and reused; consecutive points of a LiDAR mostly share a cube, so
//! the last one is tried first.

use alloc::vec::Vec;

/// Cubes are numbered by 21 bits an axis: a metre-sized voxel reaches a thousand kilometres.
const BITS: u32 = 21;
const HALF: f32 = (1 << (BITS - 1)) as f32;
const FREE: u64 = u64::MAX;

/// Reduces clouds to one point a cube.
#[derive(Debug, Clone, Default)]
pub struct VoxelGrid {
    slots: Vec<(u64, u32)>,
    sums: Vec<Sum>,
}

#[derive(Debug, Clone, Copy)]
struct Sum {
    /// Relative to the cube's first point, so that single precision keeps millimetres anywhere.
    offset: [f32; 3],
    origin: [f32; 3],
    outer: [f32; 6],
    time: f32,
    count: u32,
    first: u32,
}

/// What fell into one cube.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Voxel {
    /// Mean of the points, metres.
    pub mean: [f32; 3],
    /// How many there were.
    pub count: f32,
    /// Mean of the points' times, in the caller's unit.
    pub time: f32,
    /// Sum of the outer products of the deviations from the mean, m²: xx, xy, xz, yy, yz, zz.
    pub scatter: [f32; 6],
}

impl VoxelGrid {
    /// Writes the mean of each cube of edge `size_m` to `out`, which is cleared first.
    ///
    /// Points that are not finite, or so far out that their cube has no number, are left out. A
    /// size that is not positive leaves the cloud as it is.
    pub fn reduce(
        &mut self,
        points: impl ExactSizeIterator<Item = [f32; 3]>,
        size_m: f32,
        out: &mut Vec<[f32; 3]>,
    ) {
        self.accumulate(points.map(|p| (p, 0.0)), size_m);
        out.clear();
        out.extend(self.sums.iter().map(|s| {
            let scale = 1.0 / s.count as f32;
            core::array::from_fn(|a| s.origin[a] + s.offset[a] * scale)
        }));
    }

    /// How many cubes are occupied.
    pub fn count(&mut self, points: impl ExactSizeIterator<Item = [f32; 3]>, size_m: f32) -> usize {
        self.accumulate(points.map(|p| (p, 0.0)), size_m);
        self.sums.len()
    }

    /// As [`VoxelGrid::reduce`], of points with times, and with the spread inside each cube.
    pub fn reduce_with_scatter(
        &mut self,
        points: impl ExactSizeIterator<Item = ([f32; 3], f32)>,
        size_m: f32,
        out: &mut Vec<Voxel>,
    ) {
        self.accumulate(points, size_m);
        out.clear();
        out.reserve(self.sums.capacity());
        out.extend(self.sums.iter().map(|s| {
            let count = s.count as f32;
            let mean = s.offset.map(|o| o / count);
            let spread = products(mean);
            Voxel {
                mean: core::array::from_fn(|a| s.origin[a] + mean[a]),
                count,
                time: s.time / count,
                scatter: core::array::from_fn(|i| s.outer[i] - count * spread[i]),
            }
        }));
    }

    /// As [`VoxelGrid::reduce`], but keeps one original point of each cube, the first: its index.
    pub fn first_in_each(
        &mut self,
        points: impl ExactSizeIterator<Item = [f32; 3]>,
        size_m: f32,
        out: &mut Vec<u32>,
    ) {
        self.accumulate(points.map(|p| (p, 0.0)), size_m);
        out.clear();
        out.extend(self.sums.iter().map(|s| s.first));
    }

    fn accumulate(&mut self, points: impl ExactSizeIterator<Item = ([f32; 3], f32)>, size_m: f32) {
        let capacity = (points.len() * 2).next_power_of_two().max(16);
        self.slots.clear();
        self.slots.resize(capacity, (FREE, 0));
        self.sums.clear();
        // A few more cubes than last time must not allocate.
        self.sums.reserve(points.len() / 4);
        let mask = capacity - 1;
        let inverse = if size_m > 0.0 { 1.0 / size_m } else { 0.0 };
        let (mut last_key, mut last) = (FREE, 0usize);
        for (index, (p, time)) in points.enumerate() {
            let Some(key) = cube(p, inverse).map(|k| if inverse > 0.0 { k } else { index as u64 })
            else {
                continue;
            };
            if key != last_key {
                last = self.slot_of(key, mask, p, index as u32);
                last_key = key;
            }
            let sum = &mut self.sums[last];
            let d: [f32; 3] = core::array::from_fn(|a| p[a] - sum.origin[a]);
            for (offset, d) in sum.offset.iter_mut().zip(d) {
                *offset += d;
            }
            for (s, product) in sum.outer.iter_mut().zip(products(d)) {
                *s += product;
            }
            sum.time += time;
            sum.count += 1;
        }
    }

    /// Where the cube's sum is, made if it is new.
    #[inline]
    fn slot_of(&mut self, key: u64, mask: usize, p: [f32; 3], index: u32) -> usize {
        let mut at = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & mask;
        loop {
            let (found, sum) = self.slots[at];
            if found == key {
                return sum as usize;
            }
            if found == FREE {
                let new = self.sums.len();
                self.slots[at] = (key, new as u32);
                self.sums.push(Sum {
                    offset: [0.0; 3],
                    outer: [0.0; 6],
                    time: 0.0,
                    origin: p,
                    count: 0,
                    first: index,
                });
                return new;
            }
            at = (at + 1) & mask;
        }
    }
}

/// The number of the cube that holds `p`.
#[inline]
fn cube(p: [f32; 3], inverse: f32) -> Option<u64> {
    let mut key = 0u64;
    for c in p {
        let scaled = c * inverse + HALF;
        // Also false for NaN.
        if !(0.0..2.0 * HALF).contains(&scaled) {
            return None;
        }
        key = key << BITS | scaled as u64;
    }
    Some(key)
}

/// The upper triangle of `d d'`.
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
