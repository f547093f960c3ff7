//! Several submaps laid together, as something to align to.
//!
//! In: submaps, and where each lies in a common frame. Out: a [`SurfaceTarget`], and an even choice
//! of its surfaces as the source of an alignment.

use hachi_cloud::KdTree;
use hachi_hal::Pose;
use hachi_registration::{SurfacePoint, SurfaceTarget};

use crate::submap::Submap;

/// Surfaces of several submaps in one frame; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Surfaces {
    points: Vec<SurfacePoint>,
    /// The places that they were seen from, common frame; and for each surface its one.
    eyes: Vec<[f32; 3]>,
    eye_of: Vec<u32>,
    positions: Vec<[f32; 3]>,
    tree: KdTree,
    /// The coarsest cubes among the submaps, metres.
    voxel_m: f32,
}

impl Surfaces {
    /// Empties it.
    pub fn clear(&mut self) {
        self.points.clear();
        self.eyes.clear();
        self.eye_of.clear();
        self.voxel_m = 0.0;
    }

    /// Adds a submap that lies at `frame_from_node`; those of its surfaces that are within
    /// `radius_m` of `centre` (both in the common frame).
    pub fn add(
        &mut self,
        submap: &Submap,
        frame_from_node: &Pose,
        centre: [f32; 3],
        radius_m: f32,
    ) {
        let pose = frame_from_node.cast::<f32>();
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let near = radius_m * radius_m;
        let place =
            |p: [f32; 3]| -> [f32; 3] { (rotation * nalgebra::Vector3::from(p) + shift).into() };
        self.voxel_m = self.voxel_m.max(submap.voxel_m);
        let first_eye = self.eyes.len();
        self.eyes
            .extend(submap.viewpoints.iter().map(|eye| place(*eye)));
        for p in &submap.points {
            let position = place(p.position);
            let distance_sq: f32 = (0..3).map(|a| (position[a] - centre[a]).powi(2)).sum();
            if distance_sq <= near {
                self.points.push(SurfacePoint {
                    position,
                    normal: (rotation * nalgebra::Vector3::from(p.normal)).into(),
                });
                let eye = first_eye + usize::from(p.viewpoint);
                self.eye_of.push(u32::try_from(eye).unwrap_or(u32::MAX));
            }
        }
    }

    /// Makes it ready to be aligned to.
    pub fn index(&mut self) {
        self.positions.clear();
        self.positions
            .extend(self.points.iter().map(|p| p.position));
        self.tree.build(&self.positions);
    }

    /// Whether there is a surface within so many metres.
    pub fn is_near(&self, point: [f32; 3], metres: f32) -> bool {
        self.tree.nearest(point, metres * metres).is_some()
    }

    /// All surfaces.
    pub fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// About `count` lines of sight, evenly picked: from where a surface was seen, and to where.
    pub fn sights(&self, count: usize) -> impl Iterator<Item = [[f32; 3]; 2]> + '_ {
        let total = self.points.len();
        let picked = count.min(total);
        (0..picked).filter_map(move |i| {
            let index = i * total / picked;
            let eye = self.eyes.get(self.eye_of[index] as usize)?;
            Some([*eye, self.points[index].position])
        })
    }

    /// The coarsest cubes among the submaps, metres.
    pub fn voxel_m(&self) -> f32 {
        self.voxel_m
    }

    /// About `count` surfaces, evenly picked, into `out`, which is cleared first.
    pub fn pick(&self, count: usize, out: &mut Vec<SurfacePoint>) {
        out.clear();
        let total = self.points.len();
        let picked = count.min(total);
        // Evenly by index; neighbours in a submap's order were seen one after the other.
        out.extend((0..picked).map(|i| self.points[i * total / picked]));
    }
}

impl SurfaceTarget for Surfaces {
    fn closest(&self, point: [f32; 3], max_distance_sq: f32) -> Option<SurfacePoint> {
        let nearest = self.tree.nearest(point, max_distance_sq)?;
        self.points.get(nearest.index as usize).copied()
    }
}
