//! `hachi people enrol --live`: whoever stands in front of the running robot.
//!
//! The service does it; this shows how far it is, and ends it where the user does.

use std::time::Duration;

use serde::Serialize;

use crate::cli::people::enrolled::PeopleEnrolArguments;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::service::enrolment::Stage;
use crate::service::web::shapes::{
    BareOrder, BegunStatus, CancelledStatus, EnrolOrder, EnrolmentStatus, People,
};
use crate::service_link::ServiceLink;
use crate::{output, progress};

/// From one look at the progress to the next.
const REFRESH: Duration = Duration::from_millis(200);

#[derive(Debug, Serialize)]
struct Summary {
    name: String,
    /// The number that the service calls them by.
    person: Option<u32>,
    /// Pictures that the model is made of.
    images_used: usize,
}

/// Runs the command.
///
/// # Errors
/// No service answers, nobody or several people stand in front, it takes too long, or nothing can be
/// kept.
pub fn run(arguments: &PeopleEnrolArguments) -> Result<(), Failure> {
    let link = ServiceLink(arguments.service.address);
    let cancelled = Cancelled::on_interrupt()?;
    let order = EnrolOrder {
        name: arguments.name.clone(),
    };
    let begun: BegunStatus = link.post("/people/enrol", &order)?;
    let bar = progress::bar(Some(begun.wanted as u64), "looks");
    let mut too_late = false;
    let ended = loop {
        if cancelled.is_cancelled() && !too_late {
            let CancelledStatus { cancelled } = link.post("/people/cancel", &BareOrder {})?;
            if cancelled {
                bar.finish_and_clear();
                return Err(Failure::Interrupted("nobody was enrolled".to_owned()));
            }
            // They are being kept already: what becomes of that is said.
            too_late = true;
        }
        let people: People = link.get("/people")?;
        let ours = people.enrolment.filter(|e| e.number >= begun.enrolment);
        if let Some(enrolment) = ours {
            bar.set_position(enrolment.taken as u64);
            bar.set_message(enrolment.advice.clone());
            if enrolment.number > begun.enrolment || enrolment.stage.is_over() {
                break enrolment;
            }
        }
        std::thread::sleep(REFRESH);
    };
    bar.finish_and_clear();
    let summary = summary(&arguments.name, begun.enrolment, &ended)?;
    match arguments.json {
        true => output::json(&summary),
        false => output::text(&format!(
            "{} is known, from {} looks",
            summary.name, summary.images_used
        )),
    }
}

fn summary(name: &str, begun: u32, ended: &EnrolmentStatus) -> Result<Summary, Failure> {
    if ended.number != begun {
        return Err(Failure::new(
            "another enrolment has begun since",
            "see with `hachi people list` whether this one was kept",
        ));
    }
    match ended.stage {
        Stage::Done => Ok(Summary {
            name: name.to_owned(),
            person: ended.person,
            images_used: ended.taken,
        }),
        Stage::Failed => Err(Failure::said(&ended.advice)),
        _ => Err(Failure::said(format_args!(
            "nobody was enrolled: {}",
            ended.advice
        ))),
    }
}
