//! `hachi people`: one module for each of its commands.

mod enrol;
mod enrol_live;
mod export;
mod find;
mod forget;
mod list;
mod pick;
mod portrait;
mod release;
mod rename;
mod track;
mod watch;

use crate::cli::people::People;
use crate::exit::Failure;

/// Runs a command.
///
/// # Errors
/// What the command could not do, and what the user can.
pub fn run(command: &People) -> Result<(), Failure> {
    match command {
        People::Enrol(arguments) if arguments.live => enrol_live::run(arguments),
        People::Enrol(arguments) => enrol::run(arguments),
        People::Export(arguments) => export::run(arguments),
        People::Find(arguments) => find::run(arguments),
        People::Forget(arguments) => forget::run(arguments),
        People::List(arguments) => list::run(arguments),
        People::Pick(arguments) => pick::run(arguments),
        People::Release(arguments) => release::run(arguments),
        People::Rename(arguments) => rename::run(arguments),
        People::Track(arguments) => track::run(arguments),
        People::Watch(arguments) => watch::run(arguments),
    }
}
