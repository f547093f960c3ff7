//! `hachi demo`: the whole service drives a simulated robot; what it made of that, compared with the
//! truth.

mod driven;
mod people;
mod scripted;

use hachi_hal::Vector3;
use hachi_trajectory::plot::Plot;
use hachi_trajectory::{Alignment, Evaluation, EvaluationOptions, Trajectory, evaluate};
use hachi_world::{Preset, SensorKind};
use serde::Serialize;

use super::replay::{first_failure, thread_pool};
use crate::cli::mapping::{DemoArguments, StageArgument};
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::map_builder::MapBuilder;
use crate::mapping::{Ended, state_of};
use crate::output;
use crate::people_pictures::ContactSheet;
use crate::report::{Report, RunState};
use crate::results::Results;
use people::PeopleReport;

/// Frames of the walk with everybody marked.
const PEOPLE: &str = "people.png";

/// The VLP-16 turns ten times a second.
const SCANS_PER_SECOND: f64 = 10.0;

/// The report of a demo: that of a replay, and the error against the truth.
#[derive(Debug, Serialize)]
struct DemoReport {
    #[serde(flatten)]
    report: Report,
    world: &'static str,
    sensor: &'static str,
    seed: u64,
    /// Absolute trajectory error after SE(3) alignment, metres.
    ate_rmse_m: f64,
    ate_max_m: f64,
    /// The same of odometry alone, without closing loops.
    odometry_ate_rmse_m: f64,
    /// Error of the motion from one scan to the next, metres.
    rpe_rmse_m: f64,
    /// Error of the height, metres.
    z_rmse_m: f64,
    true_path_length_m: f64,
    /// The robot that the service drove; absent where it followed a fixed walk.
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<&'static str>,
    /// Who was seen; absent where nobody was looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    people: Option<PeopleReport>,
}

/// What a walk left.
struct Walked {
    trajectory: Trajectory,
    odometry: Trajectory,
    truth: Trajectory,
    map: MapBuilder,
    loop_lines: Vec<(Vector3, Vector3)>,
    /// The ledger as a table.
    loops: String,
    report: Report,
    ended: Ended,
    robot: Option<&'static str>,
    people: Option<(PeopleReport, Option<ContactSheet>)>,
}

/// Runs the command.
///
/// # Errors
/// A file can't be written, or the user stopped it: then what was done is written all the same.
pub fn run(arguments: &DemoArguments) -> Result<(), Failure> {
    let results = Results::create(&arguments.out)?;
    let cancelled = Cancelled::on_interrupt()?;
    let mut walked = match is_driven(arguments) {
        true => thread_pool(None)?.install(|| driven::walk(arguments, &results, &cancelled))?,
        false => scripted::walk(arguments, &results, &cancelled)?,
    };
    walked.report.state = state_of(&walked.ended);
    let measured = match measure(&walked.truth, &walked.trajectory) {
        Ok(measured) => measured,
        // Stopped before there was anything to write.
        Err(_) if matches!(walked.ended, Ended::Interrupted) => return Err(interrupted(0)),
        Err(failure) => return Err(failure),
    };
    let written = write_all(&results, &walked, &measured);
    let people = walked.people.map(|(told, _)| told);
    let mut report = walked.report;
    if written.is_err() {
        report.state = RunState::OutputFailed;
    }
    let report = DemoReport {
        world: arguments.world.name(),
        sensor: match arguments.sensor {
            SensorKind::Vlp16 => "VLP-16",
            SensorKind::Vlp16Dual => "VLP-16 in dual return mode",
            SensorKind::Helios16P => "RS-Helios-16P",
        },
        seed: arguments.seed,
        ate_rmse_m: measured.ape.rmse,
        ate_max_m: measured.ape.max,
        odometry_ate_rmse_m: measure(&walked.truth, &walked.odometry).map_or(0.0, |e| e.ape.rmse),
        rpe_rmse_m: measured.rpe.map_or(0.0, |rpe| rpe.rmse),
        z_rmse_m: height_error(&measured),
        true_path_length_m: walked.truth.path_length_m(),
        robot: walked.robot,
        people,
        report,
    };
    written.and(crate::report::write_json(
        &results.path("report.json"),
        &report,
    ))?;
    if arguments.json {
        output::json(&report)?;
    } else {
        output::text(&summary(&report, walked.map.len(), &results))?;
    }
    match walked.ended {
        Ended::Finished => Ok(()),
        Ended::Failed(failure) => Err(failure),
        Ended::Interrupted => Err(interrupted(report.report.scans)),
    }
}

/// Whether the service drives. A hand that carries a sensor in a hurry, and a robot on wheels at
/// 4 m/s, are none of its robots; and without SLAM it has no map to find its places on.
fn is_driven(arguments: &DemoArguments) -> bool {
    let walks = !matches!(arguments.world, Preset::Stress | Preset::CampusLong);
    walks && !arguments.scripted && arguments.stage == StageArgument::Slam
}

fn interrupted(scans: u64) -> Failure {
    Failure::Interrupted(format!("{scans} scans were processed and written"))
}

fn measure(truth: &Trajectory, estimate: &Trajectory) -> Result<Evaluation, Failure> {
    let options = EvaluationOptions {
        alignment: Alignment::Se3,
        ..EvaluationOptions::default()
    };
    evaluate(truth, estimate, &options).map_err(|error| {
        Failure::new(
            format_args!("too short a walk to measure: {error}"),
            "give more --seconds",
        )
    })
}

/// Root mean square of the height's error after alignment, metres.
fn height_error(measured: &Evaluation) -> f64 {
    let pairs = measured
        .estimate
        .poses()
        .iter()
        .zip(measured.reference.poses());
    let squares = pairs.map(|(e, r)| (e.translation.z - r.translation.z).powi(2));
    (squares.sum::<f64>() / measured.estimate.len().max(1) as f64).sqrt()
}

fn write_all(results: &Results, walked: &Walked, measured: &Evaluation) -> Result<(), Failure> {
    let trajectory = &walked.trajectory;
    let subtitle = format!(
        "{} scans, {:.1} m, error {:.1} cm (rmse)",
        trajectory.len(),
        walked.truth.path_length_m(),
        measured.ape.rmse * 100.0
    );
    let picture = Plot {
        title: "Simulated building: estimate and truth",
        subtitle: &subtitle,
        estimate: &measured.estimate,
        reference: Some(&measured.reference),
        errors_m: Some(&measured.errors_m),
        links: &walked.loop_lines,
    };
    let sheet = walked
        .people
        .as_ref()
        .and_then(|(_, sheet)| sheet.as_ref())
        .map_or(Ok(()), |sheet| sheet.write(&results.path(PEOPLE)));
    first_failure([
        sheet,
        results.trajectory("trajectory.tum", trajectory),
        results.trajectory("odometry.tum", &walked.odometry),
        results.trajectory("truth.tum", &walked.truth),
        results.picture(&picture),
        results.map(&walked.map, trajectory),
        results.write("loops.csv", walked.loops.as_bytes()),
    ])
}

fn summary(demo: &DemoReport, map_points: usize, results: &Results) -> String {
    let report = &demo.report;
    let times = &report.total_per_scan_ms;
    let robot = match demo.robot {
        Some(robot) => format!("a {robot} driven by the service"),
        None => "a walking robot".to_owned(),
    };
    let people = demo.people.as_ref().map(seen).unwrap_or_default();
    let pictures = match &demo.people {
        Some(_) => format!(", {}", results.path(PEOPLE).display()),
        None => String::new(),
    };
    format!(
        "{} on {robot}, {} building {}: {} scans, {:.1} s, {:.1} m\n\
         error against the truth {:.1} cm rmse, {:.1} cm at most; {:.1} cm rmse by odometry alone\n\
         {:.1} ms a scan in the mean, {:.1} ms at the 99th percentile, {} threads\n\
         condition OK {}, DEGRADED {}, LOST {}; {} of {} loop candidates closed\n\
         {people}look at {}{pictures} and {} ({map_points} points)",
        demo.sensor,
        demo.world,
        demo.seed,
        report.scans,
        report.duration_s,
        demo.true_path_length_m,
        demo.ate_rmse_m * 100.0,
        demo.ate_max_m * 100.0,
        demo.odometry_ate_rmse_m * 100.0,
        times.mean_ms,
        times.p99_ms,
        report.threads,
        report.conditions.ok,
        report.conditions.degraded,
        report.conditions.lost,
        report.loops.accepted,
        report.loops.candidates,
        results.path("trajectory.svg").display(),
        results.path("map.ply").display(),
    )
}

/// Who was seen, in a line or two.
fn seen(people: &PeopleReport) -> String {
    let tracks: Vec<_> = people.tracks.iter().map(u64::to_string).collect();
    let mut text = format!(
        "{} people seen in {} pictures, as tracks {}\n",
        people.truly_seen,
        people.pictures,
        tracks.join(", ")
    );
    if let Some(person) = &people.person {
        let after = person.re_identified_after_s;
        let after = after.map_or(String::new(), |after| format!(", after {after:.1} s"));
        text += &format!(
            "its person, P{}, is {}: followed for {:.1} of {:.1} s in view ({:.0} %), known again {} of \
             {} times{after}; somebody else followed for {:.1} s\n",
            person.id,
            person.condition,
            person.tracked_s,
            person.visible_s,
            100.0 * person.tracked_share,
            person.re_identified,
            person.re_identifications_needed,
            person.wrong_s,
        );
    }
    text
}
