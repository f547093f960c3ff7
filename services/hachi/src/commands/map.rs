//! `hachi map`: what can be done with saved maps.

mod export;
mod info;
mod localise;
mod merge;

use crate::cli::map::Map;
use crate::exit::Failure;

/// Runs the command.
///
/// # Errors
/// As each says.
pub fn run(command: &Map) -> Result<(), Failure> {
    match command {
        Map::Info(arguments) => info::run(arguments),
        Map::Export(arguments) => export::run(arguments),
        Map::Localise(arguments) => localise::run(arguments),
        Map::Merge(arguments) => merge::run(arguments),
    }
}
