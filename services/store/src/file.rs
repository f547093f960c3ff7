//! A map file: opening, creating, writing.

use std::path::{Path, PathBuf};

use hachi_slam::edge::EdgeKind;
use hachi_slam::node::NodeId;
use hachi_slam::saved::SavedMap;
use hachi_slam::store::MapChange;
use hachi_slam::{StoreError, SubmapStore};
use rusqlite::{Connection, OpenFlags, OptionalExtension, Transaction, params};

use crate::error::MapError;
use crate::load::load;
use crate::rows::{column, matrix_bytes, pose_bytes};
use crate::schema::{self, APPLICATION_ID, OLDEST, TABLES, VERSION};

/// Who makes a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// The robot's platform; empty where the base is the sensor.
    pub platform: String,
    /// The sensor's kind, or empty if the recording does not say.
    pub sensor: String,
}

impl Identity {
    fn in_words(&self) -> String {
        match (self.platform.as_str(), self.sensor.as_str()) {
            ("", "") => "a sensor without a robot".to_owned(),
            ("", sensor) => format!("a {sensor} without a robot"),
            (platform, "") => format!("platform {platform}"),
            (platform, sensor) => format!("platform {platform} with a {sensor}"),
        }
    }

    /// Whether maps of the two can be one: an unknown sensor may be any.
    fn fits(&self, other: &Self) -> bool {
        let unknown = self.sensor.is_empty() || other.sensor.is_empty();
        self.platform == other.platform && (unknown || self.sensor == other.sensor)
    }
}

/// What a map is opened for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Reading: several programs at a time.
    Read,
    /// Reading and writing: one at a time.
    Write,
}

/// A map file.
#[derive(Debug)]
pub struct MapFile {
    path: PathBuf,
    connection: Connection,
    identity: Identity,
}

impl MapFile {
    /// Makes a new, empty map.
    ///
    /// # Errors
    /// There is a file already, or it can't be written.
    pub fn create(path: &Path, identity: &Identity) -> Result<Self, MapError> {
        if path.exists() {
            return Err(MapError::Other {
                path: path.to_owned(),
                what: "there is a file already".to_owned(),
            });
        }
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE
            | OpenFlags::SQLITE_OPEN_CREATE
            | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let made = || -> rusqlite::Result<Connection> {
            let mut connection = Connection::open_with_flags(path, flags)?;
            write_safely(&connection)?;
            schema::guard(&connection, schema::LARGEST_VALUE)?;
            let transaction = connection.transaction()?;
            transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
            transaction.pragma_update(None, "user_version", VERSION)?;
            transaction.execute_batch(TABLES)?;
            let about = [
                ("platform", &identity.platform),
                ("sensor", &identity.sensor),
            ];
            for (key, value) in about {
                transaction.execute(
                    "INSERT INTO about (key, value) VALUES (?1, ?2)",
                    [key, value.as_str()],
                )?;
            }
            transaction.commit()?;
            Ok(connection)
        };
        let connection = made().map_err(|error| cannot_open(path, &error))?;
        Ok(Self {
            path: path.to_owned(),
            connection,
            identity: identity.clone(),
        })
    }

    /// Opens a map.
    ///
    /// # Errors
    /// [`MapError`]: it is not there, no map, of another version, damaged, in use or read-only.
    pub fn open(path: &Path, access: Access) -> Result<Self, MapError> {
        if !path.is_file() {
            return Err(MapError::Missing {
                path: path.to_owned(),
            });
        }
        let problem = |error: rusqlite::Error| cannot_open(path, &error);
        let connection = connect(path, access).map_err(problem)?;
        schema::guard(&connection, schema::LARGEST_VALUE).map_err(problem)?;
        check_kind(&connection, path)?;
        if access == Access::Write {
            write_safely(&connection).map_err(problem)?;
            let version = connection.pragma_update(None, "user_version", VERSION);
            version.map_err(problem)?;
        }
        let about = |key: &str| -> Result<String, MapError> {
            connection
                .query_row("SELECT value FROM about WHERE key = ?1", [key], |row| {
                    row.get(0)
                })
                .optional()
                .map_err(problem)
                .map(Option::unwrap_or_default)
        };
        let identity = Identity {
            platform: about("platform")?,
            sensor: about("sensor")?,
        };
        Ok(Self {
            path: path.to_owned(),
            connection,
            identity,
        })
    }

    /// Opens a map to go on with it, or makes it if it is not there.
    ///
    /// # Errors
    /// As [`open`](Self::open) and [`create`](Self::create); also if another robot made it.
    pub fn open_or_create(path: &Path, identity: &Identity) -> Result<Self, MapError> {
        if !path.exists() {
            return Self::create(path, identity);
        }
        let map = Self::open(path, Access::Write)?;
        map.check_identity(identity)?;
        Ok(map)
    }

    /// Whether this robot may use the map.
    ///
    /// # Errors
    /// [`MapError::OtherRobot`].
    pub fn check_identity(&self, identity: &Identity) -> Result<(), MapError> {
        if self.identity.fits(identity) {
            return Ok(());
        }
        Err(MapError::OtherRobot {
            path: self.path.clone(),
            found: self.identity.in_words(),
            expected: identity.in_words(),
        })
    }

    /// Who made it.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Lets the file grow to so many bytes and no further: writing then fails as on a full disk. A
    /// file that is larger stays as it is.
    ///
    /// # Errors
    /// The file can't be read.
    pub fn set_quota(&self, bytes: u64) -> Result<(), MapError> {
        set_quota(&self.connection, bytes).map_err(|error| MapError::of(&self.path, &error))
    }

    /// Reads everything but the submaps.
    ///
    /// # Errors
    /// It is damaged.
    pub fn load(&self) -> Result<SavedMap, MapError> {
        let map = load(&self.connection).map_err(|error| MapError::of(&self.path, &error))?;
        map.check().map_err(|error| MapError::Damaged {
            path: self.path.clone(),
            what: error.to_string(),
        })?;
        Ok(map)
    }

    /// Reads a node's submap, as [`hachi_slam::codec`] wrote it.
    ///
    /// # Errors
    /// It is not there, or the file is damaged.
    pub fn read_submap(&self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), MapError> {
        bytes.clear();
        let read = || -> rusqlite::Result<bool> {
            let mut statement = self
                .connection
                .prepare_cached("SELECT surfaces FROM submap WHERE node = ?1")?;
            let mut rows = statement.query([node.0])?;
            let Some(row) = rows.next()? else {
                return Ok(false);
            };
            bytes.extend_from_slice(row.get_ref(0)?.as_blob()?);
            Ok(true)
        };
        let mut read = read;
        match read() {
            Ok(true) => Ok(()),
            Ok(false) => Err(MapError::Damaged {
                path: self.path.clone(),
                what: format!("node {node} has no submap"),
            }),
            Err(error) => Err(MapError::of(&self.path, &error)),
        }
    }

    /// Keeps a change: all of it, on the disk, or nothing.
    ///
    /// # Errors
    /// No room, no right to write, or a broken disk.
    pub fn write(&mut self, change: &MapChange<'_>) -> Result<(), MapError> {
        let written = || -> rusqlite::Result<()> {
            let transaction = self.connection.transaction()?;
            put(&transaction, change)?;
            transaction.commit()
        };
        let mut written = written;
        written().map_err(|error| MapError::of(&self.path, &error))
    }
}

impl SubmapStore for MapFile {
    fn commit(&mut self, change: &MapChange<'_>) -> Result<(), StoreError> {
        self.write(change).map_err(StoreError::from)
    }

    fn submap(&mut self, node: NodeId, bytes: &mut Vec<u8>) -> Result<(), StoreError> {
        self.read_submap(node, bytes).map_err(StoreError::from)
    }
}

/// Lets a data base grow to so many bytes.
pub(crate) fn set_quota(connection: &Connection, bytes: u64) -> rusqlite::Result<()> {
    let page: i64 = connection.pragma_query_value(None, "page_size", |row| row.get(0))?;
    let pages = i64::try_from(bytes).unwrap_or(i64::MAX) / page.max(1);
    connection.pragma_update(None, "max_page_count", pages.max(1))
}

/// One writer at a time, every transaction on the disk when it is done.
fn write_safely(connection: &Connection) -> rusqlite::Result<()> {
    // Exclusive first: the log's index is then kept in memory, and no third file beside the map.
    connection.pragma_update(None, "locking_mode", "EXCLUSIVE")?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    Ok(())
}

fn connect(path: &Path, access: Access) -> rusqlite::Result<Connection> {
    let flags = match access {
        Access::Write => OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX,
        Access::Read => OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX,
    };
    let connection = Connection::open_with_flags(path, flags)?;
    if access == Access::Read && log_is_empty(path) {
        // Nothing to fold in: read without locks and without files beside it, so that a map on a
        // write-protected disk can be read too.
        drop(connection);
        return Connection::open_with_flags(
            immutable_uri(path),
            flags | OpenFlags::SQLITE_OPEN_URI,
        );
    }
    Ok(connection)
}

/// Whether the log beside a map holds nothing.
fn log_is_empty(path: &Path) -> bool {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    std::fs::metadata(log).map_or(true, |about| about.len() == 0)
}

/// The path in a URI, its special characters escaped.
fn immutable_uri(path: &Path) -> String {
    use std::fmt::Write as _;
    let mut uri = String::from("file:");
    for &byte in path.as_os_str().as_encoded_bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-~".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            // Writing to a string can't fail.
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri.push_str("?immutable=1");
    uri
}

/// Whether the file is a map of our version.
fn check_kind(connection: &Connection, path: &Path) -> Result<(), MapError> {
    let number = |name: &str| -> Result<i64, MapError> {
        connection
            .pragma_query_value(None, name, |row| row.get(0))
            .map_err(|error| cannot_open(path, &error))
    };
    if number("application_id")? != APPLICATION_ID {
        return Err(MapError::NotAMap {
            path: path.to_owned(),
            seen: "another program's data base".to_owned(),
        });
    }
    let found = number("user_version")?;
    if !(OLDEST..=VERSION).contains(&found) {
        return Err(MapError::Version {
            path: path.to_owned(),
            found,
            supported: VERSION,
        });
    }
    match schema::missing_table(connection, &schema::NAMES)
        .map_err(|error| cannot_open(path, &error))?
    {
        None => Ok(()),
        Some(name) => Err(MapError::Damaged {
            path: path.to_owned(),
            what: format!("it has no table {name:?}"),
        }),
    }
}

/// A failure to open: SQLite says "unable to open" for much that has a better name.
fn cannot_open(path: &Path, error: &rusqlite::Error) -> MapError {
    let cannot = error.sqlite_error_code() == Some(rusqlite::ErrorCode::CannotOpen);
    if cannot && std::fs::File::open(path).is_ok() {
        return MapError::ReadOnly {
            path: path.to_owned(),
        };
    }
    MapError::of(path, error)
}

fn put(transaction: &Transaction<'_>, change: &MapChange<'_>) -> rusqlite::Result<()> {
    for new in change.nodes {
        let n = &new.node;
        transaction
            .prepare_cached(
                "INSERT OR REPLACE INTO node VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
            )?
            .execute(params![
                n.id.0,
                n.session,
                n.piece.0,
                n.chained,
                n.stamp.as_nanos(),
                n.path_m,
                f64::from(n.ground.up[0]),
                f64::from(n.ground.up[1]),
                f64::from(n.ground.up[2]),
                f64::from(n.ground.below_m),
                pose_bytes(&n.odom_from_node),
                pose_bytes(&n.map_from_node),
            ])?;
        transaction
            .prepare_cached("INSERT OR REPLACE INTO submap VALUES (?1, ?2)")?
            .execute(params![n.id.0, new.submap])?;
        transaction
            .prepare_cached("INSERT OR REPLACE INTO place VALUES (?1, ?2)")?
            .execute(params![n.id.0, new.descriptor])?;
    }
    for e in change.edges {
        let of_loop = match e.kind {
            EdgeKind::Chain => None,
            EdgeKind::Loop(id) => Some(id.0),
        };
        transaction
            .prepare_cached("INSERT OR REPLACE INTO edge VALUES (?1, ?2, ?3, ?4, ?5, ?6)")?
            .execute(params![
                e.id,
                of_loop,
                e.first.0,
                e.second.0,
                pose_bytes(&e.first_from_second),
                matrix_bytes(&e.information),
            ])?;
    }
    for id in change.removed_edges {
        transaction
            .prepare_cached("DELETE FROM edge WHERE id = ?1")?
            .execute([id])?;
    }
    for l in change.ledger {
        transaction
            .prepare_cached(
                "INSERT OR REPLACE INTO ledger VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, \
                 ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19)",
            )?
            .execute(params![
                l.id.0,
                l.stamp.as_nanos(),
                l.node.0,
                l.candidate.0,
                l.found_by.name(),
                column(l.similarity),
                column(l.yaw_rad),
                column(l.distance_m),
                column(l.graph_fitness),
                column(l.looks_fitness),
                column(l.overlap),
                column(l.inlier_share),
                column(l.residual_m),
                column(l.seen_through),
                l.open,
                column(l.chi2),
                l.agreeing,
                pose_bytes(&l.candidate_from_node),
                l.verdict.name(),
            ])?;
    }
    for (node, pose) in change.poses {
        transaction
            .prepare_cached("UPDATE node SET map_from_node = ?2 WHERE id = ?1")?
            .execute(params![node.0, pose_bytes(pose)])?;
    }
    for (piece, target) in change.joined {
        transaction
            .prepare_cached("UPDATE node SET piece = ?2 WHERE piece = ?1")?
            .execute([piece.0, target.0])?;
    }
    Ok(())
}
