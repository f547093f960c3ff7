//! ROS 2 bags in SQLite files, as rosbag2's `sqlite3` storage writes them.
//!
//! In: tables `topics` (id, name, type, serialization_format) and `messages` (topic_id,
//! timestamp, data). The file is opened as immutable: SQLite then takes no lock and writes
//! nothing, not even beside it. What a crashed recorder left in a write-ahead log is therefore
//! not seen; [`Storage::notes`] says so.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hachi_hal::Stamp;
use rusqlite::config::DbConfig;
use rusqlite::limits::Limit;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags};

use super::{BLOCK_LIMIT, Storage, Topic};
use crate::error::BagError;

/// More topics than any robot has; each is kept in memory.
const TOPIC_LIMIT: usize = 100_000;

#[derive(Debug)]
pub(super) struct Db3 {
    path: PathBuf,
    connection: Connection,
    topics: Vec<Topic>,
    notes: Vec<String>,
    /// Record time, row and topic of every message of a kind that is read, oldest first.
    index: Vec<(i64, i64, usize)>,
    next: usize,
}

impl Db3 {
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let problem = |error: rusqlite::Error| broken(path, "open", &error);
        let mut connection = open_immutable(path).map_err(problem)?;
        guard(&mut connection, path)?;
        check_table(&connection, path, "topics")?;
        check_table(&connection, path, "messages")?;
        let (topics, by_id) = read_topics(&connection, path)?;
        let mut db3 = Self {
            path: path.to_path_buf(),
            connection,
            topics,
            notes: Vec::new(),
            index: Vec::new(),
            next: 0,
        };
        db3.read_index(&by_id)?;
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        if std::fs::metadata(&log).is_ok_and(|about| about.len() > 0) {
            db3.notes.push(
                "a write-ahead log lies beside it and is not read: run `sqlite3 FILE 'PRAGMA \
                 wal_checkpoint'` on a copy to have its messages too"
                    .into(),
            );
        }
        Ok(db3)
    }

    fn read_index(&mut self, by_id: &HashMap<i64, usize>) -> Result<(), BagError> {
        let mut orphans = 0_u64;
        let mut read = || -> rusqlite::Result<()> {
            let mut statement = self
                .connection
                .prepare("SELECT rowid, topic_id, timestamp FROM messages")?;
            let mut rows = statement.query([])?;
            while let Some(row) = rows.next()? {
                let (id, topic_id, stamp) = (
                    row.get_ref(0)?.as_i64(),
                    row.get_ref(1)?.as_i64(),
                    row.get_ref(2)?.as_i64(),
                );
                let (Ok(id), Ok(topic_id), Ok(stamp)) = (id, topic_id, stamp) else {
                    orphans += 1;
                    continue;
                };
                let Some(&topic) = by_id.get(&topic_id) else {
                    orphans += 1;
                    continue;
                };
                self.topics[topic].messages += 1;
                if self.topics[topic].kind.is_some() {
                    self.index.push((stamp, id, topic));
                }
            }
            Ok(())
        };
        // A file cut short fails where its pages end; the messages before are good.
        if let Err(error) = read() {
            self.notes.push(format!(
                "the list of messages breaks off ({error}): read up to there"
            ));
        }
        if orphans > 0 {
            self.notes.push(format!(
                "{orphans} messages belong to no topic and are left out"
            ));
        }
        self.index.sort_unstable();
        Ok(())
    }
}

impl Storage for Db3 {
    fn path(&self) -> &Path {
        &self.path
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn next(
        &mut self,
        wanted: &[bool],
        buffer: &mut Vec<u8>,
    ) -> Result<Option<(usize, Stamp)>, BagError> {
        while let Some(&(stamp, id, topic)) = self.index.get(self.next) {
            self.next += 1;
            if !wanted[topic] {
                continue;
            }
            let problem = |error: rusqlite::Error| broken(&self.path, "read a message of", &error);
            let mut statement = self
                .connection
                .prepare_cached("SELECT data FROM messages WHERE rowid = ?1")
                .map_err(problem)?;
            let mut rows = statement.query([id]).map_err(problem)?;
            let row = rows.next().map_err(problem)?;
            let value = row.map(|row| row.get_ref(0)).transpose().map_err(problem)?;
            let Some(ValueRef::Blob(data)) = value else {
                return Err(BagError::Container {
                    path: self.path.clone(),
                    problem: format!("message {id} has no bytes in its data column"),
                });
            };
            buffer.clear();
            buffer.extend_from_slice(data);
            return Ok(Some((topic, Stamp::from_nanos(stamp))));
        }
        Ok(None)
    }
}

/// Opens without locks, journals or writes. The path travels in a URI, so its special characters
/// are escaped.
fn open_immutable(path: &Path) -> rusqlite::Result<Connection> {
    let mut uri = String::from("file:");
    for &byte in path.as_os_str().as_encoded_bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-~".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            // Writing to a string cannot fail.
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri.push_str("?mode=ro&immutable=1");
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_URI
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    Connection::open_with_flags(uri, flags)
}

/// A schema is a program; a recording's must not run for ever, nor ask for much memory.
fn guard(connection: &mut Connection, path: &Path) -> Result<(), BagError> {
    /// Steps of SQLite's machine between two looks at the budget.
    const STEPS: i32 = 1_000_000;
    let problem = |error: rusqlite::Error| broken(path, "open", &error);
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)
        .map_err(problem)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)
        .map_err(problem)?;
    connection
        .set_limit(Limit::SQLITE_LIMIT_LENGTH, BLOCK_LIMIT as i32)
        .map_err(problem)?;
    // Reading a message takes some twenty steps and at least as many bytes of the file.
    let bytes = std::fs::metadata(path).map_or(0, |about| about.len());
    let mut left = bytes.saturating_mul(16) / STEPS as u64 + 100;
    let spent = move || {
        left = left.saturating_sub(1);
        left == 0
    };
    connection
        .progress_handler(STEPS, Some(spent))
        .map_err(problem)
}

/// Makes sure that a table is one: no view, no virtual table, no computed columns.
fn check_table(connection: &Connection, path: &Path, table: &str) -> Result<(), BagError> {
    let not_a_bag = |problem: String| BagError::Container {
        path: path.to_path_buf(),
        problem,
    };
    let plain: rusqlite::Result<i64> = connection.query_row(
        "SELECT count(*) FROM sqlite_schema WHERE name = ?1 AND type = 'table' AND rootpage > 0",
        [table],
        |row| row.get(0),
    );
    match plain {
        Ok(1) => {}
        Ok(_) => {
            return Err(not_a_bag(format!(
                "an SQLite file without a table {table}: no ROS 2 bag"
            )));
        }
        Err(error) => return Err(broken(path, "open", &error)),
    }
    let computed: rusqlite::Result<i64> = connection.query_row(
        "SELECT count(*) FROM pragma_table_xinfo(?1) WHERE hidden <> 0",
        [table],
        |row| row.get(0),
    );
    match computed {
        Ok(0) => Ok(()),
        Ok(_) => Err(not_a_bag(format!(
            "table {table} has computed columns, which no recorder writes"
        ))),
        Err(error) => Err(broken(path, "open", &error)),
    }
}

fn read_topics(
    connection: &Connection,
    path: &Path,
) -> Result<(Vec<Topic>, HashMap<i64, usize>), BagError> {
    let problem = |error: rusqlite::Error| broken(path, "list the topics of", &error);
    let mut statement = connection
        .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
        .map_err(problem)?;
    let mut rows = statement.query([]).map_err(problem)?;
    let mut topics = Vec::new();
    let mut by_id = HashMap::new();
    while let Some(row) = rows.next().map_err(problem)? {
        let read = || -> rusqlite::Result<(i64, Topic)> {
            let text = |column| -> rusqlite::Result<&str> { Ok(row.get_ref(column)?.as_str()?) };
            Ok((row.get(0)?, Topic::new(text(1)?, text(2)?, text(3)?)))
        };
        let (id, topic) = read().map_err(problem)?;
        if topics.len() == TOPIC_LIMIT {
            return Err(BagError::Container {
                path: path.to_path_buf(),
                problem: format!("more than {TOPIC_LIMIT} topics"),
            });
        }
        by_id.insert(id, topics.len());
        topics.push(topic);
    }
    Ok((topics, by_id))
}

fn broken(path: &Path, doing: &str, error: &rusqlite::Error) -> BagError {
    BagError::Container {
        path: path.to_path_buf(),
        problem: format!("SQLite cannot {doing} it: {error}"),
    }
}
