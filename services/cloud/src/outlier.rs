//! Statistical outlier removal that knows a scan thins out with distance.
//!
//! In: points in the sensor frame. Out: labels [`Reason::Outlier`]. For each point the mean
//! distance to its nearest neighbours is divided by its range, since a turning LiDAR's points on a
//! surface are `range * angular step` apart: a far wall is as dense as a near one, and only what
//! stands alone in its direction stands out. A point goes if this spacing exceeds the cloud's mean
//! by a number of standard deviations.
//!
//! The three neighbours to each side on a point's own ring (`chains`) bound its spacing from above,
//! and for most points they are the nearest. Only of those whose bound is above the limit are the
//! neighbours searched in the direction grid, and of a sample of the others for the statistics.

use alloc::vec::Vec;

use hachi_hal::Point;

use crate::angular::{AngularGrid, LANES};
use crate::chains::Chains;
use crate::float::sqrt;
use crate::label::Reason;

/// Neighbours averaged: on one ring, three to each side.
const NEIGHBOURS: usize = 6;
/// Smaller clouds have no statistics.
const FEWEST: usize = NEIGHBOURS + 2;
/// Nearer than this the spacing is set by range noise, not by the angular step: three steps of
/// 0.2 degrees are 3 cm at 3 m, the VLP-16's stated accuracy (user manual, specifications).
const NOISE_RANGE_M: f32 = 3.0;
/// Neighbours within this share of the range (or of [`NOISE_RANGE_M`]) are as near as they get:
/// three steps, and the noise at 3 m. With all of them so near there is nothing to search.
const NEAR_ENOUGH: f32 = 0.01;
/// Spacing counted for a neighbour that is missing, and the most counted for one that is found:
/// more than two cells of the direction grid. It keeps one stray point from widening the standard
/// deviation for all.
const MISSING: f32 = 0.06;
/// To each side on the ring.
const REACH: usize = NEIGHBOURS / 2;
/// Above this a bound is wide: twice what is near enough.
const WIDE: f32 = 2.0 * NEAR_ENOUGH;
/// Points of each kind, closely and widely spaced, searched for the statistics, at most: their
/// mean spacing is then known to a few percent of its deviation.
const SAMPLED: usize = 512;

/// Labels points that stand alone. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct OutlierFilter {
    grid: AngularGrid,
    stage: OutlierStage,
}

impl OutlierFilter {
    /// Labels the kept points whose spacing exceeds mean plus `sigmas` standard deviations.
    ///
    /// Points are in the frame of the sensor that saw them, from one place. Clouds of fewer than
    /// 8 points are left alone: they have no statistics.
    pub fn label(&mut self, points: &[Point], sigmas: f32, labels: &mut [Reason]) {
        self.grid.build(points, labels);
        self.stage.label(&self.grid, points, sigmas, labels);
    }
}

/// As [`OutlierFilter`], on a grid built already.
#[derive(Debug, Clone, Default)]
pub(crate) struct OutlierStage {
    chains: Chains,
    /// For each lag along the rings, the distances from each point to the one so far on.
    apart: [Vec<f32>; REACH],
    /// Upper bounds of the points' spacings, in the order of `chains`.
    spacing: Vec<f32>,
    /// Those of them that a search may lower.
    unsettled: Vec<u32>,
}

impl OutlierStage {
    pub(crate) fn label(
        &mut self,
        grid: &AngularGrid,
        points: &[Point],
        sigmas: f32,
        labels: &mut [Reason],
    ) {
        if grid.sorted().len() < FEWEST {
            return;
        }
        self.chains.build(grid, points);
        self.bound_by_ring();
        let limit = self.limit(grid, sigmas);
        for &at in &self.unsettled {
            let label = &mut labels[self.chains.index()[at as usize] as usize];
            let is_suspect = self.spacing[at as usize] > limit && label.is_kept();
            if is_suspect
                && !has_enough_within(grid, &self.chains, at as usize, limit)
                && self.search(grid, at as usize) > limit
            {
                *label = Reason::Outlier;
            }
        }
    }

    /// Fills `spacing` and `unsettled` from the neighbours on the rings.
    fn bound_by_ring(&mut self) {
        let count = self.chains.len();
        let [xs, ys, zs] = self.chains.coordinates();
        for (lag, apart) in (1..).zip(&mut self.apart) {
            apart.clear();
            let from = xs.iter().zip(ys).zip(zs);
            let to = xs[lag..].iter().zip(&ys[lag..]).zip(&zs[lag..]);
            apart.extend(from.zip(to).map(|(((x, y), z), ((a, b), c))| {
                let (dx, dy, dz) = (a - x, b - y, c - z);
                sqrt(dx * dx + dy * dy + dz * dz)
            }));
        }
        self.spacing.clear();
        self.spacing.resize(count, MISSING);
        self.unsettled.clear();
        self.unsettled.resize(count, 0);
        // The first and the last have no full neighbourhood on the ring.
        let mut unsettled = 0;
        for at in (0..REACH).chain(count - REACH..count) {
            self.unsettled[unsettled] = at as u32;
            unsettled += 1;
        }
        let inner = count - 2 * REACH;
        let distances = &self.chains.distance()[REACH..][..inner];
        let spacing = &mut self.spacing[REACH..][..inner];
        let [one, two, three] = &self.apart;
        let (before, after) = (
            [&one[2..][..inner], &two[1..][..inner], &three[..inner]],
            [&one[3..][..inner], &two[3..][..inner], &three[3..][..inner]],
        );
        for i in 0..inner {
            let scale = 1.0 / greater(distances[i], NOISE_RANGE_M);
            let (mut sum, mut farthest) = (0.0, 0.0);
            for lag in 0..REACH {
                let (b, a) = (before[lag][i] * scale, after[lag][i] * scale);
                sum += less(b, MISSING) + less(a, MISSING);
                farthest = greater(farthest, greater(a, b));
            }
            spacing[i] = sum * (1.0 / NEIGHBOURS as f32);
            self.unsettled[unsettled] = (i + REACH) as u32;
            unsettled += usize::from(farthest > NEAR_ENOUGH);
        }
        self.unsettled.truncate(unsettled);
    }

    /// Mean plus `sigmas` standard deviations of the spacings, those of the unsettled points from
    /// an even sample of the closely and one of the widely spaced.
    fn limit(&self, grid: &AngularGrid, sigmas: f32) -> f32 {
        let (mut sum, mut sum_sq) = sums(&self.spacing);
        for is_wide in [false, true] {
            let spacings = (self.unsettled.iter().map(|at| *at as usize))
                .filter(|at| (self.spacing[*at] > WIDE) == is_wide);
            let (mut bounds, mut bounds_sq, mut count) = (0.0, 0.0, 0usize);
            for at in spacings.clone() {
                let bound = f64::from(self.spacing[at]);
                bounds += bound;
                bounds_sq += bound * bound;
                count += 1;
            }
            let step = count.div_ceil(SAMPLED).max(1);
            let (mut sampled, mut sampled_sq, mut samples) = (0.0, 0.0, 0u32);
            for at in spacings.step_by(step) {
                let spacing = f64::from(self.search(grid, at));
                sampled += spacing;
                sampled_sq += spacing * spacing;
                samples += 1;
            }
            let weight = count as f64 / f64::from(samples.max(1));
            sum += sampled * weight - bounds;
            sum_sq += sampled_sq * weight - bounds_sq;
        }
        let count = self.spacing.len() as f64;
        let mean = sum / count;
        let variance = (sum_sq / count - mean * mean).max(0.0);
        mean as f32 + sigmas * sqrt(variance as f32)
    }

    /// Mean distance to the nearest neighbours of a point, in shares of its range.
    fn search(&self, grid: &AngularGrid, at: usize) -> f32 {
        let position = self.chains.position(at);
        let range = self.chains.distance()[at].max(NOISE_RANGE_M);
        // No more than the farthest neighbour on the ring.
        let mut farthest = MISSING * range;
        if at >= REACH && at + REACH < self.chains.len() {
            let on_ring = (1..).zip(&self.apart);
            let on_ring = on_ring.map(|(lag, apart)| apart[at].max(apart[at - lag]));
            farthest = farthest.min(on_ring.fold(0.0, f32::max));
        }
        let mut nearest = Nearest::within(farthest);
        let coordinates = grid.coordinates();
        grid.spans_around_point(self.chains.index()[at], |start, end| {
            nearest.take(coordinates, position, start, end);
        });
        nearest.sum() / (range * NEIGHBOURS as f32)
    }
}

/// Sum and sum of squares.
fn sums(values: &[f32]) -> (f64, f64) {
    // Short stretches in single precision, which the compiler computes several at a time.
    values.chunks(64).fold((0.0, 0.0), |(sum, sum_sq), chunk| {
        let mut lanes = [[0.0f32; LANES]; 2];
        for block in chunk.chunks(LANES) {
            for (lane, value) in block.iter().enumerate() {
                lanes[0][lane] += value;
                lanes[1][lane] += value * value;
            }
        }
        let [part, part_sq] = lanes.map(|lanes| lanes.iter().sum::<f32>());
        (sum + f64::from(part), sum_sq + f64::from(part_sq))
    })
}

/// Whether a point has all its neighbours within `limit`, in shares of its range: their mean is no
/// more.
fn has_enough_within(grid: &AngularGrid, chains: &Chains, at: usize, limit: f32) -> bool {
    let q = chains.position(at);
    let radius = limit * chains.distance()[at].max(NOISE_RANGE_M);
    let radius_sq = radius * radius;
    let [xs, ys, zs] = grid.coordinates();
    let (mut lanes, mut within) = ([0u32; LANES], 0u32);
    grid.spans_around_point(chains.index()[at], |first, last| {
        if within > NEIGHBOURS as u32 {
            return;
        }
        for start in (first..last).step_by(LANES) {
            let block = start..start + LANES;
            let (x, y, z) = (&xs[block.clone()], &ys[block.clone()], &zs[block]);
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - q[0], y[lane] - q[1], z[lane] - q[2]);
                let is_near = dx * dx + dy * dy + dz * dz < radius_sq;
                lanes[lane] += u32::from(is_near & (start + lane < last));
            }
        }
        within = lanes.iter().sum();
    });
    // The point itself is among them.
    within > NEIGHBOURS as u32
}

// One instruction each, without the care for NaN that the library's have.
#[inline(always)]
fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The squared distances of the nearest, least first: the point itself, which adds nothing to
/// their sum, and its neighbours.
struct Nearest {
    distances_sq: [f32; NEIGHBOURS + 1],
    worst: f32,
}

impl Nearest {
    /// Nothing found yet; what is farther than `limit` counts as that far.
    fn within(limit: f32) -> Self {
        Self {
            distances_sq: [limit * limit; NEIGHBOURS + 1],
            worst: limit * limit,
        }
    }

    fn sum(&self) -> f32 {
        self.distances_sq.iter().map(|d| sqrt(*d)).sum()
    }

    /// Looks at the grid's entries from `first` to before `last`.
    #[inline]
    fn take(&mut self, [xs, ys, zs]: [&[f32]; 3], q: [f32; 3], first: usize, last: usize) {
        for start in (first..last).step_by(LANES) {
            let block = start..start + LANES;
            let (x, y, z) = (&xs[block.clone()], &ys[block.clone()], &zs[block]);
            let mut distances_sq = [0.0; LANES];
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - q[0], y[lane] - q[1], z[lane] - q[2]);
                distances_sq[lane] = dx * dx + dy * dy + dz * dz;
            }
            let worst = self.worst;
            if distances_sq.map(|d| d < worst) != [false; LANES] {
                let inside = LANES.min(last - start);
                distances_sq[..inside].iter().for_each(|d| self.insert(*d));
            }
        }
    }

    /// Keeps the smallest, in order: each place takes the lesser and hands the greater on.
    #[inline]
    fn insert(&mut self, distance_sq: f32) {
        if distance_sq >= self.worst {
            return;
        }
        let mut handed_on = distance_sq;
        for place in &mut self.distances_sq {
            let stays = less(*place, handed_on);
            handed_on = greater(*place, handed_on);
            *place = stays;
        }
        self.worst = self.distances_sq[NEIGHBOURS];
    }
}
