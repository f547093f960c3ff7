//! The map that people look at: one point for each small cube in which anything was seen.
//!
//! In: points in the map frame, scan after scan. Out: their means, in the order of their cubes, so
//! that the same run writes the same file. Memory grows with the space seen, not with the time.

use std::path::Path;

use hachi_bridge::MapWriter;
use hashbrown::HashMap;

use crate::exit::Failure;

/// What fell into one cube.
#[derive(Debug, Clone, Copy, Default)]
struct Cube {
    /// Sums relative to the cube's corner, metres.
    sum: [f32; 3],
    intensity: f32,
    count: u32,
}

/// Collects the map.
#[derive(Debug)]
pub struct MapBuilder {
    edge_m: f64,
    cubes: HashMap<[i32; 3], Cube>,
}

impl MapBuilder {
    /// A map of cubes with this edge.
    pub fn new(edge_m: f64) -> Self {
        Self {
            edge_m: edge_m.max(1e-3),
            cubes: HashMap::new(),
        }
    }

    /// Adds a point (map frame, metres). One that is not finite, or a million kilometres out, is
    /// passed over.
    pub fn add(&mut self, point: [f64; 3], intensity: f32) {
        let scaled = point.map(|c| c / self.edge_m);
        if !scaled.iter().all(|c| c.abs() < f64::from(i32::MAX)) {
            return;
        }
        let key = scaled.map(|c| c.floor() as i32);
        let cube = self.cubes.entry(key).or_default();
        for axis in 0..3 {
            let corner = f64::from(key[axis]) * self.edge_m;
            cube.sum[axis] += (point[axis] - corner) as f32;
        }
        cube.intensity += intensity;
        cube.count += 1;
    }

    /// How many points the map has.
    pub fn len(&self) -> usize {
        self.cubes.len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.cubes.is_empty()
    }

    /// The points with their intensities, cube by cube.
    pub fn points(&self) -> Vec<([f32; 3], f32)> {
        let mut keys: Vec<_> = self.cubes.keys().copied().collect();
        keys.sort_unstable();
        let point = |key: &[i32; 3]| {
            let cube = self.cubes.get(key).copied().unwrap_or_default();
            let scale = 1.0 / cube.count.max(1) as f32;
            let position = std::array::from_fn(|a| {
                (f64::from(key[a]) * self.edge_m) as f32 + cube.sum[a] * scale
            });
            (position, cube.intensity * scale)
        };
        keys.iter().map(point).collect()
    }

    /// Writes it to a PLY or PCD file, whole or not at all.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let unwritten = |error: hachi_bridge::WriteError| Failure::unwritten(&error);
        let mut writer = MapWriter::create(path).map_err(unwritten)?;
        for (position, intensity) in self.points() {
            writer.push(position, intensity).map_err(unwritten)?;
        }
        writer.finish().map_err(unwritten)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_becomes_the_mean_of_its_points_on_either_side_of_zero() {
        let mut map = MapBuilder::new(0.1);
        map.add([-0.02, 0.0, 0.0], 10.0);
        map.add([-0.04, 0.0, 0.0], 30.0);
        map.add([5.01, 0.0, 0.0], 7.0);
        map.add([f64::NAN, 0.0, 0.0], 7.0);
        map.add([f64::INFINITY, 0.0, 0.0], 7.0);
        let points = map.points();
        assert_eq!(points.len(), 2);
        assert!(
            (points[0].0[0] + 0.03).abs() < 1e-6 && points[0].1 == 20.0,
            "{points:?}"
        );
        assert!((points[1].0[0] - 5.01).abs() < 1e-6, "{points:?}");
    }
}
