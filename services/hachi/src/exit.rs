//! How a command fails, and what the shell sees of it.
//!
//! Status 0: done. 1: failed, with one line on standard error that says what and what to do.
//! 2: wrong usage, with the parser's own explanation.

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

/// Why a command did not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// It can't be done.
    #[error("{what}; {next_step}")]
    Failed {
        /// What happened, naming the file or device.
        what: String,
        /// What the user can do about it.
        next_step: String,
    },
    /// The arguments contradict each other in a way the parser can't see.
    #[error("{0}")]
    Usage(String),
    /// The user stopped it; what is done so far was written.
    #[error("interrupted: {0}")]
    Interrupted(String),
    /// Nobody reads standard output any more (`hachi ... | head`): no reason to complain.
    #[error("standard output was closed")]
    OutputClosed,
}

impl Failure {
    /// A failure: what happened, and what to do about it.
    pub fn new(what: impl Display, next_step: impl Display) -> Self {
        Self::Failed {
            what: what.to_string(),
            next_step: next_step.to_string(),
        }
    }

    /// A library's message that ends with what to do, behind its last colon.
    pub fn said(error: impl Display) -> Self {
        let text = error.to_string();
        match text.rsplit_once(": ") {
            Some((what, next_step)) => Self::new(what, next_step),
            None => Self::new(text, "check the path"),
        }
    }

    /// Writing to standard output failed.
    pub fn output(error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::OutputClosed,
            _ => Self::new(
                format_args!("standard output can't be written: {error}"),
                "check the disk or program it goes to",
            ),
        }
    }

    /// Writing `path` failed.
    pub fn writing(path: &std::path::Path, error: &io::Error) -> Self {
        let next_step = match error.kind() {
            io::ErrorKind::StorageFull
            | io::ErrorKind::QuotaExceeded
            | io::ErrorKind::FileTooLarge => "free some space or choose another place",
            io::ErrorKind::PermissionDenied => "choose a place you may write to",
            io::ErrorKind::NotFound => "make its folder first or choose another place",
            _ => "check the disk or choose another place",
        };
        Self::new(
            format_args!("{} can't be written: {error}", path.display()),
            next_step,
        )
    }

    /// A file of results could not be written.
    pub fn unwritten(error: &hachi_bridge::WriteError) -> Self {
        use hachi_bridge::WriteError::{Io, NoRoom};
        match error {
            NoRoom { path, source } | Io { path, source, .. } => Self::writing(path, source),
            _ => Self::new(error, "choose another name"),
        }
    }
}

/// The exit status of a command, after saying on standard error why it failed.
pub fn status(outcome: Result<(), Failure>) -> ExitCode {
    let (line, status) = match outcome {
        Ok(()) | Err(Failure::OutputClosed) => return ExitCode::SUCCESS,
        Err(failure @ Failure::Usage(_)) => (failure.to_string(), 2),
        Err(failure) => (failure.to_string(), 1),
    };
    // With standard error gone there is nowhere left to complain.
    let _ = writeln!(io::stderr(), "hachi: {}", one_line(&line));
    ExitCode::from(status)
}

/// The exit status after the parser refused the arguments, or printed the help it was asked for.
pub fn usage(error: &clap::Error) -> ExitCode {
    // A closed pipe (`hachi --help | head`) is no failure.
    let _ = error.print();
    ExitCode::from(if error.use_stderr() { 2 } else { 0 })
}

/// The text without line breaks or other control characters, which names of files may hold.
fn one_line(text: &str) -> String {
    let visible = |c: char| if c.is_control() { ' ' } else { c };
    text.trim().chars().map(visible).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_missing_folder_is_said_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let error = hachi_bridge::write_file(folder.path().join("none/map.ply"), b"").unwrap_err();
        let failure = Failure::unwritten(&error).to_string();
        assert!(failure.contains("make its folder first"), "{failure}");
        assert!(failure.contains("none/map.ply"), "{failure}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_said_as_such() {
        let mut full = std::fs::File::options()
            .write(true)
            .open("/dev/full")
            .unwrap();
        let error = full.write_all(&[0; 10]).unwrap_err();
        let failure = Failure::writing(Path::new("map.ply"), &error).to_string();
        assert!(failure.contains("free some space"), "{failure}");
    }

    #[test]
    fn a_line_break_in_a_name_does_not_break_the_line() {
        assert_eq!(
            one_line("a\nb\x1b[31m.pcap can't be read\n"),
            "a b [31m.pcap can't be read"
        );
    }
}
