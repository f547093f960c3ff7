//! How coarse to look: the voxel size that leaves the wanted number of points.
//!
//! A living room and a motorway differ by a factor of five in every length; the number of points
//! a pose needs does not. The size is searched on the first scan and follows slowly from then on.

use hachi_cloud::VoxelGrid;

/// Sizes tried, metres.
const RANGE_M: std::ops::RangeInclusive<f32> = 0.15..=1.0;

/// Keeps the voxel size.
#[derive(Debug, Clone)]
pub struct Scale {
    target: usize,
    voxel_m: f32,
}

impl Scale {
    /// Aims at `target` points.
    pub fn new(target: usize) -> Self {
        Self {
            target: target.max(100),
            voxel_m: 0.5,
        }
    }

    /// The voxel size, metres.
    pub fn voxel_m(&self) -> f32 {
        self.voxel_m
    }

    /// Finds the size for the first scan.
    pub fn search(
        &mut self,
        grid: &mut VoxelGrid,
        points: impl ExactSizeIterator<Item = [f32; 3]> + Clone,
    ) {
        const TRIES: usize = 8;
        for _ in 0..TRIES {
            let count = grid.count(points.clone(), self.voxel_m);
            let ratio = self.ratio(count);
            if (0.9..1.1).contains(&ratio) {
                break;
            }
            self.set(self.voxel_m * ratio.clamp(0.4, 2.5));
        }
    }

    /// Follows after a scan that was reduced to `count` points.
    pub fn follow(&mut self, count: usize) {
        let ratio = self.ratio(count);
        if !(0.8..1.25).contains(&ratio) {
            self.set(self.voxel_m * ratio.clamp(0.95, 1.05));
        }
    }

    /// Surfaces are two-dimensional: twice the size leaves a quarter of the points.
    fn ratio(&self, count: usize) -> f32 {
        (count.max(1) as f32 / self.target as f32).sqrt()
    }

    fn set(&mut self, voxel_m: f32) {
        self.voxel_m = voxel_m.clamp(*RANGE_M.start(), *RANGE_M.end());
    }
}
