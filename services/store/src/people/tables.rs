//! The tables of a store of people, and how a store is opened.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use super::PeopleError;
use crate::schema;

/// Says in the file's header that it is a store of people: "HACP".
const APPLICATION_ID: i64 = 0x4841_4350;
/// The tables' version. A change that older programs can't read adds one.
pub(super) const VERSION: i64 = 1;
/// The largest value of one column, bytes: a picture with its seal.
const LARGEST_VALUE: i32 = 2 << 20;
/// How long a change waits for another program's.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);

/// What is not sealed is a person's number, which is drawn at random, and how many pictures they have.
/// `about.unclean` counts up with each person who was forgotten, and is nought once nothing is left.
const TABLES: &str = "
CREATE TABLE about (key TEXT PRIMARY KEY, value BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE person (id INTEGER PRIMARY KEY, record BLOB NOT NULL);
CREATE TABLE model (person INTEGER PRIMARY KEY, sealed BLOB NOT NULL);
CREATE TABLE image (id INTEGER PRIMARY KEY, person INTEGER NOT NULL, sealed BLOB NOT NULL);
CREATE INDEX image_of_person ON image (person);
INSERT INTO about VALUES ('unclean', 0);
";

const NAMES: [&str; 4] = ["about", "person", "model", "image"];

/// Opens the data base and changes nothing of it.
pub(super) fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)?;
    connection.busy_timeout(PATIENCE)?;
    schema::guard(&connection, LARGEST_VALUE)?;
    Ok(connection)
}

/// Every change on the disk when it is done, nothing deleted left in it. It changes the file: for a
/// new one or a store of ours alone.
pub(super) fn settle(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "temp_store", "MEMORY")?;
    connection.pragma_update(None, "secure_delete", true)?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")
}

/// Whether nothing was ever written to it.
pub(super) fn is_new(connection: &Connection) -> rusqlite::Result<bool> {
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
    Ok(tables == 0 && number(connection, "application_id")? == 0)
}

/// Makes the tables of a new store, whose keys have this number.
pub(super) fn make(connection: &Connection, keys: &[u8; 16]) -> rusqlite::Result<()> {
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.pragma_update(None, "user_version", VERSION)?;
    connection.execute_batch(TABLES)?;
    connection.execute("INSERT INTO about VALUES ('keys', ?1)", [&keys[..]])?;
    Ok(())
}

/// Whether it is a store of ours.
pub(super) fn check_kind(connection: &Connection, path: &Path) -> Result<(), PeopleError> {
    let problem = |error: rusqlite::Error| PeopleError::of(path, &error);
    if number(connection, "application_id").map_err(problem)? != APPLICATION_ID {
        return Err(PeopleError::NotAStore {
            path: path.to_owned(),
            seen: "another program's data base".to_owned(),
        });
    }
    let found = number(connection, "user_version").map_err(problem)?;
    if found != VERSION {
        return Err(PeopleError::Version {
            path: path.to_owned(),
            found,
            supported: VERSION,
        });
    }
    match schema::missing_table(connection, &NAMES).map_err(problem)? {
        None => Ok(()),
        Some(name) => Err(PeopleError::Damaged {
            path: path.to_owned(),
            what: format!("it has no table {name:?}"),
        }),
    }
}

fn number(connection: &Connection, pragma: &str) -> rusqlite::Result<i64> {
    connection.pragma_query_value(None, pragma, |row| row.get(0))
}
