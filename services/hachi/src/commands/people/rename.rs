//! `hachi people rename`: another name.

use serde::Serialize;

use crate::cli::people::enrolled::PeopleRenameArguments;
use crate::exit::Failure;
use crate::{output, saved_people};

#[derive(Debug, Serialize)]
struct Renamed<'a> {
    from: &'a str,
    name: &'a str,
}

/// Runs the command.
///
/// # Errors
/// Nobody has the name, somebody has the new one, or it can't be kept.
pub fn run(arguments: &PeopleRenameArguments) -> Result<(), Failure> {
    let mut store = saved_people::open(&arguments.store)?;
    let person = store.find(&arguments.name).map_err(Failure::said)?;
    store
        .rename(&person, &arguments.new_name)
        .map_err(Failure::said)?;
    let renamed = Renamed {
        from: &person.name,
        name: arguments.new_name.trim(),
    };
    match arguments.json {
        true => output::json(&renamed),
        false => output::text(&format!("{} is {} now", renamed.from, renamed.name)),
    }
}
