//! Logging, on standard error, or in the journal where that is what standard error leads to. Quiet unless asked for, because a failing command says one line.

use std::io::IsTerminal;
use std::os::unix::fs::MetadataExt;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::exit::Failure;

/// Where the filter comes from when `--log` is not given.
const VARIABLE: &str = "HACHI_LOG";

/// Starts logging with this filter, or the one in `HACHI_LOG`, or the usual one; without any nothing
/// is logged.
///
/// A filter is a level (`info`) or levels by module (`hachi=debug,hachi_odometry=trace`).
///
/// # Errors
/// The filter can't be understood.
pub fn start(filter: Option<&str>, usual: Option<&str>) -> Result<(), Failure> {
    let from_environment = std::env::var(VARIABLE).ok().filter(|v| !v.is_empty());
    let (filter, source) = match (filter, &from_environment) {
        (Some(filter), _) => (filter, "--log"),
        (None, Some(filter)) => (filter.as_str(), VARIABLE),
        (None, None) => match usual {
            Some(usual) => (usual, "the usual filter"),
            None => return Ok(()),
        },
    };
    let parsed = EnvFilter::builder().parse(filter).map_err(|error| {
        Failure::Usage(format!(
            "{source} {filter:?} is no log filter ({error}); try info, or hachi=debug"
        ))
    })?;
    // Fails if a logger is there already: a test that runs several commands in one process.
    let _ = match journal() {
        Some(journal) => tracing_subscriber::registry()
            .with(parsed)
            .with(journal)
            .try_init(),
        None => tracing_subscriber::fmt()
            .with_env_filter(parsed)
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal())
            .finish()
            .try_init(),
    };
    Ok(())
}

/// The journal, where that is what standard error leads to: every field is then a field there
/// (`journalctl -u hachi -o json`).
fn journal() -> Option<tracing_journald::Layer> {
    // Programs that a service starts inherit the variable, and not always standard error: only the
    // same device and inode count (`systemd.exec(5)`).
    let stream = std::env::var("JOURNAL_STREAM").ok()?;
    let stderr = std::fs::metadata("/proc/self/fd/2").ok()?;
    (stream == format!("{}:{}", stderr.dev(), stderr.ino()))
        .then(tracing_journald::layer)?
        .ok()
}
