//! Forgetting: nothing of a person is left in any file.
//!
//! First, in one small transaction that fits on a nearly full disk, the person is gone for every reader
//! and the store is marked. Then their key is destroyed, their pictures are deleted, and the store is
//! written anew: `VACUUM` leaves no deleted bytes in its pages, a truncating checkpoint none in the log
//! beside it. Only then is the mark taken away. Killed in between, the next program to open the store
//! goes on at the mark.

use rusqlite::Connection;

use super::PeopleError;
use super::file::PeopleFile;
use super::person::{PersonEntry, StoredId};

/// The log is tried to be emptied so often, and after such a pause.
const CHECKPOINTS: u32 = 20;
const BETWEEN: std::time::Duration = std::time::Duration::from_millis(20);

impl PeopleFile {
    /// Forgets a person: when this is done nothing of them is left in the store, the log beside it, or
    /// the key file.
    ///
    /// # Errors
    /// [`PeopleError::Unknown`]; nothing could be changed; or [`PeopleError::Remnants`]: they are
    /// forgotten, and something sealed could not be removed yet.
    pub fn forget(&mut self, person: &PersonEntry) -> Result<(), PeopleError> {
        match self.delete(person.id)? {
            true => self.remove_remnants(),
            false => Err(PeopleError::Unknown {
                name: person.name.clone(),
            }),
        }
    }

    /// Forgets those who can't be read; how many.
    ///
    /// # Errors
    /// As [`forget`](Self::forget).
    pub fn forget_unreadable(&mut self) -> Result<usize, PeopleError> {
        let unreadable = self.list()?.unreadable;
        for id in &unreadable {
            self.delete(*id)?;
        }
        if !unreadable.is_empty() {
            self.remove_remnants()?;
        }
        Ok(unreadable.len())
    }

    /// Whether sealed remnants of somebody who was forgotten are left.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn has_remnants(&self) -> Result<bool, PeopleError> {
        let mark = mark(&self.connection).map_err(|error| self.problem(&error))?;
        Ok(mark != 0)
    }

    /// Whether there was such a person.
    fn delete(&mut self, person: StoredId) -> Result<bool, PeopleError> {
        self.write(|change| {
            let there = change.run("DELETE FROM person WHERE id = ?1", [person.0])? == 1;
            if there {
                change.run("DELETE FROM model WHERE person = ?1", [person.0])?;
                change.run(
                    "UPDATE about SET value = value + 1 WHERE key = 'unclean'",
                    [],
                )?;
            }
            Ok(there)
        })
    }

    fn remove_remnants(&mut self) -> Result<(), PeopleError> {
        self.clean().map_err(|error| PeopleError::Remnants {
            path: self.paths.file.clone(),
            what: error.to_string(),
        })
    }

    /// Removes what is left of everybody who was forgotten.
    pub(super) fn clean(&mut self) -> Result<(), PeopleError> {
        let begun = mark(&self.connection).map_err(|error| self.problem(&error))?;
        let key_path = self.paths.key.clone();
        self.write(|change| {
            let known = change.numbers("SELECT id FROM person", [])?;
            change.ring.keys.retain(|id, _| known.contains(id));
            change.ring.write(&key_path)?;
            let orphans = "DELETE FROM image WHERE person NOT IN (SELECT id FROM person)";
            change.run(orphans, [])?;
            Ok(())
        })?;
        let empty_log = || -> rusqlite::Result<bool> {
            let checkpoint = "PRAGMA wal_checkpoint(TRUNCATE)";
            self.connection.query_row(checkpoint, [], |row| {
                row.get::<_, i64>(0).map(|busy| busy != 0)
            })
        };
        let anew = || -> rusqlite::Result<bool> {
            self.connection.execute_batch("VACUUM")?;
            // One that meets another program's does not wait for it, whatever the patience.
            for _ in 1..CHECKPOINTS {
                if !empty_log()? {
                    return Ok(false);
                }
                std::thread::sleep(BETWEEN);
            }
            empty_log()
        };
        if anew().map_err(|error| self.problem(&error))? {
            return Err(PeopleError::InUse {
                path: self.paths.file.clone(),
            });
        }
        self.write(|change| {
            // Somebody else who was forgotten meanwhile has raised the mark: theirs stays.
            let done = "UPDATE about SET value = 0 WHERE key = 'unclean' AND value = ?1";
            change.run(done, [begun])?;
            Ok(())
        })
    }
}

fn mark(connection: &Connection) -> rusqlite::Result<i64> {
    let query = "SELECT value FROM about WHERE key = 'unclean'";
    connection.query_row(query, [], |row| row.get(0))
}
