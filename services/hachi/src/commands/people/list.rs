//! `hachi people list`: who the robot knows.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;

use crate::cli::people::enrolled::PeopleListArguments;
use crate::exit::Failure;
use crate::{output, saved_people};

#[derive(Debug, Serialize)]
struct People {
    store: std::path::PathBuf,
    people: Vec<Entry>,
    /// How many are damaged so that not even their names can be read.
    unreadable: usize,
    /// Whether something sealed is left of somebody who was forgotten.
    remnants: bool,
}

#[derive(Debug, Serialize)]
struct Entry {
    name: String,
    enrolled_unix_s: i64,
    images: usize,
    network: Option<String>,
    network_sha256: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

/// Runs the command.
///
/// # Errors
/// The store can't be read.
pub fn run(arguments: &PeopleListArguments) -> Result<(), Failure> {
    let mut listed = People {
        store: saved_people::paths(&arguments.store)?.file,
        people: Vec::new(),
        unreadable: 0,
        remnants: false,
    };
    if let Some(store) = saved_people::open_if_there(&arguments.store)? {
        let known = store.list().map_err(Failure::said)?;
        listed.unreadable = known.unreadable.len();
        listed.remnants = store.has_remnants().map_err(Failure::said)?;
        listed.people.extend(known.people.into_iter().map(|person| {
            let (network, error) = match store.model(&person) {
                Ok(stored) => (Some(stored.network), None),
                Err(error) => (None, Some(error.to_string())),
            };
            Entry {
                name: person.name,
                enrolled_unix_s: person.enrolled_unix_s,
                images: person.images,
                network_sha256: network.as_ref().map(|network| network.sha256_hex()),
                network: network.map(|network| network.name),
                error,
            }
        }));
    }
    match arguments.json {
        true => output::json(&listed),
        false => output::text(&text(&listed)),
    }
}

fn text(listed: &People) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let now = now.map_or(0, |since| since.as_secs() as i64);
    let mut text = String::new();
    for person in &listed.people {
        let model = person
            .network
            .as_ref()
            .map(|name| format!("model of {name}"));
        let model = model.or_else(|| person.error.clone()).unwrap_or_default();
        text += &format!(
            "{}  enrolled {}, {} pictures, {model}\n",
            person.name,
            days_ago(now, person.enrolled_unix_s),
            person.images,
        );
    }
    if listed.people.is_empty() {
        text += "nobody is enrolled: hachi people enrol NAME IMAGE...\n";
    }
    if listed.unreadable > 0 {
        text += &format!(
            "{} more can't be read: restore the key file that has their keys, or forget them with \
             hachi people forget --unreadable\n",
            listed.unreadable
        );
    }
    if listed.remnants {
        text += "encrypted remnants of somebody forgotten could not be removed yet: is there room, and \
                 no other program that reads?\n";
    }
    text + &format!("store: {}", listed.store.display())
}

fn days_ago(now_s: i64, then_s: i64) -> String {
    const DAY_S: i64 = 86_400;
    match now_s.saturating_sub(then_s) / DAY_S {
        ..=0 => "today".to_owned(),
        1 => "a day ago".to_owned(),
        days => format!("{days} days ago"),
    }
}
