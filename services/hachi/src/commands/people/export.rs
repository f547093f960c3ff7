//! `hachi people export`: all that is kept of somebody, for them to take.

use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::DirBuilderExt;

use hachi_people::identify::appearance_model::Statistics;
use serde::Serialize;

use crate::cli::people::enrolled::PeopleExportArguments;
use crate::exit::Failure;
use crate::results::Results;
use crate::{output, saved_people};

/// `person.json`.
#[derive(Debug, Serialize)]
struct Exported {
    name: String,
    enrolled_unix_s: i64,
    network: String,
    network_sha256: String,
    /// A feature nearer to the model than this is taken for the person's.
    threshold: f64,
    model: Statistics,
    images: Vec<String>,
    /// Pictures that are damaged and left out.
    damaged_images: usize,
}

#[derive(Debug, Serialize)]
struct Summary<'a> {
    name: &'a str,
    images: usize,
    damaged_images: usize,
    folder: &'a std::path::Path,
}

/// Runs the command.
///
/// # Errors
/// Nobody has the name, their model is damaged, or a file can't be written.
pub fn run(arguments: &PeopleExportArguments) -> Result<(), Failure> {
    let store = saved_people::open(&arguments.store)?;
    let person = store.find(&arguments.name).map_err(Failure::said)?;
    let stored = store.model(&person).map_err(Failure::said)?;
    let pictures = store.images(&person).map_err(Failure::said)?;
    // A new folder is for its owner alone.
    let made = DirBuilder::new().mode(0o700).create(&arguments.out);
    if let Err(error) = made.or_else(allow_existing) {
        return Err(Failure::writing(&arguments.out, &error));
    }
    let results = Results::create(&arguments.out)?;
    let mut exported = Exported {
        name: person.name,
        enrolled_unix_s: person.enrolled_unix_s,
        network_sha256: stored.network.sha256_hex(),
        network: stored.network.name,
        threshold: stored.model.threshold(),
        model: stored.model.statistics(),
        images: Vec::new(),
        damaged_images: pictures.damaged,
    };
    for (number, bytes) in pictures.images.iter().enumerate() {
        let name = format!("{:03}.{}", number + 1, ending(bytes));
        results.write(&name, bytes)?;
        exported.images.push(name);
    }
    let json = serde_json::to_string_pretty(&exported)
        .map_err(|error| Failure::new(error, "please report this"))?;
    results.write("person.json", json.as_bytes())?;
    if arguments.json {
        return output::json(&Summary {
            name: &exported.name,
            images: exported.images.len(),
            damaged_images: exported.damaged_images,
            folder: &arguments.out,
        });
    }
    let damaged = match exported.damaged_images {
        0 => String::new(),
        count => format!(" ({count} damaged ones are left out)"),
    };
    output::text(&format!(
        "person.json and {} pictures{damaged} of {} in {}",
        exported.images.len(),
        exported.name,
        arguments.out.display(),
    ))
}

fn allow_existing(error: io::Error) -> io::Result<()> {
    match error.kind() {
        io::ErrorKind::AlreadyExists => Ok(()),
        _ => Err(error),
    }
}

/// The ending of a picture's name, by its first bytes.
fn ending(bytes: &[u8]) -> &'static str {
    match bytes {
        [0xFF, 0xD8, ..] => "jpg",
        [0x89, b'P', b'N', b'G', ..] => "png",
        _ => "bin",
    }
}
