//! The normal of the surface at each point, turned towards the sensor.
//!
//! In: points in the sensor frame. Out: a unit normal for each point, or none where neighbours do
//! not make a surface. A turning LiDAR puts points centimetres apart along a ring and metres apart
//! between rings, so the nearest neighbours of most points lie on one line; the cloud is therefore
//! thinned to one point a voxel first, and the neighbours are taken from what is left.

use alloc::vec::Vec;

use hachi_hal::Point;

use crate::float::dot;
use crate::label::Reason;
use crate::nearest::{KdTree, NearestK};
use crate::surface::Surface;
use crate::voxel::VoxelGrid;

/// Neighbours to a normal. With [`THINNED_M`] they span about a metre, two or three rings of a
/// 16-beam sensor on a wall 8 m away.
const NEIGHBOURS: usize = 12;
/// Edge of a voxel of the thinned cloud.
const THINNED_M: f32 = 0.2;
/// Neighbours farther off say nothing about the point.
const REACH_SQ: f32 = 2.0 * 2.0;
/// A surface spreads over two directions: a middle variance under this share of the largest is a
/// line.
const LINE_SHARE: f32 = 0.01;
/// And it is thin: a least variance above this share of the middle one is a clump.
const CLUMP_SHARE: f32 = 0.25;

/// Finds normals. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct Normals {
    voxels: VoxelGrid,
    thinned: Vec<[f32; 3]>,
    kept: Vec<[f32; 3]>,
    tree: KdTree,
}

impl Normals {
    /// Takes in the kept points of a scan; [`Normals::at`] answers about it from then on.
    pub fn prepare(&mut self, points: &[Point], labels: &[Reason]) {
        self.kept.clear();
        self.kept.extend(
            points
                .iter()
                .zip(labels)
                .filter(|(_, label)| label.is_kept())
                .map(|(point, _)| point.position()),
        );
        self.voxels
            .reduce(self.kept.iter().copied(), THINNED_M, &mut self.thinned);
        self.tree.build(&self.thinned);
    }

    /// The unit normal at a position in the sensor frame, pointing to the sensor's side; `None`
    /// where the neighbours are too few, on a line or in a clump.
    pub fn at(&self, position: [f32; 3]) -> Option<[f32; 3]> {
        let mut nearest = NearestK::<NEIGHBOURS>::default();
        self.tree.k_nearest(position, &mut nearest);
        let neighbours = nearest
            .as_slice()
            .iter()
            .filter(|neighbour| neighbour.distance_sq <= REACH_SQ)
            .map(|neighbour| self.thinned[neighbour.index as usize]);
        if neighbours.clone().count() < 5 {
            return None;
        }
        let surface = Surface::through(neighbours)?;
        let [least, middle, largest] = surface.variances;
        let is_surface = middle > LINE_SHARE * largest && least < CLUMP_SHARE * middle;
        if !is_surface {
            return None;
        }
        let away = dot(surface.normal, position) > 0.0;
        Some(surface.normal.map(|c| if away { -c } else { c }))
    }

    /// The normal at every kept point; `None` at the others. `out` is cleared first.
    pub fn compute(
        &mut self,
        points: &[Point],
        labels: &[Reason],
        out: &mut Vec<Option<[f32; 3]>>,
    ) {
        self.prepare(points, labels);
        out.clear();
        out.extend(points.iter().zip(labels).map(|(point, label)| {
            if label.is_kept() {
                self.at(point.position())
            } else {
                None
            }
        }));
    }
}
