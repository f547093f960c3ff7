//! What can be wrong with a store of people, and what to do about it.

use std::path::{Path, PathBuf};

use hachi_people::identify::appearance_model::NotAModel;

use super::NetworkIdentity;
use crate::fault::Fault;

/// What is wrong. Each says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PeopleError {
    /// The file is something else.
    #[error("{path} is no store of people ({seen}): give the path of one that hachi wrote")]
    NotAStore {
        /// The path.
        path: PathBuf,
        /// What it looks like.
        seen: String,
    },
    /// Another version of the program wrote it.
    #[error(
        "{path} is a store of people of version {found}, this program reads version {supported}: use \
         the program that wrote it, or move it away and enrol everybody anew"
    )]
    Version {
        /// The path.
        path: PathBuf,
        /// Its version.
        found: i64,
        /// Ours.
        supported: i64,
    },
    /// It breaks off, or is not what was written.
    #[error(
        "{path} is damaged ({what}): restore it from a copy, or move it away and enrol everybody anew"
    )]
    Damaged {
        /// The path.
        path: PathBuf,
        /// Where.
        what: String,
    },
    /// One person's rows are not what was written; the others' are.
    #[error("what {path} holds of {name} is damaged ({what}): forget them and enrol them anew")]
    DamagedPerson {
        /// The path.
        path: PathBuf,
        /// Who.
        name: String,
        /// What of it.
        what: String,
    },
    /// There is a store, and no key file.
    #[error(
        "{key} is not there, and nobody in {path} can be read without it: restore the key file, or \
         move the store away and enrol everybody anew"
    )]
    NoKeys {
        /// The key file.
        key: PathBuf,
        /// The store.
        path: PathBuf,
    },
    /// The key file was made with another store.
    #[error(
        "{key} holds the keys of another store than {path}: give the key file that was made with it"
    )]
    WrongKeys {
        /// The key file.
        key: PathBuf,
        /// The store.
        path: PathBuf,
    },
    /// The key file breaks off, or is none.
    #[error("{key} is no whole key file ({what}): restore it from a copy")]
    DamagedKeys {
        /// The key file.
        key: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// Others may read the key file.
    #[error("{key} can be read by others (mode {mode:03o}): chmod 600 {key}")]
    ExposedKeys {
        /// The key file.
        key: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// A file may not be read or written.
    #[error("{path} can't be read and written: run hachi as the user it belongs to")]
    NotOurs {
        /// The store or the key file.
        path: PathBuf,
    },
    /// There is no room.
    #[error("there is no room to write {path}: free some space; what was saved before is there")]
    Full {
        /// The path.
        path: PathBuf,
    },
    /// Another program writes to it all the time.
    #[error("{path} is in use by another program: try again, or stop that one first")]
    InUse {
        /// The path.
        path: PathBuf,
    },
    /// Nobody has the name.
    #[error("nobody is called {name:?}: see who is known with `hachi people list`")]
    Unknown {
        /// The name, or what stands for it.
        name: String,
    },
    /// Somebody has it already.
    #[error(
        "somebody is called {name:?} already: choose another name, or forget or rename them first"
    )]
    NameTaken {
        /// The name.
        name: String,
    },
    /// It is no name.
    #[error("{name:?} is no name: give one of 1 to {longest} letters without line breaks")]
    NotAName {
        /// What was given.
        name: String,
        /// How many characters it may have.
        longest: usize,
    },
    /// Another network made the model.
    #[error(
        "the model of {name} was made with {found}, this is {asked}: use that network, or enrol them \
         anew"
    )]
    OtherNetwork {
        /// Who.
        name: String,
        /// Which network made it.
        found: Box<NetworkIdentity>,
        /// Which one is in use.
        asked: Box<NetworkIdentity>,
    },
    /// The model can't be kept.
    #[error("the model can't be kept ({source}): enrol the person anew")]
    NotAModel {
        /// Why.
        source: NotAModel,
    },
    /// A picture is too large or empty.
    #[error("a picture of {bytes} bytes can't be kept: give one of 1 to {most} bytes")]
    Image {
        /// How many it has.
        bytes: usize,
        /// How many it may have.
        most: usize,
    },
    /// There are too many people.
    #[error("{most} people are as many as can be kept: forget somebody first")]
    TooMany {
        /// How many.
        most: usize,
    },
    /// Somebody was forgotten, and encrypted remnants could not be removed.
    #[error(
        "forgotten, but encrypted remnants are left in {path} ({what}): mend that, then \
         `hachi people list` removes them"
    )]
    Remnants {
        /// The path.
        path: PathBuf,
        /// What kept them from being removed.
        what: String,
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

impl PeopleError {
    /// What SQLite's error means for the file.
    pub(super) fn of(path: &Path, error: &rusqlite::Error) -> Self {
        let path = path.to_owned();
        let what = error.to_string();
        match Fault::of(error) {
            Fault::Full => Self::Full { path },
            Fault::ReadOnly => Self::NotOurs { path },
            Fault::InUse => Self::InUse { path },
            Fault::NotADatabase => Self::NotAStore { path, seen: what },
            Fault::Damaged => Self::Damaged { path, what },
            Fault::CannotOpen => Self::NotOurs { path },
            Fault::Other => Self::Other { path, what },
        }
    }

    /// What the system's error means for a file.
    pub(super) fn of_system(path: &Path, error: &std::io::Error) -> Self {
        use std::io::ErrorKind;
        let path = path.to_owned();
        match error.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => Self::NotOurs { path },
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::Full { path },
            _ => Self::Other {
                path,
                what: error.to_string(),
            },
        }
    }
}
