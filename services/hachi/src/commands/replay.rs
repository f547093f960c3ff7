//! `hachi replay`: a recording through the pipeline, to a trajectory and a map.

use std::path::Path;

use hachi_slam::{MemoryStore, Slam};
use hachi_trajectory::plot::Plot;

use crate::cli::mapping::{ReplayArguments, StageArgument};
use crate::config::MappingConfig;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::mapping::{Ended, Mapping, run as run_mapping, state_of};
use crate::motion_samples::MotionSamples;
use crate::report::{Report, RunState};
use crate::results::Results;
use crate::{output, progress, recording, saved_maps};

/// Runs the command.
///
/// # Errors
/// The recording can't be read, the settings are not understood, a file can't be written, or the
/// user stopped it: then what was done is written all the same.
pub fn run(arguments: &ReplayArguments) -> Result<(), Failure> {
    let mut config =
        MappingConfig::load(arguments.platform.as_deref(), arguments.config.as_deref())?;
    if let Some(filter) = arguments.filter {
        filter.apply(&mut config.filter);
    }
    let mut source = recording::open(&arguments.input)?;
    let mut motion = MotionSamples::open(
        &arguments.input,
        config.motion,
        arguments.platform.as_deref(),
    )?;
    let results = Results::create_for(&arguments.input, &arguments.out)?;
    let cancelled = Cancelled::on_interrupt()?;
    let bar = progress::bar(source.scan_count(), "scans");
    let slam = match arguments.stage {
        StageArgument::Odometry => None,
        StageArgument::Slam => Some(slam(
            arguments.map.as_deref(),
            arguments.platform.as_deref(),
            &config,
        )?),
    };
    let mut mapping = Mapping::new(config, results.folder())?;
    if let Some(slam) = slam {
        mapping = mapping.with_slam(slam);
    }

    let pool = thread_pool(arguments.threads.map(|n| n.get()))?;
    let (ended, finished, mut report) = pool.install(|| {
        let ended = run_mapping(
            &mut mapping,
            &mut *source,
            &mut motion,
            &cancelled,
            &bar,
            |_, _, _| (),
        );
        let finished = mapping.finish();
        (ended, finished, mapping.report())
    });
    bar.finish_and_clear();
    finished?;

    for (reason, count) in source.dropped() {
        report.drop_for(&reason, count);
    }
    report.state = state_of(&ended);
    write_all(&results, &mapping, &mut report)?;
    if arguments.json {
        output::json(&report)?;
    } else {
        output::text(&summary(&report, &mapping, &results))?;
    }
    conclude(ended, &report, &arguments.input)
}

/// SLAM, with a map in memory or in the file that the user named: begun there, or gone on with.
///
/// # Errors
/// The file is no map, damaged, in use, of another robot, or can't be written.
pub fn slam(
    map: Option<&Path>,
    platform: Option<&str>,
    config: &MappingConfig,
) -> Result<Slam, Failure> {
    let settings = config.slam.clone();
    let Some(path) = map else {
        return Ok(Slam::new(settings, Box::new(MemoryStore::default())));
    };
    let (file, saved) = saved_maps::go_on(path, platform)?;
    Slam::resume(settings, saved, Box::new(file))
        .map_err(|error| Failure::new(error, "restore the map from a copy, or map anew"))
}

/// A pool of this many threads; one for each core if unset.
///
/// # Errors
/// The system gives no threads.
pub fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| {
            Failure::new(
                format_args!("threads can't be started: {error}"),
                "give a smaller number with --threads",
            )
        })
}

/// Writes every file of a run that can be written, the report last: it says if one could not.
///
/// # Errors
/// The first that can't be written.
fn write_all(results: &Results, mapping: &Mapping, report: &mut Report) -> Result<(), Failure> {
    let trajectory = mapping.trajectory();
    let (how, loops) = match mapping.slam() {
        Some(slam) => (
            format!("{} loops closed", report.loops.accepted),
            slam.loop_lines(),
        ),
        None => ("odometry alone".to_owned(), Vec::new()),
    };
    let subtitle = format!(
        "{} scans, {:.1} m, {how}",
        report.scans, report.path_length_m
    );
    let picture = Plot {
        title: "Trajectory",
        subtitle: &subtitle,
        estimate: trajectory,
        reference: None,
        errors_m: None,
        links: &loops,
    };
    let written = first_failure([
        results.trajectory("trajectory.tum", trajectory),
        results.trajectory("odometry.tum", &mapping.odometry()),
        results.picture(&picture),
        results.map(mapping.map(), trajectory),
        results.loops(mapping.slam()),
    ]);
    if written.is_err() {
        report.state = RunState::OutputFailed;
    }
    written.and(results.report(report))
}

/// The first failure of several attempts, all of which were made.
///
/// # Errors
/// That one.
pub fn first_failure(
    attempts: impl IntoIterator<Item = Result<(), Failure>>,
) -> Result<(), Failure> {
    attempts.into_iter().fold(Ok(()), Result::and)
}

/// The exit of a run: nothing read at all is a failure, so is a stop half-way.
fn conclude(ended: Ended, report: &Report, input: &Path) -> Result<(), Failure> {
    match ended {
        Ended::Failed(failure) => Err(failure),
        Ended::Interrupted => Err(Failure::Interrupted(format!(
            "{} scans were processed and written",
            report.scans
        ))),
        Ended::Finished if report.scans == 0 => Err(Failure::new(
            format_args!("{} holds no scan", input.display()),
            "see report.json for what was left out, and --log warn for why",
        )),
        Ended::Finished => Ok(()),
    }
}

fn summary(report: &Report, mapping: &Mapping, results: &Results) -> String {
    let times = &report.total_per_scan_ms;
    let conditions = &report.conditions;
    format!(
        "{} scans in {:.1} s, path {:.2} m\n\
         {:.1} ms a scan in the mean, {:.1} ms at the 99th percentile, {} threads\n\
         condition OK {}, DEGRADED {}, LOST {}; {} of {} loop candidates closed\n\
         map of {} points, trajectory and report in {}",
        report.scans,
        report.duration_s,
        report.path_length_m,
        times.mean_ms,
        times.p99_ms,
        report.threads,
        conditions.ok,
        conditions.degraded,
        conditions.lost,
        report.loops.accepted,
        report.loops.candidates,
        mapping.map().len(),
        results.path("").display(),
    )
}
