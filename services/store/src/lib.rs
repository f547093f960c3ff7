//! What must survive a power cut: a map in one file, and the people the robot knows ([`people`]).
//!
//! A map. In: nodes, submaps, edges and ledger entries as SLAM hands them out
//! ([`hachi_slam::SubmapStore`]). Out: the same after the next start, or a [`MapError`] that says
//! what is wrong with the file and what to do.
//!
//! The file is an SQLite data base. Each change is one transaction in a write-ahead log that is
//! flushed to the disk before the change counts as kept (`synchronous = FULL`); so a robot that is
//! switched off at any instant finds the map of its last node. While a map is being written, the
//! log lies beside it as `FILE-wal`: they belong together. Closing a map folds the log in.
//!
//! | module | holds |
//! |---|---|
//! | [`file`](mod@file) | opening, creating, writing |
//! | `schema` | the tables, and what a file must look like to be read |
//! | `rows` | poses, matrices and ledger entries as columns |
//! | `load` | reading a whole map but its submaps |
//! | [`error`] | what can be wrong |
//! | `fault` | what SQLite's error codes mean |
//! | [`people`] | people, encrypted |
#![forbid(unsafe_code)]

pub mod error;
mod fault;
pub mod file;
mod load;
pub mod people;
mod rows;
mod schema;

pub use error::MapError;
pub use file::{Access, Identity, MapFile};
