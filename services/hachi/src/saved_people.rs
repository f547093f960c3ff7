//! The store of people as the commands open it.
//!
//! In: what the user named. Out: an open store; failures say what to do. Elsewhere: the store itself
//! (`hachi_store::people`).

use std::path::PathBuf;

use hachi_store::people::{PeopleFile, PeoplePaths};

use crate::cli::people::enrolled::StoreArguments;
use crate::exit::Failure;

/// Names the store where the command line does not.
const VARIABLE: &str = "HACHI_PEOPLE";

/// Where the store lies.
///
/// # Errors
/// Nothing says where.
pub fn paths(arguments: &StoreArguments) -> Result<PeoplePaths, Failure> {
    let named = |variable: &str| {
        let value = std::env::var_os(variable).filter(|value| !value.is_empty());
        value.map(PathBuf::from)
    };
    let usual = || {
        let data = named("XDG_DATA_HOME").or_else(|| Some(named("HOME")?.join(".local/share")));
        data.map(|data| data.join("hachi/people.db"))
    };
    let file = arguments.store.clone();
    let file = file.or_else(|| named(VARIABLE)).or_else(usual);
    let file = file.ok_or_else(|| {
        Failure::new(
            "nothing says where people are kept",
            format_args!("name a file with --store or {VARIABLE}"),
        )
    })?;
    Ok(PeoplePaths::with_key(&file, arguments.key.as_deref()))
}

/// Opens the store, and makes it if there is none.
///
/// # Errors
/// It can't be used.
pub fn open_or_create(arguments: &StoreArguments) -> Result<PeopleFile, Failure> {
    PeopleFile::open_or_create(&paths(arguments)?).map_err(Failure::said)
}

/// Opens the store, if there is one.
///
/// # Errors
/// It can't be used.
pub fn open_if_there(arguments: &StoreArguments) -> Result<Option<PeopleFile>, Failure> {
    PeopleFile::open_if_there(&paths(arguments)?).map_err(Failure::said)
}

/// Opens the store that has somebody in it.
///
/// # Errors
/// There is none, or it can't be used.
pub fn open(arguments: &StoreArguments) -> Result<PeopleFile, Failure> {
    let store = open_if_there(arguments)?;
    let path = paths(arguments)?.file;
    store.ok_or_else(|| {
        Failure::new(
            format_args!("{} is not there: nobody is enrolled", path.display()),
            "enrol somebody first, or name the store with --store",
        )
    })
}
