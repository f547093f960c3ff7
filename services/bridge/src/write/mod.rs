//! Clouds to files, whole or not at all.
//!
//! In: hal points. Out: PCD (binary), PLY (binary little-endian) or CSV with the columns of
//! [`COLUMNS`] for a decoded turn; PLY or PCD with position and intensity alone for a map, as a
//! stream. Files appear under their name once they are complete and on the disk: see
//! [`AtomicFile`].

mod atomic;
mod cloud_file;
mod map;

pub use atomic::{AtomicFile, write_file};
pub use cloud_file::{COLUMNS, WriteFormat, write_cloud};
pub use map::MapWriter;

#[cfg(test)]
mod tests;
