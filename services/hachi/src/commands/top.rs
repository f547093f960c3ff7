//! `hachi top`: the live task table of a running service.

use std::io::IsTerminal;

use crate::cli::service::TopArguments;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::service::web::Status;
use crate::service_link::ServiceLink;
use crate::{output, task_table};

/// From one table to the next, in tenths of a second.
const REFRESH_TENTHS: u32 = 10;

/// Runs the command.
///
/// # Errors
/// No service answers there.
pub fn run(arguments: &TopArguments) -> Result<(), Failure> {
    let ask = || ServiceLink(arguments.address).get::<Status>("/tasks");
    if arguments.json {
        return output::json(&ask()?);
    }
    let live = std::io::stdout().is_terminal() && !arguments.once;
    if !live {
        return output::text(&task_table::text(&ask()?));
    }
    let cancelled = Cancelled::on_interrupt()?;
    while !cancelled.is_cancelled() {
        let status = ask()?;
        output::text(&task_table::on_screen(&status))?;
        cancelled.pause(REFRESH_TENTHS);
    }
    Ok(())
}
