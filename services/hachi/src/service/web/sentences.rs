//! What became of an order about people, as status and sentence: what, and what to do.

use hachi_http::Response;
use hachi_people::pointing::NotPicked;
use serde::Serialize;

use super::shapes::{BegunStatus, CancelledStatus, PickedStatus, ReleasedStatus};
use crate::service::enrolment::{self, Stage};
use crate::service::orders::{Answer, NoAnswer, NotBegun};
use crate::service::people::NoPeople;

/// What was not done: status and sentence.
pub type Refused = (u16, String);

/// A JSON answer.
///
/// # Errors
/// None that is known.
pub fn json(status: u16, value: &impl Serialize) -> Result<Response, Refused> {
    let body = serde_json::to_string(value);
    let body = body.map_err(|error| (500, format!("{error}: please report this")))?;
    Ok(Response::json(status, body))
}

/// What there is to be done at a stage of an enrolment; why it failed, if that is known.
pub fn advice(stage: Stage, why: Option<&str>) -> String {
    match (stage, why) {
        (Stage::Taking, _) => "turn round slowly in front of the robot",
        (Stage::WaitsForPerson, _) => "stand in front of the robot, in full view",
        (Stage::WaitsForOthersToGo, _) => "everybody else goes out of the picture's middle",
        (Stage::Keeping, _) => "model and pictures are being kept",
        (Stage::Done, _) => "they are known",
        (Stage::TimedOut, _) => {
            "it took too long: stand alone in front of the robot, in full view, and begin again"
        }
        (Stage::WentAway, _) => {
            "the person went out of view: stay in front of the robot, and begin again"
        }
        (Stage::Cancelled, _) => "it was cancelled, and nothing is kept",
        (Stage::Failed, Some(why)) => why,
        (Stage::Failed, None) => "nothing is kept: see the log, and begin again",
    }
    .to_owned()
}

/// Why nobody is looked for.
pub fn none(why: NoPeople) -> Refused {
    let what = match why {
        NoPeople::NotAskedFor => {
            "people are not looked for: set people.enabled = true in the settings, and start the \
             service again"
        }
        NoPeople::NoNetworks => {
            "people are not looked for, for want of a network: see the log, name one as \
             people.detector in the settings, and start the service again"
        }
    };
    (503, what.to_owned())
}

/// Why an enrolment was not begun.
pub fn not_begun(why: NotBegun) -> Refused {
    match why {
        NotBegun::Nobody => (
            409,
            "nobody stands in front of the robot: stand near the middle of its picture, in full view"
                .to_owned(),
        ),
        NotBegun::Several(count) => (
            409,
            format!("{count} people stand in front of the robot: one alone can be enrolled"),
        ),
        NotBegun::Busy => (
            409,
            "somebody is being enrolled already: wait, or cancel that first".to_owned(),
        ),
        NotBegun::NoStore => (
            503,
            "there is nowhere to keep anybody: name a file as people.store in the settings, see in \
             the log that it can be opened, and start the service again"
                .to_owned(),
        ),
    }
}

/// What became of an order.
///
/// # Errors
/// It was not carried out.
pub fn said(answer: Result<Answer, NoAnswer>) -> Result<Response, Refused> {
    match answer {
        Ok(Answer::Picked {
            track,
            person,
            known,
        }) => json(
            200,
            &PickedStatus {
                track,
                person,
                known,
            },
        ),
        Ok(Answer::Begun(enrolment)) => json(
            202,
            &BegunStatus {
                enrolment,
                wanted: enrolment::WANTED,
            },
        ),
        Ok(Answer::Cancelled(cancelled)) => json(200, &CancelledStatus { cancelled }),
        Ok(Answer::Released(released)) => json(200, &ReleasedStatus { released }),
        Ok(Answer::NotBegun(why)) => Err(not_begun(why)),
        Ok(Answer::NotPicked(why)) => Err(not_picked(why)),
        Err(NoAnswer::Full) => Err((
            503,
            "too many orders wait to be carried out: is the camera there? Try again later".to_owned(),
        )),
        Err(NoAnswer::Withdrawn) => Err((
            503,
            "no picture came in time, and the order was withdrawn: see in /health whether the camera \
             is there"
                .to_owned(),
        )),
        Err(NoAnswer::Unknown) => Err((
            503,
            "nothing was heard of the order: see in /people what became of it".to_owned(),
        )),
    }
}

fn not_picked(why: NotPicked) -> Refused {
    let (status, next_step) = match why {
        NotPicked::NoSuchTrack => (404, "see in /people who is in view"),
        NotPicked::NobodyThere => (404, "point at the middle of somebody in the last picture"),
        _ => (409, "wait until they are in full view"),
    };
    (status, format!("{why}: {next_step}"))
}
