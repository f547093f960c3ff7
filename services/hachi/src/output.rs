//! Standard output: figures for people, or one JSON object for programs.

use std::io::{self, Write};

use serde::Serialize;

use crate::exit::Failure;

/// Writes lines for people.
///
/// # Errors
/// [`Failure::OutputClosed`] if nobody reads any more, or the reason it can't be written.
pub fn text(text: &str) -> Result<(), Failure> {
    write(text.trim_end())
}

/// Writes one JSON object, indented, and nothing else.
///
/// # Errors
/// As [`text`].
pub fn json(value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(|error| {
        Failure::new(
            format_args!("the result is no valid JSON: {error}"),
            "please report this",
        )
    })?;
    write(&text)
}

fn write(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}")
        .and_then(|()| out.flush())
        .map_err(|error| Failure::output(&error))
}
