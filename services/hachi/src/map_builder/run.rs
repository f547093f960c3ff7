//! Cubes in the order of their keys, in a file without a name.
//!
//! The operating system takes such a file back when the program ends, however it ends.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;

use super::cube::Cube;

/// Bytes read or written at once. Tens of runs are read together.
const BUFFER: usize = 512 * Cube::BYTES;

/// Sorted cubes on the disk, no two with the same key.
#[derive(Debug, Clone)]
pub(super) struct Run {
    file: Arc<File>,
    bytes: u64,
}

/// A run being written.
#[derive(Debug)]
pub(super) struct RunWriter {
    file: File,
    buffer: Vec<u8>,
    bytes: u64,
}

impl RunWriter {
    /// Begins a run on the disk of `folder`.
    pub(super) fn create(folder: &Path) -> io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            buffer: Vec::with_capacity(BUFFER),
            bytes: 0,
        })
    }

    /// Appends a cube, whose key is larger than the last one's.
    pub(super) fn push(&mut self, cube: &Cube) -> io::Result<()> {
        if self.buffer.len() >= BUFFER {
            self.flush()?;
        }
        self.buffer.extend_from_slice(&cube.to_bytes());
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.write_all(&self.buffer)?;
        self.bytes += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// Completes it.
    pub(super) fn finish(mut self) -> io::Result<Run> {
        self.flush()?;
        Ok(Run {
            file: Arc::new(self.file),
            bytes: self.bytes,
        })
    }
}

/// Reads a run from its beginning. Several may read the same one, by turns.
#[derive(Debug)]
pub(super) struct RunReader {
    run: Run,
    /// How far the file was read.
    at: u64,
    buffer: Vec<u8>,
    /// How much of the buffer was handed out.
    taken: usize,
}

impl RunReader {
    pub(super) fn new(run: &Run) -> Self {
        Self {
            run: run.clone(),
            at: 0,
            buffer: Vec::new(),
            taken: 0,
        }
    }

    /// The next cube, `None` after the last.
    pub(super) fn next(&mut self) -> io::Result<Option<Cube>> {
        if self.taken == self.buffer.len() && !self.refill()? {
            return Ok(None);
        }
        let cube = self.buffer[self.taken..].first_chunk();
        self.taken += Cube::BYTES;
        Ok(cube.map(Cube::from_bytes))
    }

    fn refill(&mut self) -> io::Result<bool> {
        let size = (self.run.bytes - self.at).min(BUFFER as u64) as usize;
        self.buffer.resize(size, 0);
        self.taken = 0;
        let mut file = &*self.run.file;
        file.seek(SeekFrom::Start(self.at))?;
        file.read_exact(&mut self.buffer)?;
        self.at += size as u64;
        Ok(size > 0)
    }
}
