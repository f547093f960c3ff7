//! What can be wrong with a map file, and what to do about it.

use std::path::{Path, PathBuf};

use hachi_slam::{StoreError, StoreFault};

use crate::fault::Fault;

/// What is wrong with a map file. Each says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// There is no file.
    #[error("{path} is not there: give the path of a map, or make one with `hachi replay --map`")]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// The file is something else.
    #[error("{path} is not a map ({seen}): give the path of a map that hachi wrote")]
    NotAMap {
        /// The path.
        path: PathBuf,
        /// What it looks like.
        seen: String,
    },
    /// Another version of the program wrote it.
    #[error(
        "{path} is a map of version {found}, this program reads version {supported}: use the program \
         that wrote it, or map anew"
    )]
    Version {
        /// The path.
        path: PathBuf,
        /// Its version.
        found: i64,
        /// Ours.
        supported: i64,
    },
    /// The map was made by another robot or with another sensor.
    #[error(
        "{path} was made by {found}, this is {expected}: say --platform as it was made, or give a map \
         of this robot"
    )]
    OtherRobot {
        /// The path.
        path: PathBuf,
        /// Who made it.
        found: String,
        /// Who asks.
        expected: String,
    },
    /// It breaks off, or is not what was written.
    #[error("{path} is damaged ({what}): restore it from a copy, or map anew")]
    Damaged {
        /// The path.
        path: PathBuf,
        /// Where.
        what: String,
    },
    /// It may not be written.
    #[error(
        "{path} can't be written: give hachi the right to write it, or copy it to where it can be"
    )]
    ReadOnly {
        /// The path.
        path: PathBuf,
    },
    /// There is no room.
    #[error("there is no room to write {path}: free some space; what was kept before is there")]
    Full {
        /// The path.
        path: PathBuf,
    },
    /// Another program has it open for writing.
    #[error("{path} is in use by another program: stop that one first")]
    InUse {
        /// The path.
        path: PathBuf,
    },
    /// Anything else.
    #[error("{path}: {what}: check the disk and the path")]
    Other {
        /// The path.
        path: PathBuf,
        /// What the system says.
        what: String,
    },
}

impl MapError {
    /// What SQLite's error means for the file.
    pub(crate) fn of(path: &Path, error: &rusqlite::Error) -> Self {
        let path = path.to_owned();
        let what = error.to_string();
        match Fault::of(error) {
            Fault::Full => Self::Full { path },
            Fault::ReadOnly => Self::ReadOnly { path },
            Fault::InUse => Self::InUse { path },
            Fault::NotADatabase => Self::NotAMap { path, seen: what },
            Fault::Damaged => Self::Damaged { path, what },
            Fault::CannotOpen | Fault::Other => Self::Other { path, what },
        }
    }
}

impl From<MapError> for StoreError {
    fn from(error: MapError) -> Self {
        let fault = match error {
            MapError::Full { .. } => StoreFault::Full,
            MapError::ReadOnly { .. } => StoreFault::ReadOnly,
            MapError::Damaged { .. } | MapError::NotAMap { .. } => StoreFault::Damaged,
            _ => StoreFault::Other,
        };
        Self {
            fault,
            message: error.to_string(),
        }
    }
}
