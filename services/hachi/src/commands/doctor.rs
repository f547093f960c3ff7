//! `hachi doctor`: what is installed, what can be opened, what rights hachi has here.
//!
//! Each check looks at one thing and gives findings; none changes anything that outlives it. A
//! finding fails only if live LiDAR mapping would not work; what other parts need, or what only
//! costs speed, is a warning. Where a system does not say (no `/proc`), that is said.

#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
mod cameras;
mod devices;
mod emergency_stop;
mod files;
mod finding;
mod imu;
mod machine;
mod network;
mod realtime;
mod system;

use std::fmt::Write as _;

use serde::Serialize;

use crate::cli::DoctorArguments;
use crate::exit::Failure;
use crate::output;
use finding::{Finding, Level};

/// Checks and prints.
///
/// # Errors
/// Something that live LiDAR mapping needs is missing.
pub fn run(arguments: &DoctorArguments) -> Result<(), Failure> {
    let examination = Examination::now();
    if arguments.json {
        output::json(&examination)?;
    } else {
        output::text(&examination.for_people())?;
    }
    examination.verdict()
}

/// Everything that was found.
#[derive(Serialize)]
struct Examination {
    version: &'static str,
    ok: bool,
    warnings: usize,
    failures: usize,
    findings: Vec<Finding>,
}

impl Examination {
    fn now() -> Self {
        Self::of([
            machine::check(),
            realtime::check(),
            network::check(),
            devices::check(),
            emergency_stop::check(),
            imu::check(),
            #[cfg(all(target_os = "linux", target_pointer_width = "64"))]
            cameras::check(),
            files::check(),
        ])
    }

    fn of(checks: impl IntoIterator<Item = Vec<Finding>>) -> Self {
        let findings: Vec<Finding> = checks.into_iter().flatten().collect();
        let count = |level| findings.iter().filter(|f| f.level == level).count();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            ok: count(Level::Fail) == 0,
            warnings: count(Level::Warn),
            failures: count(Level::Fail),
            findings,
        }
    }

    fn for_people(&self) -> String {
        let mut text = String::new();
        for finding in &self.findings {
            let level = match finding.level {
                Level::Ok => "ok  ",
                Level::Warn => "warn",
                Level::Fail => "FAIL",
            };
            // Writing to a String can't fail.
            let _ = writeln!(text, "{level}  {:<22} {}", finding.name, finding.what);
            if let Some(next_step) = &finding.next_step {
                let _ = writeln!(text, "      {:<22} -> {next_step}", "");
            }
        }
        let _ = writeln!(
            text,
            "\nhachi {}: {} checks, {} warnings, {} failures",
            self.version,
            self.findings.len(),
            self.warnings,
            self.failures
        );
        text
    }

    fn verdict(&self) -> Result<(), Failure> {
        match self.findings.iter().find(|f| f.level == Level::Fail) {
            None => Ok(()),
            Some(first) => Err(Failure::new(
                format_args!("{}: {}", first.name, first.what),
                first.next_step.as_deref().unwrap_or("see the list above"),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_is_the_first_failure_with_what_to_do() {
        let fine = Examination::of([vec![
            Finding::ok("memory", "8 GB"),
            Finding::warn("clock", "drifts", "start chrony"),
        ]]);
        assert!(fine.ok && fine.warnings == 1 && fine.verdict().is_ok());
        let failing = Examination::of([
            vec![Finding::fail("UDP port", "2368 is held", "end its holder")],
            vec![Finding::fail("camera", "gone", "plug it in")],
        ]);
        assert_eq!((failing.ok, failing.failures), (false, 2));
        assert_eq!(
            failing.verdict().unwrap_err().to_string(),
            "UDP port: 2368 is held; end its holder"
        );
        assert!(failing.for_people().contains("-> plug it in"));
    }
}
