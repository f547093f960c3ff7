//! Two small networks that are part of the program: one finds people and their masks, one tells
//! them apart.
//!
//! They have seen nothing but renderings of Hachi's simulated world and are of use there alone:
//! with them the simulated robot goes through real inference with nothing installed. How they are
//! trained stands in `training/README.md`, how good they are in `BENCHMARKS.md`. Out: their bytes and manifests,
//! which are checked like those of any file ([`crate::load()`] knows them by [`Own::name`]).

use std::path::Path;

/// A network that is part of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Own {
    /// Finds people and their masks.
    Detector,
    /// Tells people apart.
    ReId,
}

impl Own {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Detector, Self::ReId];

    /// Its name where others have the path of a file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Detector => "own:detector",
            Self::ReId => "own:reid",
        }
    }

    /// The network of a name.
    pub fn from_name(name: &Path) -> Option<Self> {
        let named = |own: &Self| Path::new(own.name()) == name;
        Self::ALL.into_iter().find(named)
    }

    /// The ONNX file.
    pub const fn bytes(self) -> &'static [u8] {
        match self {
            Self::Detector => include_bytes!("detector.onnx"),
            Self::ReId => include_bytes!("reid.onnx"),
        }
    }

    /// The manifest.
    pub(crate) const fn manifest(self) -> &'static str {
        match self {
            Self::Detector => include_str!("detector.toml"),
            Self::ReId => include_str!("reid.toml"),
        }
    }
}
