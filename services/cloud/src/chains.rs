//! A scan's points along the rings on which a turning LiDAR saw them.
//!
//! In: the points sorted into a direction grid. Out: the same points, ring after ring, each ring in
//! the order of the scan, so that neighbours on a ring are neighbours in memory whether the source
//! gives one firing after another or one ring after another. Where the source names no rings, the
//! rows of the direction grid stand in for them.

use alloc::vec::Vec;

use hachi_hal::Point;

use crate::angular::AngularGrid;

/// Rings told apart; those beyond share numbers, which costs time and no accuracy.
const RINGS: usize = 256;

/// Points ring by ring. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chains {
    index: Vec<u32>,
    coordinates: [Vec<f32>; 3],
    distance: Vec<f32>,
}

impl Chains {
    /// Takes in the points that the grid holds.
    pub(crate) fn build(&mut self, grid: &AngularGrid, points: &[Point]) {
        let has_rings = points.iter().any(|point| point.ring != 0);
        let ring_of = |index: u32| {
            if has_rings {
                usize::from(points[index as usize].ring) % RINGS
            } else {
                grid.row_of(index as usize) % RINGS
            }
        };
        let count = grid.sorted().len();
        self.index.clear();
        self.index.resize(count, 0);
        self.distance.clear();
        self.distance.resize(count, 0.0);
        for coordinates in &mut self.coordinates {
            coordinates.clear();
            coordinates.resize(count, 0.0);
        }
        let mut next = [0u32; RINGS];
        for index in grid.indices() {
            next[ring_of(index)] += 1;
        }
        let mut first = 0;
        for slot in &mut next {
            first += core::mem::replace(slot, first);
        }
        let [xs, ys, zs] = &mut self.coordinates;
        for index in grid.indices() {
            let slot = &mut next[ring_of(index)];
            let at = *slot as usize;
            *slot += 1;
            let [x, y, z] = points[index as usize].position();
            (xs[at], ys[at], zs[at]) = (x, y, z);
            self.index[at] = index;
            self.distance[at] = crate::float::norm([x, y, z]);
        }
    }

    /// How many points there are.
    pub(crate) fn len(&self) -> usize {
        self.index.len()
    }

    /// Where each stands in the scan.
    pub(crate) fn index(&self) -> &[u32] {
        &self.index
    }

    /// Their positions, axis by axis.
    pub(crate) fn coordinates(&self) -> [&[f32]; 3] {
        let [x, y, z] = &self.coordinates;
        [x, y, z]
    }

    /// One position.
    pub(crate) fn position(&self, at: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.coordinates[axis][at])
    }

    /// Their distances from the sensor, metres.
    pub(crate) fn distance(&self) -> &[f32] {
        &self.distance
    }
}
