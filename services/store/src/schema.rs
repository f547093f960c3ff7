//! The tables of a map file, and what a file must look like to be read.

use rusqlite::Connection;
use rusqlite::config::DbConfig;
use rusqlite::limits::Limit;

/// Says in the file's header that it is a map: "HACM".
pub(crate) const APPLICATION_ID: i64 = 0x4841_434d;

/// The tables' version. A change that older programs can't read adds one. Of 3 are the words `coverage`
/// and `redundant` in the ledger; all that is in files of version 2 is understood.
pub(crate) const VERSION: i64 = 3;

/// The oldest version that is read; a file that is opened to be written gets the present one.
pub(crate) const OLDEST: i64 = 2;

/// The largest value of one column, bytes: a submap has 60 kB.
pub(crate) const LARGEST_VALUE: i32 = 1 << 20;

/// The tables. Poses are 7 numbers (x y z qx qy qz qw), information matrices 21 (rows of the upper
/// triangle, translation first), both as little-endian f64.
pub(crate) const TABLES: &str = "
CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE node (
    id INTEGER PRIMARY KEY, session INTEGER NOT NULL, piece INTEGER NOT NULL,
    chained INTEGER NOT NULL, stamp_ns INTEGER NOT NULL, path_m REAL NOT NULL,
    ground_up_x REAL NOT NULL, ground_up_y REAL NOT NULL, ground_up_z REAL NOT NULL,
    ground_below_m REAL NOT NULL, odom_from_node BLOB NOT NULL, map_from_node BLOB NOT NULL
);
CREATE TABLE submap (node INTEGER PRIMARY KEY, surfaces BLOB NOT NULL);
CREATE TABLE place (node INTEGER PRIMARY KEY, descriptor BLOB NOT NULL);
CREATE TABLE edge (
    id INTEGER PRIMARY KEY, loop INTEGER, first INTEGER NOT NULL, second INTEGER NOT NULL,
    first_from_second BLOB NOT NULL, information BLOB NOT NULL
);
CREATE TABLE ledger (
    id INTEGER PRIMARY KEY, stamp_ns INTEGER NOT NULL, node INTEGER NOT NULL,
    candidate INTEGER NOT NULL, found_by TEXT NOT NULL, similarity REAL, yaw_rad REAL,
    distance_m REAL, graph_fitness REAL, looks_fitness REAL, overlap REAL, inlier_share REAL,
    residual_m REAL, seen_through REAL, open INTEGER NOT NULL, chi2 REAL, agreeing INTEGER NOT NULL,
    candidate_from_node BLOB NOT NULL, verdict TEXT NOT NULL
);
";

/// The tables' names.
pub(crate) const NAMES: [&str; 6] = ["about", "node", "submap", "place", "edge", "ledger"];

/// A data base from elsewhere is a program: it may not run for long, ask for much, or be anything
/// but plain tables.
pub(crate) fn guard(connection: &Connection, largest_value: i32) -> rusqlite::Result<()> {
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
    connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, largest_value)?;
    connection.pragma_update(None, "cell_size_check", true)?;
    Ok(())
}

/// The first of these tables that is not there as a plain table.
pub(crate) fn missing_table(
    connection: &Connection,
    names: &[&'static str],
) -> rusqlite::Result<Option<&'static str>> {
    for &name in names {
        let plain: i64 = connection.query_row(
            "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND rootpage > 0",
            [name],
            |row| row.get(0),
        )?;
        if plain != 1 {
            return Ok(Some(name));
        }
    }
    Ok(None)
}
