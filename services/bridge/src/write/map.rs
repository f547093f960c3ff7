//! A map to one file, point by point, without holding it.
//!
//! Both formats state the number of points in front. The header is therefore written with room to
//! spare in a comment and again, with the number, once it is known.

use std::path::Path;

use super::{AtomicFile, WriteFormat};
use crate::error::WriteError;

/// Writes x, y, z and intensity as f32 to a PLY or PCD file.
///
/// Dropped before [`MapWriter::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct MapWriter {
    file: AtomicFile,
    format: WriteFormat,
    points: u64,
}

impl MapWriter {
    /// Begins a map; the ending of `path`, `.ply` or `.pcd`, decides the format.
    ///
    /// # Errors
    /// [`WriteError`] where the name tells no format or the folder takes no files.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, WriteError> {
        let path = path.as_ref();
        let format = WriteFormat::of(path)
            .filter(|format| *format != WriteFormat::Csv)
            .ok_or_else(|| WriteError::UnknownFormat {
                path: path.to_path_buf(),
            })?;
        let mut file = AtomicFile::create(path)?;
        file.write(header(format, 0).as_bytes())?;
        Ok(Self {
            file,
            format,
            points: 0,
        })
    }

    /// Appends a point: metres, and intensity from 0 to 255.
    ///
    /// # Errors
    /// [`WriteError::NoRoom`] where the disk is full.
    pub fn push(&mut self, position: [f32; 3], intensity: f32) -> Result<(), WriteError> {
        let mut row = [0; 16];
        let [x, y, z] = position;
        for (slot, value) in row.chunks_exact_mut(4).zip([x, y, z, intensity]) {
            slot.copy_from_slice(&value.to_le_bytes());
        }
        self.file.write(&row)?;
        self.points += 1;
        Ok(())
    }

    /// Completes the file and gives it its name. The number of points.
    ///
    /// # Errors
    /// [`WriteError`]; nothing half-written is then left behind.
    pub fn finish(mut self) -> Result<u64, WriteError> {
        let header = header(self.format, self.points);
        self.file.write_at(0, header.as_bytes())?;
        self.file.commit()?;
        Ok(self.points)
    }
}

/// A header that is as long for any number of points.
fn header(format: WriteFormat, points: u64) -> String {
    /// Digits of the largest number there is.
    const DIGITS: usize = 20;
    let count = points.to_string();
    match format {
        WriteFormat::Pcd => {
            let spare = " ".repeat(2 * (DIGITS - count.len()));
            format!(
                "# .PCD v0.7 - Point Cloud Data file format{spare}\nVERSION 0.7\n\
                 FIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH {count}\n\
                 HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
            )
        }
        WriteFormat::Ply | WriteFormat::Csv => {
            let spare = ".".repeat(DIGITS - count.len());
            format!(
                "ply\nformat binary_little_endian 1.0\ncomment metres, intensity 0 to 255{spare}\n\
                 element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
                 property float intensity\nend_header\n"
            )
        }
    }
}
