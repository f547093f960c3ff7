//! `hachi people pick`: who the robot's person is.

use crate::cli::people::live::PeoplePickArguments;
use crate::exit::Failure;
use crate::output;
use crate::service::web::shapes::{PickOrder, PickedStatus};
use crate::service_link::ServiceLink;

/// Runs the command.
///
/// # Errors
/// Nobody is picked, or no service answers.
pub fn run(arguments: &PeoplePickArguments) -> Result<(), Failure> {
    let order = PickOrder {
        track: arguments.track,
        at: arguments.at.map(|place| place.0),
    };
    let link = ServiceLink(arguments.service.address);
    let picked: PickedStatus = link.post("/people/pick", &order)?;
    if arguments.json {
        return output::json(&picked);
    }
    let known = match picked.known {
        true => "whom it knew before",
        false => "new to it",
    };
    output::text(&format!(
        "the robot's person is number {}, {known}, on track {}",
        picked.person, picked.track
    ))
}
