//! Several sorted sequences of cubes as one, cubes of the same key added up.

use std::io;

use super::cube::Cube;
use super::run::RunReader;

/// A sorted sequence of cubes.
#[derive(Debug)]
pub(super) enum Source<'a> {
    /// In a file.
    File(RunReader),
    /// In memory, unsorted: with the indices in order.
    Memory {
        cubes: &'a [Cube],
        order: std::vec::IntoIter<u32>,
    },
}

impl<'a> Source<'a> {
    pub(super) fn memory(cubes: &'a [Cube]) -> Self {
        let mut order: Vec<u32> = (0..cubes.len() as u32).collect();
        order.sort_unstable_by_key(|&i| cubes[i as usize].key);
        Self::Memory {
            cubes,
            order: order.into_iter(),
        }
    }

    fn next(&mut self) -> io::Result<Option<Cube>> {
        match self {
            Self::File(reader) => reader.next(),
            Self::Memory { cubes, order } => Ok(order.next().map(|i| cubes[i as usize])),
        }
    }
}

/// The merged sequence. Needs a few kilobytes for each source, however long they are.
#[derive(Debug)]
pub(super) struct Merge<'a> {
    /// Oldest first, each with its next cube. Emptied ones are gone.
    sources: Vec<(Cube, Source<'a>)>,
}

impl<'a> Merge<'a> {
    /// Begins; the sources in the order in which their cubes are added up.
    pub(super) fn new(sources: impl IntoIterator<Item = Source<'a>>) -> io::Result<Self> {
        let mut merge = Self {
            sources: Vec::new(),
        };
        for mut source in sources {
            if let Some(cube) = source.next()? {
                merge.sources.push((cube, source));
            }
        }
        Ok(merge)
    }

    /// The next cube, `None` after the last.
    pub(super) fn next(&mut self) -> io::Result<Option<Cube>> {
        let Some(key) = self.sources.iter().map(|(cube, _)| cube.key).min() else {
            return Ok(None);
        };
        let mut sum: Option<Cube> = None;
        let mut has_ended = false;
        for (cube, source) in &mut self.sources {
            if cube.key != key {
                continue;
            }
            match &mut sum {
                Some(sum) => sum.absorb(cube),
                None => sum = Some(*cube),
            }
            match source.next()? {
                Some(next) => *cube = next,
                None => {
                    has_ended = true;
                    // Marks it: nothing else has no points.
                    *cube = Cube::new(key);
                }
            }
        }
        if has_ended {
            self.sources.retain(|(cube, _)| !cube.is_empty());
        }
        Ok(sum)
    }
}
