//! The map that people look at: one point for each small cube in which anything was seen.
//!
//! In: points in the map frame, scan after scan. Out: their means, in the order of their cubes, so
//! that the same run writes the same file. Only the cubes of the last while are in memory; the
//! others lie in temporary files beside the results (`shelves`) and are merged while the map is
//! written or drawn. Memory grows with nothing, the files with the space seen.

mod cube;
mod merge;
mod run;
mod shelves;

use std::cell::Cell;
use std::hash::BuildHasher;
use std::io;
use std::path::Path;

use hachi_bridge::MapWriter;
use hashbrown::{DefaultHashBuilder, HashTable};
use tracing::warn;

use crate::exit::Failure;
use cube::Cube;
use merge::{Merge, Source};
use shelves::Shelves;

/// Cubes in memory: what a scan of a building sees from one place, several times over; 4 MB. Seven
/// eighths of a power of two fill a hash table without another doubling.
const RECENT_CUBES: usize = (1 << 17) / 8 * 7;

/// Collects the map.
#[derive(Debug)]
pub struct MapBuilder {
    edge_m: f64,
    recent: RecentCubes,
    older: Shelves,
    /// Why the temporary files could not be written. The map is given up then.
    lost: Option<io::Error>,
    /// How many points the map has, once somebody counted.
    counted: Cell<Option<usize>>,
}

impl MapBuilder {
    /// A map of cubes with this edge, with temporary files in `folder`: on the disk that the map
    /// itself has to fit on. They have no names and are gone when the program ends, however it
    /// ends.
    pub fn new(edge_m: f64, folder: &Path) -> Self {
        Self::with_capacity(edge_m, folder, RECENT_CUBES)
    }

    fn with_capacity(edge_m: f64, folder: &Path, capacity: usize) -> Self {
        Self {
            edge_m: edge_m.max(1e-3),
            recent: RecentCubes::with_capacity(capacity),
            older: Shelves::new(folder.to_owned()),
            lost: None,
            counted: Cell::new(None),
        }
    }

    /// Adds a point (map frame, metres). One that is not finite, or a million kilometres out, is
    /// passed over.
    ///
    /// If the disk is full the map is given up and its files are removed, so that the other
    /// results still fit; [`write`](Self::write) says so.
    pub fn add(&mut self, point: [f64; 3], intensity: f32) {
        let scaled = point.map(|c| c / self.edge_m);
        if !scaled.iter().all(|c| c.abs() < f64::from(i32::MAX)) || self.lost.is_some() {
            return;
        }
        self.counted.set(None);
        let key = scaled.map(|c| c.floor() as i32);
        if !self.recent.add(key, scaled, intensity) {
            self.put_away();
            if self.lost.is_none() {
                self.recent.add(key, scaled, intensity);
            }
        }
    }

    /// Moves the cubes in memory to the disk.
    fn put_away(&mut self) {
        let written = self.older.put(self.recent.sorted());
        self.recent.clear();
        if let Err(error) = written {
            warn!(%error, "the map does not fit on the disk and is given up");
            self.older.clear();
            self.lost = Some(error);
        }
    }

    /// How many points the map has. Reads the temporary files, unless that was done since the last
    /// point.
    pub fn len(&self) -> usize {
        if self.older.is_empty() {
            return self.recent.cubes.len();
        }
        if self.counted.get().is_none() {
            // Every point passes by; the count is set after the last.
            let _ = self.points().map(|points| points.count());
        }
        self.counted.get().unwrap_or(0)
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.recent.cubes.is_empty() && self.older.is_empty()
    }

    /// The points with their intensities, cube by cube.
    ///
    /// # Errors
    /// A temporary file can't be read, or could not be written.
    pub fn points(&self) -> io::Result<MapPoints<'_>> {
        if let Some(error) = &self.lost {
            return Err(io::Error::new(error.kind(), error.to_string()));
        }
        let recent = Source::memory(&self.recent.cubes);
        Ok(MapPoints {
            map: self,
            cubes: Merge::new(self.older.sources().chain([recent]))?,
            passed: 0,
        })
    }

    /// Writes it to a PLY or PCD file, whole or not at all.
    ///
    /// # Errors
    /// The file can't be written, or a temporary one.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let unwritten = |error: hachi_bridge::WriteError| Failure::unwritten(&error);
        let scratch = |error: io::Error| Failure::writing(path, &error);
        let points = self.points().map_err(scratch)?;
        let mut writer = MapWriter::create(path).map_err(unwritten)?;
        for point in points {
            let (position, intensity) = point.map_err(scratch)?;
            writer.push(position, intensity).map_err(unwritten)?;
        }
        writer.finish().map_err(unwritten)?;
        Ok(())
    }
}

/// The points of a map, one after another.
#[derive(Debug)]
pub struct MapPoints<'a> {
    map: &'a MapBuilder,
    cubes: Merge<'a>,
    passed: usize,
}

impl Iterator for MapPoints<'_> {
    type Item = io::Result<([f32; 3], f32)>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.cubes.next() {
            Ok(Some(cube)) => {
                self.passed += 1;
                Some(Ok(cube.mean(self.map.edge_m)))
            }
            Ok(None) => {
                self.map.counted.set(Some(self.passed));
                None
            }
            Err(error) => Some(Err(error)),
        }
    }
}

/// The cubes in memory: never more than there was room for at the start.
#[derive(Debug)]
struct RecentCubes {
    cubes: Vec<Cube>,
    capacity: usize,
    /// Indices of `cubes` by their keys.
    index: HashTable<u32>,
    hasher: DefaultHashBuilder,
}

impl RecentCubes {
    fn with_capacity(capacity: usize) -> Self {
        Self {
            cubes: Vec::with_capacity(capacity),
            capacity,
            index: HashTable::with_capacity(capacity),
            hasher: DefaultHashBuilder::default(),
        }
    }

    /// Adds a point to its cube. False if that were one too many.
    fn add(&mut self, key: [i32; 3], scaled: [f64; 3], intensity: f32) -> bool {
        let Self {
            cubes,
            capacity,
            index,
            hasher,
        } = self;
        let hash = hasher.hash_one(key);
        let at = match index.find(hash, |&i| cubes[i as usize].key == key) {
            Some(&at) => at as usize,
            None if cubes.len() >= *capacity => return false,
            None => {
                let at = cubes.len();
                index.insert_unique(hash, at as u32, |&i| hasher.hash_one(cubes[i as usize].key));
                cubes.push(Cube::new(key));
                at
            }
        };
        cubes[at].add(scaled, intensity);
        true
    }

    /// All of them in order, before they are cleared.
    fn sorted(&mut self) -> &[Cube] {
        self.index.clear();
        self.cubes.sort_unstable_by_key(|cube| cube.key);
        &self.cubes
    }

    fn clear(&mut self) {
        self.cubes.clear();
        self.index.clear();
    }
}

#[cfg(test)]
mod tests;
