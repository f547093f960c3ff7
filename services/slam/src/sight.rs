//! Whether two places can be one: what stood in the way of the one's view must stand in the other's.
//!
//! In: surfaces of two places with where they were seen from, and how the two lie to each other. Out:
//! the share of lines of sight of each that lead through surfaces of the other. Two corridors may
//! look alike from wall to wall; the end of the one is seen through where the other goes on.

use hashbrown::HashMap;
use nalgebra::Vector3;
use rayon::prelude::*;

use hachi_hal::Pose;

use crate::surfaces::Surfaces;

/// Lines of sight of each place that are followed.
const SIGHTS: usize = 1_500;

/// Edge of the cubes in which surfaces are gathered, metres, and in cubes of the submaps.
const CELL_M: f32 = 0.3;
const CELL_VOXELS: f32 = 2.0;

/// Surfaces in a cube for it to be a wall, and the length of their mean normal: less is clutter.
const LEAST_SURFACES: f32 = 2.0;
const LEAST_NORMAL: f32 = 0.8;

/// A line of sight has to meet a wall this steeply to lead through it: cosine with the normal. Flatter
/// ones graze it.
const STEEP: f32 = 0.3;

/// What is seen has to lie this far behind a wall, and the eye this far before it, metres.
const BEHIND_M: f32 = 0.5;

/// Points handed to one task: fixed, for the same sums with any number of threads.
const CHUNK: usize = 64;

#[derive(Debug, Clone, Copy, Default)]
struct Wall {
    count: f32,
    position: Vector3<f32>,
    normal: Vector3<f32>,
}

/// Surfaces as walls that lines of sight can't lead through; keeps its memory.
#[derive(Debug, Default)]
pub struct Walls {
    cell_m: f32,
    cells: HashMap<[i32; 3], Wall>,
}

impl Walls {
    /// Gathers the surfaces of a place.
    pub fn gather(&mut self, surfaces: &Surfaces) {
        self.cell_m = CELL_M.max(CELL_VOXELS * surfaces.voxel_m());
        self.cells.clear();
        for point in surfaces.points() {
            let normal = Vector3::from(point.normal);
            if normal == Vector3::zeros() {
                continue;
            }
            let position = Vector3::from(point.position);
            let wall = self.cells.entry(self.key(&position)).or_default();
            wall.count += 1.0;
            wall.position += position;
            wall.normal += normal;
        }
        for wall in self.cells.values_mut() {
            let length = wall.normal.norm();
            if wall.count < LEAST_SURFACES || length < LEAST_NORMAL * wall.count {
                // Nothing is seen through it.
                wall.normal = Vector3::zeros();
                continue;
            }
            wall.position /= wall.count;
            wall.normal /= length;
        }
    }

    fn key(&self, p: &Vector3<f32>) -> [i32; 3] {
        let inverse = 1.0 / self.cell_m;
        [p.x, p.y, p.z].map(|c| (c * inverse).floor() as i32)
    }

    /// Share of the lines of sight of a place, which lies at `walls_from_place`, that lead through.
    pub fn seen_through(&self, place: &Surfaces, walls_from_place: &Pose) -> f64 {
        let pose = walls_from_place.cast::<f32>();
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let sights: Vec<[Vector3<f32>; 2]> = place
            .sights(SIGHTS)
            .map(|ends| ends.map(|p| rotation * Vector3::from(p) + shift))
            .collect();
        let through: usize = sights
            .par_chunks(CHUNK)
            .map(|chunk| {
                chunk
                    .iter()
                    .filter(|[eye, end]| self.is_between(eye, end))
                    .count()
            })
            .sum();
        through as f64 / sights.len().max(1) as f64
    }

    /// Whether a wall stands between the two.
    fn is_between(&self, eye: &Vector3<f32>, end: &Vector3<f32>) -> bool {
        let length = (end - eye).norm();
        let last = length - BEHIND_M;
        if !length.is_finite() || last <= BEHIND_M {
            return false;
        }
        let along = (end - eye) / length;
        let step = self.cell_m / 2.0;
        let steps = ((last - BEHIND_M) / step) as usize;
        let mut before = [i32::MAX; 3];
        for i in 0..=steps {
            let key = self.key(&(eye + along * (BEHIND_M + step * i as f32)));
            if key == before {
                continue;
            }
            before = key;
            let Some(wall) = self.cells.get(&key) else {
                continue;
            };
            let steepness = wall.normal.dot(&along);
            if steepness.abs() < STEEP {
                continue;
            }
            let at = wall.normal.dot(&(wall.position - eye)) / steepness;
            let beside = (eye + along * at - wall.position).norm();
            if at > BEHIND_M && at < last && beside < self.cell_m / 2.0 {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::submap::{Submap, SubmapBuilder};

    /// A corridor along x, 2 m wide, from -4 m to `ends` metres, closed there if `closed`; seen from
    /// the origin.
    fn corridor(ends: f32, closed: bool) -> Surfaces {
        let step = 0.05;
        let mut points = Vec::new();
        for i in 0..((ends + 4.0) / step) as i32 {
            let x = -4.0 + i as f32 * step;
            for j in 0..40 {
                let z = j as f32 * step - 1.0;
                points.extend([[x, -1.0, z], [x, 1.0, z]]);
            }
        }
        if closed {
            for i in 0..40 {
                for j in 0..40 {
                    points.push([ends, i as f32 * step - 1.0, j as f32 * step - 1.0]);
                }
            }
        }
        let mut builder = SubmapBuilder::default();
        builder.add([0.0; 3], points.into_iter().map(|p| (p, 50.0)));
        let mut submap = Submap::default();
        builder.finish(&mut submap);
        let mut surfaces = Surfaces::default();
        surfaces.add(&submap, &Pose::identity(), [0.0; 3], 100.0);
        surfaces
    }

    #[test]
    fn a_corridor_that_goes_on_is_not_the_one_that_ends() {
        let (short, long) = (corridor(6.0, true), corridor(12.0, true));
        let mut walls = Walls::default();
        walls.gather(&short);
        assert_eq!(walls.seen_through(&short, &Pose::identity()), 0.0);
        let through = walls.seen_through(&long, &Pose::identity());
        assert!(through > 0.2, "{through}");
        // And the other way round: the short one has nothing behind anything of the long one.
        walls.gather(&long);
        assert_eq!(walls.seen_through(&short, &Pose::identity()), 0.0);
        assert_eq!(walls.seen_through(&long, &Pose::identity()), 0.0);
    }

    #[test]
    fn a_place_that_lies_a_little_off_is_not_seen_through() {
        let place = corridor(8.0, true);
        let mut walls = Walls::default();
        walls.gather(&place);
        let off = Pose::from_parts(
            hachi_hal::Vector3::new(0.1, -0.08, 0.05).into(),
            hachi_hal::Rotation::from_euler_angles(0.0, 0.0, 0.02),
        );
        assert!(walls.seen_through(&place, &off) < 0.005);
    }
}
