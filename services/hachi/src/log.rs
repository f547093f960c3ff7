//! Logging, on standard error. Quiet unless asked for, because a failing command says one line.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;

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
    let _ = tracing_subscriber::fmt()
        .with_env_filter(parsed)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .try_init();
    Ok(())
}
