//! Runs of cubes on the disk, merged as they come so that they stay few and hold nothing twice for
//! long.
//!
//! In: runs as large as memory allows. They stand on the lowest shelf; eight on one shelf are
//! merged into one on the next (a log-structured merge tree with tiers: O'Neil et al. 1996). The
//! space on the disk thus follows the space seen, not the time. Merging goes on in small steps,
//! twice as fast as new runs come: no scan waits for a long one.

use std::io;
use std::path::PathBuf;

use super::cube::Cube;
use super::merge::{Merge, Source};
use super::run::{Run, RunReader, RunWriter};

/// Runs that are merged into one.
const TOGETHER: usize = 8;

#[derive(Debug)]
pub(super) struct Shelves {
    folder: PathBuf,
    shelves: Vec<Shelf>,
}

#[derive(Debug, Default)]
struct Shelf {
    /// Oldest first.
    runs: Vec<Run>,
    merging: Option<Merging>,
}

#[derive(Debug)]
struct Merging {
    /// Older than the shelf's other runs, and whole until the merged one is.
    runs: Vec<Run>,
    merge: Merge<'static>,
    merged: RunWriter,
}

impl Shelves {
    /// Runs will lie on the disk of this folder.
    pub(super) fn new(folder: PathBuf) -> Self {
        Self {
            folder,
            shelves: Vec::new(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.shelves.is_empty()
    }

    /// Frees the space.
    pub(super) fn clear(&mut self) {
        self.shelves.clear();
    }

    /// Takes a run of these cubes, sorted, and goes on merging.
    pub(super) fn put(&mut self, cubes: &[Cube]) -> io::Result<()> {
        let mut run = RunWriter::create(&self.folder)?;
        cubes.iter().try_for_each(|cube| run.push(cube))?;
        self.place(0, run.finish()?);
        for shelf in 0..self.shelves.len() {
            if let Some(merged) = self.go_on(shelf, 2 * cubes.len())? {
                self.place(shelf + 1, merged);
            }
        }
        Ok(())
    }

    /// All cubes on the disk, as sorted sequences, oldest first.
    pub(super) fn sources(&self) -> impl Iterator<Item = Source<'_>> {
        let runs = self.shelves.iter().rev().flat_map(|shelf| {
            let merging = shelf.merging.iter().flat_map(|m| &m.runs);
            merging.chain(&shelf.runs)
        });
        runs.map(|run| Source::File(RunReader::new(run)))
    }

    fn place(&mut self, shelf: usize, run: Run) {
        if self.shelves.len() <= shelf {
            self.shelves.resize_with(shelf + 1, Shelf::default);
        }
        self.shelves[shelf].runs.push(run);
    }

    /// Merges up to so many cubes on a shelf. The merged run, once it is whole.
    fn go_on(&mut self, shelf: usize, cubes: usize) -> io::Result<Option<Run>> {
        let shelf = &mut self.shelves[shelf];
        if shelf.merging.is_none() && shelf.runs.len() >= TOGETHER {
            let runs: Vec<Run> = shelf.runs.drain(..TOGETHER).collect();
            let sources = runs.iter().map(|run| Source::File(RunReader::new(run)));
            shelf.merging = Some(Merging {
                merge: Merge::new(sources)?,
                merged: RunWriter::create(&self.folder)?,
                runs,
            });
        }
        let Some(merging) = &mut shelf.merging else {
            return Ok(None);
        };
        for _ in 0..cubes {
            match merging.merge.next()? {
                Some(cube) => merging.merged.push(&cube)?,
                None => {
                    let whole = shelf.merging.take().map(|m| m.merged.finish());
                    return whole.transpose();
                }
            }
        }
        Ok(None)
    }
}
