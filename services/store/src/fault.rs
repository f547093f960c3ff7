//! What SQLite's error codes mean for a file, whatever is kept in it.

use rusqlite::ErrorCode;

/// The kinds of faults that call for different deeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    Full,
    ReadOnly,
    InUse,
    NotADatabase,
    CannotOpen,
    Damaged,
    Other,
}

impl Fault {
    pub(crate) fn of(error: &rusqlite::Error) -> Self {
        let Some(code) = error.sqlite_error_code() else {
            // A column of another type, a row that is missing: the tables are not what we write.
            return Self::Damaged;
        };
        match code {
            ErrorCode::DiskFull => Self::Full,
            ErrorCode::ReadOnly | ErrorCode::PermissionDenied => Self::ReadOnly,
            ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked => Self::InUse,
            ErrorCode::NotADatabase => Self::NotADatabase,
            ErrorCode::CannotOpen => Self::CannotOpen,
            ErrorCode::DatabaseCorrupt
            | ErrorCode::TypeMismatch
            | ErrorCode::TooBig
            | ErrorCode::OperationInterrupted
            | ErrorCode::ConstraintViolation
            | ErrorCode::Unknown => Self::Damaged,
            _ => Self::Other,
        }
    }
}
