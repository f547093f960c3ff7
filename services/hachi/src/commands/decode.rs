//! `hachi decode`: packets to one cloud file for each turn.

use std::collections::BTreeMap;
use std::path::Path;

use hachi_bridge::write_cloud;
use hachi_hal::{Completeness, Point};
use serde::Serialize;

use crate::cli::mapping::{CloudFormat, DecodeArguments};
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::report::{RunState, write_json};
use crate::results::Results;
use crate::{output, progress, recording};

/// What became of the packets.
#[derive(Debug, Default, Serialize)]
struct DecodeReport {
    /// Data packets that were decoded.
    packets: u64,
    /// Turns written, the partial ones included.
    turns: u64,
    /// Of these, turns whose beginning or end is missing because the recording begins or ends.
    partial_turns: u64,
    /// Points written.
    points: u64,
    /// What was left out, by reason.
    dropped: BTreeMap<String, u64>,
    state: RunState,
}

/// Runs the command.
///
/// # Errors
/// The recording can't be read or holds no packets, a file can't be written, or the user stopped
/// it: then the turns so far are written all the same.
pub fn run(arguments: &DecodeArguments) -> Result<(), Failure> {
    let mut source = recording::open_packets(&arguments.input)?;
    let results = Results::create_for(&arguments.input, &arguments.out)?;
    clear_earlier_turns(&arguments.out)?;
    let cancelled = Cancelled::on_interrupt()?;
    let bar = progress::bar(None, "turns");
    let mut report = DecodeReport::default();
    let mut points: Vec<Point> = Vec::new();
    let failure = loop {
        if cancelled.is_cancelled() {
            report.state = RunState::Interrupted;
            break Some(Failure::Interrupted(format!(
                "{} turns were written",
                report.turns
            )));
        }
        let header = match source.next_scan(&mut points) {
            Ok(Some(header)) => header,
            Ok(None) => break None,
            Err(failure) => {
                report.state = RunState::InputFailed;
                break Some(failure);
            }
        };
        let name = format!("{:06}.{}", report.turns, arguments.format.extension());
        if let Err(error) = write_cloud(results.path(&name), &points) {
            report.state = RunState::OutputFailed;
            break Some(Failure::unwritten(&error));
        }
        report.turns += 1;
        report.partial_turns += u64::from(header.completeness != Completeness::Complete);
        report.points += points.len() as u64;
        bar.inc(1);
    };
    bar.finish_and_clear();
    report.packets = source.packets();
    for (reason, count) in source.dropped() {
        if count > 0 {
            *report.dropped.entry(reason).or_default() += count;
        }
    }
    write_json(&results.path("report.json"), &report)?;
    if arguments.json {
        output::json(&report)?;
    } else {
        output::text(&text(&report, &results))?;
    }
    match failure {
        Some(failure) => Err(failure),
        None if report.turns == 0 => Err(Failure::new(
            format_args!("{} holds no turn", arguments.input.display()),
            "see report.json for what was left out, and --log warn for why",
        )),
        None => Ok(()),
    }
}

/// Removes the turns of an earlier run, which would look like turns of this one: those that its
/// report counts.
///
/// # Errors
/// There are numbered clouds that no report speaks for.
fn clear_earlier_turns(folder: &Path) -> Result<(), Failure> {
    /// No report is longer, bytes.
    const REPORT_LIMIT: u64 = 1 << 20;
    let earlier = || -> Option<u64> {
        let file = std::fs::File::open(folder.join("report.json")).ok()?;
        let report: serde_json::Value =
            serde_json::from_reader(std::io::Read::take(file, REPORT_LIMIT)).ok()?;
        report.get("turns")?.as_u64()
    };
    let turns = earlier().unwrap_or(0);
    let entries = std::fs::read_dir(folder).map_err(|error| Failure::writing(folder, &error))?;
    let mut clouds: Vec<_> = entries
        .flatten()
        .filter_map(|entry| Some((turn_number(&entry.path())?, entry.path())))
        .collect();
    clouds.sort();
    if let Some((_, path)) = clouds.iter().find(|(number, _)| *number >= turns) {
        return Err(Failure::new(
            format_args!("{} is there already", path.display()),
            "choose an empty --out, so that turns of two recordings do not mix",
        ));
    }
    for (_, path) in clouds {
        std::fs::remove_file(&path).map_err(|error| Failure::writing(&path, &error))?;
    }
    Ok(())
}

/// The number in the name of a turn's file, or `None` where the name is no turn's.
fn turn_number(path: &Path) -> Option<u64> {
    let extension = path.extension()?.to_str()?;
    let stem = path.file_stem()?.to_str()?;
    let known = [CloudFormat::Pcd, CloudFormat::Ply, CloudFormat::Csv]
        .iter()
        .any(|format| format.extension() == extension);
    (known && stem.len() >= 6).then(|| stem.parse().ok())?
}

impl CloudFormat {
    fn extension(self) -> &'static str {
        match self {
            Self::Pcd => "pcd",
            Self::Ply => "ply",
            Self::Csv => "csv",
        }
    }
}

fn text(report: &DecodeReport, results: &Results) -> String {
    let mut text = format!(
        "{} packets, {} turns ({} partial), {} points in {}",
        report.packets,
        report.turns,
        report.partial_turns,
        report.points,
        results.path("").display()
    );
    for (reason, count) in &report.dropped {
        text += &format!("\nleft out {count}: {reason}");
    }
    text
}
