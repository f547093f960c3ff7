//! `hachi people release`: the robot has no person any more.

use crate::cli::people::live::PeopleReleaseArguments;
use crate::exit::Failure;
use crate::output;
use crate::service::web::shapes::{BareOrder, ReleasedStatus};
use crate::service_link::ServiceLink;

/// Runs the command.
///
/// # Errors
/// No service answers.
pub fn run(arguments: &PeopleReleaseArguments) -> Result<(), Failure> {
    let link = ServiceLink(arguments.service.address);
    let released: ReleasedStatus = link.post("/people/release", &BareOrder {})?;
    if arguments.json {
        return output::json(&released);
    }
    output::text(&match released.released {
        Some(person) => format!("number {person} is the robot's person no more"),
        None => "the robot has no person".to_owned(),
    })
}
