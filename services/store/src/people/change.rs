//! Changes to a store of people: enrolling, saving, renaming.
//!
//! Each is one transaction, which holds the store's write lock from its first look to its end.

use std::collections::BTreeSet;

use hachi_people::identify::AppearanceModel;
use rusqlite::{Params, Transaction, TransactionBehavior, params};

use super::codec::{self, LONGEST_NAME, Record};
use super::file::{PeopleFile, PeoplePaths, listing, no_random, read_ring};
use super::keys::KeyRing;
use super::person::{
    Listing, MOST_IMAGE_BYTES, MOST_IMAGES, MOST_PEOPLE, NewPerson, PersonEntry, StoredId,
};
use super::seal::{Key, Place};
use super::{NetworkIdentity, PeopleError};

impl PeopleFile {
    /// Keeps a new person. Of more than [`MOST_IMAGES`] pictures the newest are kept.
    ///
    /// # Errors
    /// The name is none or taken, something is no model or picture, or it can't be written; nothing
    /// is kept then.
    pub fn enrol(&mut self, person: &NewPerson<'_>) -> Result<PersonEntry, PeopleError> {
        let name = check_form_of_name(person.name)?;
        check_model(person.model)?;
        check_images(person.images)?;
        self.write(|change| {
            let known = change.listing()?;
            check_free(&known, name, None)?;
            if known.people.len() + known.unreadable.len() >= MOST_PEOPLE {
                return Err(PeopleError::TooMany { most: MOST_PEOPLE });
            }
            let key = change.random(Key::random())?;
            let id = change.new_number()?;
            // The key first: a person without one could never be read, a key without a person is
            // nobody's.
            change.ring.keys.insert(id.0, key.clone());
            change.ring.write(&change.paths.key)?;
            let record = Record {
                name: name.to_owned(),
                enrolled_unix_s: person.enrolled_unix_s,
            };
            let record = codec::encode_record(&record);
            let record = change.random(key.seal(&Place::Record(id.0), &record))?;
            change.run("INSERT INTO person VALUES (?1, ?2)", params![id.0, record])?;
            let model = codec::encode_model(person.network, person.model);
            let model = change.random(key.seal(&Place::Model(id.0), &model))?;
            change.run("INSERT INTO model VALUES (?1, ?2)", params![id.0, model])?;
            change.put_images(id, &key, person.images)?;
            Ok(PersonEntry {
                id,
                name: name.to_owned(),
                enrolled_unix_s: person.enrolled_unix_s,
                images: person.images.len().min(MOST_IMAGES),
            })
        })
    }

    /// Saves what a person looks like by now, and which network says so.
    ///
    /// # Errors
    /// They were forgotten meanwhile ([`PeopleError::Unknown`]), it is no model, or it can't be written.
    pub fn save_model(
        &mut self,
        person: &PersonEntry,
        network: &NetworkIdentity,
        model: &AppearanceModel,
    ) -> Result<(), PeopleError> {
        check_model(model)?;
        self.write(|change| {
            let key = change.key(person)?;
            let bytes = codec::encode_model(network, model);
            let sealed = change.random(key.seal(&Place::Model(person.id.0), &bytes))?;
            let update = "UPDATE model SET sealed = ?2 WHERE person = ?1";
            change.run(update, params![person.id.0, sealed])?;
            Ok(())
        })
    }

    /// Adds pictures of a person, oldest first; beyond [`MOST_IMAGES`] their oldest ones go.
    ///
    /// # Errors
    /// As [`save_model`](Self::save_model).
    pub fn add_images(
        &mut self,
        person: &PersonEntry,
        images: &[Vec<u8>],
    ) -> Result<(), PeopleError> {
        check_images(images)?;
        self.write(|change| {
            let key = change.key(person)?;
            change.put_images(person.id, &key, images)
        })
    }

    /// Gives a person another name.
    ///
    /// # Errors
    /// As [`enrol`](Self::enrol), and [`PeopleError::Unknown`].
    pub fn rename(&mut self, person: &PersonEntry, name: &str) -> Result<(), PeopleError> {
        let name = check_form_of_name(name)?;
        self.write(|change| {
            let key = change.key(person)?;
            check_free(&change.listing()?, name, Some(person.id))?;
            let record = codec::encode_record(&Record {
                name: name.to_owned(),
                enrolled_unix_s: person.enrolled_unix_s,
            });
            let sealed = change.random(key.seal(&Place::Record(person.id.0), &record))?;
            let update = "UPDATE person SET record = ?2 WHERE id = ?1";
            change.run(update, params![person.id.0, sealed])?;
            Ok(())
        })
    }

    /// One change: all of it, on the disk, or nothing.
    pub(super) fn write<T>(
        &mut self,
        change: impl FnOnce(&mut Change<'_>) -> Result<T, PeopleError>,
    ) -> Result<T, PeopleError> {
        let Self {
            paths, connection, ..
        } = self;
        let problem = |error: rusqlite::Error| PeopleError::of(&paths.file, &error);
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate);
        let transaction = transaction.map_err(problem)?;
        let mut begun = Change {
            ring: read_ring(&transaction, paths)?,
            transaction,
            paths,
        };
        let outcome = change(&mut begun)?;
        begun.transaction.commit().map_err(problem)?;
        Ok(outcome)
    }
}

/// A change that has begun.
pub(super) struct Change<'a> {
    pub(super) transaction: Transaction<'a>,
    pub(super) ring: KeyRing,
    paths: &'a PeoplePaths,
}

impl Change<'_> {
    /// Runs one statement; how many rows it changed.
    pub(super) fn run(&self, statement: &str, values: impl Params) -> Result<usize, PeopleError> {
        let run = || self.transaction.prepare_cached(statement)?.execute(values);
        run().map_err(|error| PeopleError::of(&self.paths.file, &error))
    }

    /// Numbers of one column.
    pub(super) fn numbers(
        &self,
        query: &str,
        values: impl Params,
    ) -> Result<BTreeSet<i64>, PeopleError> {
        let numbers = || -> rusqlite::Result<BTreeSet<i64>> {
            let mut statement = self.transaction.prepare_cached(query)?;
            let rows = statement.query_map(values, |row| row.get(0))?;
            rows.collect()
        };
        numbers().map_err(|error| PeopleError::of(&self.paths.file, &error))
    }

    fn listing(&self) -> Result<Listing, PeopleError> {
        listing(&self.transaction, self.paths)
    }

    /// The key of a person who is there.
    fn key(&self, person: &PersonEntry) -> Result<Key, PeopleError> {
        let here = self.numbers("SELECT id FROM person WHERE id = ?1", [person.id.0])?;
        let key = self.ring.keys.get(&person.id.0);
        let key = key.filter(|_| !here.is_empty());
        key.cloned().ok_or_else(|| PeopleError::Unknown {
            name: person.name.clone(),
        })
    }

    fn new_number(&self) -> Result<StoredId, PeopleError> {
        let drawn = self.random(getrandom::u64())?;
        // The upper half is negative; a number that is taken comes up once in the life of a galaxy.
        Ok(StoredId((drawn >> 1) as i64))
    }

    fn random<T>(&self, drawn: Result<T, getrandom::Error>) -> Result<T, PeopleError> {
        drawn.map_err(|error| no_random(&self.paths.file, error))
    }

    fn put_images(
        &self,
        person: StoredId,
        key: &Key,
        images: &[Vec<u8>],
    ) -> Result<(), PeopleError> {
        let newest = self.numbers("SELECT coalesce(max(id), 0) FROM image", [])?;
        let newest = newest.first().copied().unwrap_or_default();
        let kept = images.len().saturating_sub(MOST_IMAGES);
        for (image, bytes) in (newest + 1..).zip(&images[kept..]) {
            let place = Place::Image {
                person: person.0,
                image,
            };
            let sealed = self.random(key.seal(&place, bytes))?;
            let insert = "INSERT INTO image VALUES (?1, ?2, ?3)";
            self.run(insert, params![image, person.0, sealed])?;
        }
        let own = self.numbers("SELECT id FROM image WHERE person = ?1", [person.0])?;
        let more = own.len().saturating_sub(MOST_IMAGES);
        for image in own.iter().take(more) {
            self.run("DELETE FROM image WHERE id = ?1", [image])?;
        }
        Ok(())
    }
}

/// The name without white space around it, if it has the form of one.
///
/// # Errors
/// [`PeopleError::NotAName`].
pub fn check_form_of_name(name: &str) -> Result<&str, PeopleError> {
    let trimmed = name.trim();
    let length = trimmed.chars().count();
    if !(1..=LONGEST_NAME).contains(&length) || trimmed.chars().any(char::is_control) {
        return Err(PeopleError::NotAName {
            name: name.chars().take(LONGEST_NAME).collect(),
            longest: LONGEST_NAME,
        });
    }
    Ok(trimmed)
}

/// What could not be loaded again is not said to be saved.
fn check_model(model: &AppearanceModel) -> Result<(), PeopleError> {
    let check = model.statistics().check();
    check.map_err(|source| PeopleError::NotAModel { source })
}

fn check_images(images: &[Vec<u8>]) -> Result<(), PeopleError> {
    let fits = |image: &&Vec<u8>| !(1..=MOST_IMAGE_BYTES).contains(&image.len());
    match images.iter().find(fits) {
        None => Ok(()),
        Some(image) => Err(PeopleError::Image {
            bytes: image.len(),
            most: MOST_IMAGE_BYTES,
        }),
    }
}

/// Whether nobody else has the name.
pub(super) fn check_free(
    known: &Listing,
    name: &str,
    own: Option<StoredId>,
) -> Result<(), PeopleError> {
    let mut others = known.people.iter().filter(|p| Some(p.id) != own);
    match others.any(|person| person.name == name) {
        false => Ok(()),
        true => Err(PeopleError::NameTaken {
            name: name.to_owned(),
        }),
    }
}
