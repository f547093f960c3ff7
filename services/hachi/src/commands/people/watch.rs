//! `hachi people watch`: who a running service has in view, and whom it knows.

use std::fmt::Write;
use std::io::IsTerminal;

use crate::cli::people::live::PeopleWatchArguments;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::output;
use crate::service::web::shapes::People;
use crate::service_link::ServiceLink;
use crate::task_table::CLEAR;

/// From one list to the next, in tenths of a second.
const REFRESH_TENTHS: u32 = 5;

/// Runs the command.
///
/// # Errors
/// No service answers, or it looks for nobody.
pub fn run(arguments: &PeopleWatchArguments) -> Result<(), Failure> {
    let ask = || ServiceLink(arguments.service.address).get::<People>("/people");
    if arguments.json {
        return output::json(&ask()?);
    }
    if arguments.once || !std::io::stdout().is_terminal() {
        return output::text(&text(&ask()?));
    }
    let cancelled = Cancelled::on_interrupt()?;
    while !cancelled.is_cancelled() {
        output::text(&format!("{CLEAR}{}", text(&ask()?)))?;
        cancelled.pause(REFRESH_TENTHS);
    }
    Ok(())
}

fn text(people: &People) -> String {
    let mut out = String::new();
    // Writing to a String can't fail.
    let _ = match people.picture {
        None => writeln!(out, "no picture yet"),
        Some(picture) => writeln!(
            out,
            "picture of {} x {} pixels, {:.1} s ago",
            picture.width, picture.height, picture.age_s
        ),
    };
    let _ = writeln!(
        out,
        "{:>5}  {:>6} {:>6} {:>6} {:>6}  IN VIEW",
        "TRACK", "LEFT", "TOP", "WIDTH", "HEIGHT"
    );
    for seen in &people.in_view {
        let on = people
            .known
            .iter()
            .find(|known| known.track == Some(seen.track));
        let who = match on {
            Some(known) => format!("number {}", known.number),
            None if seen.confirmed => "a person".to_owned(),
            None => "perhaps a person".to_owned(),
        };
        let unseen = match seen.unseen_s {
            0.0 => String::new(),
            unseen_s => format!(", not seen for {unseen_s:.1} s"),
        };
        let b = &seen.bounding_box;
        let _ = writeln!(
            out,
            "{:>5}  {:>6.0} {:>6.0} {:>6.0} {:>6.0}  {who}{unseen}",
            seen.track, b.left, b.top, b.width, b.height
        );
    }
    let _ = writeln!(out, "{:>5}  {:<10} {:>5}  KNOWN", "", "CONDITION", "SURE");
    for known in &people.known {
        let name = known.name.as_deref().unwrap_or("picked, without a name");
        let picked = if known.picked {
            ", the robot's person"
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "{:>5}  {:<10} {:>4.0}%  {}{picked}",
            known.number,
            known.condition,
            100.0 * known.confidence,
            shown(name)
        );
    }
    if let Some(enrolment) = people.enrolment.as_ref() {
        let _ = writeln!(
            out,
            "enrolment {}: {} of {} looks; {}",
            enrolment.number,
            enrolment.taken,
            enrolment.wanted,
            shown(&enrolment.advice)
        );
    }
    out
}

/// A text without what a terminal would obey.
fn shown(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::web::shapes::{BoxStatus, InViewStatus, KnownStatus};

    #[test]
    fn everybody_stands_on_a_line_and_who_is_known_has_their_number() {
        let seen = |track: u64, confirmed: bool| InViewStatus {
            track,
            bounding_box: BoxStatus {
                left: 10.4,
                top: 20.0,
                width: 40.0,
                height: 100.0,
            },
            confirmed,
            unseen_s: 0.0,
        };
        let people = People {
            in_view: vec![seen(3, true), seen(5, false)],
            known: vec![KnownStatus {
                number: 2,
                name: Some("An\u{1b}na".to_owned()),
                picked: true,
                condition: "SEEN".to_owned(),
                confidence: 0.9,
                track: Some(3),
                unseen_s: 0.0,
            }],
            ..People::default()
        };
        let text = text(&people);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "no picture yet");
        assert_eq!(lines[2], "    3      10     20     40    100  number 2");
        assert!(lines[3].ends_with("perhaps a person"));
        assert_eq!(
            lines[5],
            "    2  SEEN         90%  Anna, the robot's person"
        );
    }
}
