//! `hachi people`: one module for each of its commands.

mod find;
mod track;

use crate::cli::people::People;
use crate::exit::Failure;

/// Runs a command.
///
/// # Errors
/// What the command could not do, and what the user can.
pub fn run(command: &People) -> Result<(), Failure> {
    match command {
        People::Find(arguments) => find::run(arguments),
        People::Track(arguments) => track::run(arguments),
    }
}
