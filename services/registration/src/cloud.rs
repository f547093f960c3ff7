//! From bare positions to pieces of surface: downsampled, with a normal each.

use hachi_cloud::{KdTree, NearestK, Surface, VoxelGrid, voxel::Voxel};
use rayon::prelude::*;

use crate::linearize::SurfaceTarget;

/// Neighbours that shape a surface; ten, as small_gicp and the thesis's set-up take.
const NEIGHBOURS: usize = 10;

/// A voxel's points beyond this many add nothing to the shape of the surface around it, so that
/// one close to the sensor does not drown its neighbours.
const MOST_IN_VOXEL: f32 = 20.0;

/// Room that buffers have from the start, points: a little more now and then must not allocate.
const ROOM: usize = 8192;

/// Points handed to one task. Fixed, so that work is cut the same way for any number of threads.
const CHUNK: usize = 256;

/// A position and the normal of the surface it lies on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfacePoint {
    /// Metres.
    pub position: [f32; 3],
    /// Unit normal; zero where the neighbourhood has no one direction of least spread.
    pub normal: [f32; 3],
}

/// A cloud that can be aligned, or aligned to.
#[derive(Debug, Clone, Default)]
pub struct SurfaceCloud {
    /// The pieces of surface.
    pub points: Vec<SurfacePoint>,
    /// When each was measured, in the unit of the points it was made from.
    pub times: Vec<f32>,
    tree: KdTree,
}

impl SurfaceCloud {
    /// How many pieces of surface there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

impl SurfaceTarget for SurfaceCloud {
    fn closest(&self, point: [f32; 3], max_distance_sq: f32) -> Option<SurfacePoint> {
        let nearest = self.tree.nearest(point, max_distance_sq)?;
        self.points.get(nearest.index as usize).copied()
    }
}

/// Makes [`SurfaceCloud`]s; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Preparer {
    grid: VoxelGrid,
    reduced: Vec<[f32; 3]>,
    voxels: Vec<Voxel>,
}

impl Preparer {
    /// Reduces `points` to one a voxel of `voxel_m` metres and gives each its normal.
    pub fn prepare(
        &mut self,
        points: impl ExactSizeIterator<Item = ([f32; 3], f32)>,
        voxel_m: f32,
        out: &mut SurfaceCloud,
    ) {
        self.grid
            .reduce_with_scatter(points, voxel_m, &mut self.voxels);
        self.reduced.clear();
        self.reduced.reserve(ROOM);
        self.reduced.extend(self.voxels.iter().map(|v| v.mean));
        let voxels = &self.voxels;
        out.tree.build(&self.reduced);
        out.times.clear();
        out.times.reserve(ROOM);
        out.times.extend(self.voxels.iter().map(|v| v.time));
        out.points.clear();
        out.points.reserve(ROOM);
        out.points
            .resize(self.reduced.len(), SurfacePoint::default());
        let (reduced, tree) = (&self.reduced, &out.tree);
        out.points
            .par_chunks_mut(CHUNK)
            .zip(reduced.par_chunks(CHUNK))
            .for_each(|(points, positions)| {
                let mut found = NearestK::<NEIGHBOURS>::default();
                for (point, &position) in points.iter_mut().zip(positions) {
                    tree.k_nearest(position, &mut found);
                    let around = found.as_slice().iter().map(|n| voxels[n.index as usize]);
                    let normal = Surface::through_voxels(around, MOST_IN_VOXEL)
                        .map_or([0.0; 3], |s| s.normal);
                    *point = SurfacePoint { position, normal };
                }
            });
    }
}
