//! `hachi people forget`: nothing of a person is left.

use serde::Serialize;

use crate::cli::people::enrolled::PeopleForgetArguments;
use crate::exit::Failure;
use crate::{output, saved_people};

#[derive(Debug, Serialize)]
struct Forgotten {
    /// How many people.
    forgotten: usize,
}

/// Runs the command.
///
/// # Errors
/// Nobody has the name, or something of them could not be removed.
pub fn run(arguments: &PeopleForgetArguments) -> Result<(), Failure> {
    let mut store = saved_people::open(&arguments.store)?;
    let (forgotten, text) = match &arguments.name {
        Some(name) => {
            let person = store.find(name).map_err(Failure::said)?;
            store.forget(&person).map_err(Failure::said)?;
            (1, format!("nothing of {name} is left"))
        }
        None => {
            let count = store.forget_unreadable().map_err(Failure::said)?;
            (count, format!("{count} unreadable people are forgotten"))
        }
    };
    match arguments.json {
        true => output::json(&Forgotten { forgotten }),
        false => output::text(&text),
    }
}
