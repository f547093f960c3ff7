//! A store of people: opening, listing, loading.

use std::fs::{DirBuilder, OpenOptions};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use hachi_people::identify::AppearanceModel;
use rusqlite::{Connection, OptionalExtension, TransactionBehavior};

use super::change::{check_form_of_name, check_free};
use super::keys::KeyRing;
use super::person::{Listing, PersonEntry, StoredId, StoredImages, StoredModel};
use super::seal::Place;
use super::{NetworkIdentity, PeopleError, codec, tables};

/// Where a store lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PeoplePaths {
    /// The store.
    pub file: PathBuf,
    /// Its key file.
    pub key: PathBuf,
}

impl PeoplePaths {
    /// A store with its key file beside it, which ends in `.key`.
    pub fn beside(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            key: file.with_extension("key"),
        }
    }

    /// A store with this key file; without one named, beside it.
    pub fn with_key(file: &Path, key: Option<&Path>) -> Self {
        let beside = Self::beside(file);
        Self {
            key: key.map_or(beside.key, Path::to_owned),
            ..beside
        }
    }
}

/// A store of people.
#[derive(Debug)]
pub struct PeopleFile {
    pub(super) paths: PeoplePaths,
    pub(super) connection: Connection,
    seen_version: i64,
}

impl PeopleFile {
    /// Opens a store; makes it, and its key file, if there is none.
    ///
    /// # Errors
    /// [`PeopleError`].
    pub fn open_or_create(paths: &PeoplePaths) -> Result<Self, PeopleError> {
        for path in [&paths.file, &paths.key] {
            let folder = path.parent().filter(|folder| *folder != Path::new(""));
            if let Some(folder) = folder {
                let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
                made.map_err(|error| PeopleError::of_system(folder, &error))?;
            }
        }
        // SQLite gives the files beside it the same mode.
        let touched = OpenOptions::new()
            .append(true)
            .create(true)
            .mode(0o600)
            .open(&paths.file);
        match touched {
            Ok(_) => Self::open(paths),
            Err(_) if paths.file.is_dir() => Self::open(paths),
            Err(error) => Err(PeopleError::of_system(&paths.file, &error)),
        }
    }

    /// Opens a store; `None` if there is none.
    ///
    /// # Errors
    /// [`PeopleError`].
    pub fn open_if_there(paths: &PeoplePaths) -> Result<Option<Self>, PeopleError> {
        match paths.file.try_exists() {
            Ok(true) => Self::open(paths).map(Some),
            Ok(false) => Ok(None),
            Err(error) => Err(PeopleError::of_system(&paths.file, &error)),
        }
    }

    fn open(paths: &PeoplePaths) -> Result<Self, PeopleError> {
        let path = &paths.file;
        if path.is_dir() {
            return Err(PeopleError::NotAStore {
                path: path.clone(),
                seen: "a folder".to_owned(),
            });
        }
        let problem = |error: rusqlite::Error| PeopleError::of(path, &error);
        let mut connection = tables::connect(path).map_err(problem)?;
        if tables::is_new(&connection).map_err(problem)? {
            tables::settle(&connection).map_err(problem)?;
            make(&mut connection, paths)?;
        }
        tables::check_kind(&connection, path)?;
        tables::settle(&connection).map_err(problem)?;
        let mut store = Self {
            paths: paths.clone(),
            connection,
            seen_version: 0,
        };
        store.ring()?;
        store.seen_version = store.version()?;
        if store.has_remnants()? {
            // Somebody was forgotten and the program killed before nothing was left. Where that can't
            // be done now (a full disk), everything else still can.
            let _ = store.clean();
        }
        Ok(store)
    }

    /// How long a change waits for another program's before it is [`PeopleError::InUse`]: five seconds
    /// unless said otherwise.
    ///
    /// # Errors
    /// None that is known.
    pub fn set_patience(&self, patience: Duration) -> Result<(), PeopleError> {
        let set = self.connection.busy_timeout(patience);
        set.map_err(|error| self.problem(&error))
    }

    /// Lets the store grow to so many bytes and no further: saving then fails as on a full disk. A
    /// store that is larger stays as it is.
    ///
    /// # Errors
    /// It can't be read.
    pub fn set_quota(&self, bytes: u64) -> Result<(), PeopleError> {
        crate::file::set_quota(&self.connection, bytes).map_err(|error| self.problem(&error))
    }

    /// Whether another program, or another part of this one, has changed something since this was
    /// asked last: somebody was enrolled, renamed or forgotten, or a model saved.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn has_changed(&mut self) -> Result<bool, PeopleError> {
        let version = self.version()?;
        let changed = version != self.seen_version;
        self.seen_version = version;
        Ok(changed)
    }

    fn version(&self) -> Result<i64, PeopleError> {
        let version = self
            .connection
            .pragma_query_value(None, "data_version", |row| row.get(0));
        version.map_err(|error| self.problem(&error))
    }

    /// Everybody.
    ///
    /// # Errors
    /// The store or its key file can't be read.
    pub fn list(&self) -> Result<Listing, PeopleError> {
        let first = self.snapshot()?;
        if first.unreadable.is_empty() {
            return Ok(first);
        }
        // Rows are read before keys: whoever was forgotten in between seems to have lost theirs.
        self.snapshot()
    }

    fn snapshot(&self) -> Result<Listing, PeopleError> {
        let transaction = self.connection.unchecked_transaction();
        let transaction = transaction.map_err(|error| self.problem(&error))?;
        listing(&transaction, &self.paths)
    }

    /// Who has this name.
    ///
    /// # Errors
    /// [`PeopleError::Unknown`], or the store can't be read.
    pub fn find(&self, name: &str) -> Result<PersonEntry, PeopleError> {
        let mut people = self.list()?.people.into_iter();
        let found = people.find(|person| person.name == name);
        found.ok_or_else(|| PeopleError::Unknown {
            name: name.to_owned(),
        })
    }

    /// Whether somebody new may have this name.
    ///
    /// # Errors
    /// It is none, or taken.
    pub fn check_name(&self, name: &str) -> Result<(), PeopleError> {
        let name = check_form_of_name(name)?;
        check_free(&self.list()?, name, None)
    }

    /// A person's model, and which network made it.
    ///
    /// # Errors
    /// They are not there any more, or the model is damaged.
    pub fn model(&self, person: &PersonEntry) -> Result<StoredModel, PeopleError> {
        let query = "SELECT sealed FROM model WHERE person = ?1";
        let sealed = self
            .connection
            .query_row(query, [person.id.0], |row| row.get::<_, Vec<u8>>(0))
            .optional()
            .map_err(|error| self.problem(&error))?;
        let (key, sealed) = match (self.ring()?.keys.remove(&person.id.0), sealed) {
            (Some(key), Some(sealed)) => (key, sealed),
            _ => return Err(self.gone(person)),
        };
        let damaged = |what: String| PeopleError::DamagedPerson {
            path: self.paths.file.clone(),
            name: person.name.clone(),
            what,
        };
        let opened = key.open(&Place::Model(person.id.0), &sealed);
        let bytes = opened.ok_or_else(|| damaged("the model".to_owned()))?;
        let (network, model) =
            codec::decode_model(&bytes).map_err(|error| damaged(error.to_string()))?;
        Ok(StoredModel { network, model })
    }

    /// A person's model, if this network made it.
    ///
    /// # Errors
    /// As [`model`](Self::model), and [`PeopleError::OtherNetwork`].
    pub fn model_of(
        &self,
        person: &PersonEntry,
        network: &NetworkIdentity,
    ) -> Result<AppearanceModel, PeopleError> {
        let stored = self.model(person)?;
        match stored.network.is(network) {
            true => Ok(stored.model),
            false => Err(PeopleError::OtherNetwork {
                name: person.name.clone(),
                found: Box::new(stored.network),
                asked: Box::new(network.clone()),
            }),
        }
    }

    /// A person's pictures; damaged ones are left out and counted.
    ///
    /// # Errors
    /// They are not there any more.
    pub fn images(&self, person: &PersonEntry) -> Result<StoredImages, PeopleError> {
        let rows = || -> rusqlite::Result<Vec<(i64, Vec<u8>)>> {
            let query = "SELECT id, sealed FROM image WHERE person = ?1 ORDER BY id";
            let mut statement = self.connection.prepare_cached(query)?;
            let rows = statement.query_map([person.id.0], |row| Ok((row.get(0)?, row.get(1)?)))?;
            rows.collect()
        };
        let rows = rows().map_err(|error| self.problem(&error))?;
        let key = self.ring()?.keys.remove(&person.id.0);
        let key = key.ok_or_else(|| self.gone(person))?;
        let mut stored = StoredImages::default();
        for (image, sealed) in rows {
            let place = Place::Image {
                person: person.id.0,
                image,
            };
            match key.open(&place, &sealed) {
                Some(bytes) => stored.images.push(bytes.to_vec()),
                None => stored.damaged += 1,
            }
        }
        Ok(stored)
    }

    fn ring(&self) -> Result<KeyRing, PeopleError> {
        read_ring(&self.connection, &self.paths)
    }

    pub(super) fn problem(&self, error: &rusqlite::Error) -> PeopleError {
        PeopleError::of(&self.paths.file, error)
    }

    fn gone(&self, person: &PersonEntry) -> PeopleError {
        PeopleError::Unknown {
            name: person.name.clone(),
        }
    }
}

/// The tables and the key file of a new store.
fn make(connection: &mut Connection, paths: &PeoplePaths) -> Result<(), PeopleError> {
    let problem = |error: rusqlite::Error| PeopleError::of(&paths.file, &error);
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate);
    let transaction = transaction.map_err(problem)?;
    if !tables::is_new(&transaction).map_err(problem)? {
        return Ok(()); // another program was quicker
    }
    let ring = match KeyRing::read(&paths.key)? {
        // Left by one that was killed between the two files.
        Some(ring) if ring.keys.is_empty() => ring,
        Some(_) => return Err(wrong_keys(paths)),
        None => {
            let ring = KeyRing::new().map_err(|error| no_random(&paths.file, error))?;
            ring.write(&paths.key)?;
            ring
        }
    };
    tables::make(&transaction, &ring.id).map_err(problem)?;
    transaction.commit().map_err(problem)
}

/// The keys that belong to the store.
pub(super) fn read_ring(
    connection: &Connection,
    paths: &PeoplePaths,
) -> Result<KeyRing, PeopleError> {
    let query = "SELECT value FROM about WHERE key = 'keys'";
    let id = connection.query_row(query, [], |row| row.get::<_, Vec<u8>>(0));
    let id = id.map_err(|error| PeopleError::of(&paths.file, &error))?;
    match KeyRing::read(&paths.key)? {
        None => Err(PeopleError::NoKeys {
            key: paths.key.clone(),
            path: paths.file.clone(),
        }),
        Some(ring) if ring.id[..] != id[..] => Err(wrong_keys(paths)),
        Some(ring) => Ok(ring),
    }
}

fn wrong_keys(paths: &PeoplePaths) -> PeopleError {
    PeopleError::WrongKeys {
        key: paths.key.clone(),
        path: paths.file.clone(),
    }
}

pub(super) fn no_random(path: &Path, error: getrandom::Error) -> PeopleError {
    PeopleError::Other {
        path: path.to_owned(),
        what: format!("the system gives no random numbers ({error})"),
    }
}

/// Numbers, records, and how many pictures there are, of everybody.
pub(super) fn listing(
    connection: &Connection,
    paths: &PeoplePaths,
) -> Result<Listing, PeopleError> {
    let rows = || -> rusqlite::Result<Vec<(i64, Vec<u8>, i64)>> {
        let query = "SELECT id, record, (SELECT count(*) FROM image WHERE image.person = person.id) \
                     FROM person";
        let mut statement = connection.prepare_cached(query)?;
        let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))?;
        rows.collect()
    };
    let rows = rows().map_err(|error| PeopleError::of(&paths.file, &error))?;
    let ring = read_ring(connection, paths)?;
    let mut known = Listing::default();
    for (id, record, images) in rows {
        let opened = ring.keys.get(&id);
        let opened = opened.and_then(|key| key.open(&Place::Record(id), &record));
        let record = opened.and_then(|bytes| codec::decode_record(&bytes).ok());
        match record {
            None => known.unreadable.push(StoredId(id)),
            Some(record) => known.people.push(PersonEntry {
                id: StoredId(id),
                name: record.name,
                enrolled_unix_s: record.enrolled_unix_s,
                images: usize::try_from(images).unwrap_or_default(),
            }),
        }
    }
    known.people.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(known)
}
