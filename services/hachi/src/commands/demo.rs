//! `hachi demo`: the simulated robot through the whole pipeline, compared with the truth.

use hachi_bridge::message::Sensor;
use hachi_trajectory::plot::Plot;
use hachi_trajectory::{Alignment, Evaluation, EvaluationOptions, Trajectory, evaluate};
use hachi_world::{SensorKind, SimulatedLidar, Simulation, SimulationConfig};
use serde::Serialize;

use crate::cli::mapping::{DemoArguments, StageArgument};
use crate::config::MappingConfig;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::mapping::{Ended, Mapping, run as run_mapping, state_of};
use crate::motion_samples::MotionSamples;
use crate::recording::from_packets;
use crate::report::{Report, RunState};
use crate::results::Results;
use crate::slam_stage::SlamStage;
use crate::{output, progress};

use super::replay::{first_failure, slam, thread_pool};

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
}

/// Runs the command.
///
/// # Errors
/// A file can't be written, or the user stopped it: then what was done is written all the same.
pub fn run(arguments: &DemoArguments) -> Result<(), Failure> {
    let mut world = SimulationConfig::preset(arguments.world, arguments.seed, arguments.seconds);
    world.sensor = arguments.sensor;
    let results = Results::create(&arguments.out)?;
    let cancelled = Cancelled::on_interrupt()?;
    let bar = progress::bar(Some((arguments.seconds * SCANS_PER_SECOND) as u64), "scans");
    let mut config = MappingConfig::default();
    if let Some(filter) = arguments.filter {
        filter.apply(&mut config.filter);
    }
    let driver = match arguments.sensor {
        SensorKind::Helios16P => Sensor::Robosense,
        _ => Sensor::Velodyne,
    };
    let lidar = SimulatedLidar::new(Simulation::new(world.clone()));
    let mut source = from_packets(driver, lidar, |_| Vec::new());
    let slam = match arguments.stage {
        StageArgument::Odometry => None,
        StageArgument::Slam => Some(slam(arguments.map.as_deref(), None, &config)?),
    };
    let mut mapping = Mapping::new(config, results.folder())?;
    if let Some(slam) = slam {
        mapping = mapping.with_slam(slam);
    }

    let pool = thread_pool(None)?;
    let (ended, finished, mut report) = pool.install(|| {
        let mut motion = MotionSamples::default();
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

    let truth = truth_at(mapping.trajectory(), &world);
    let measured = match measure(&truth, mapping.trajectory()) {
        Ok(measured) => measured,
        // Stopped before there was anything to write.
        Err(_) if matches!(ended, Ended::Interrupted) => return Err(interrupted(0)),
        Err(failure) => return Err(failure),
    };
    let written = write_all(&results, &mapping, &truth, &measured);
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
        odometry_ate_rmse_m: measure(&truth, &mapping.odometry()).map_or(0.0, |e| e.ape.rmse),
        rpe_rmse_m: measured.rpe.map_or(0.0, |rpe| rpe.rmse),
        z_rmse_m: height_error(&measured),
        true_path_length_m: truth.path_length_m(),
        report,
    };
    written.and(crate::report::write_json(
        &results.path("report.json"),
        &report,
    ))?;
    if arguments.json {
        output::json(&report)?;
    } else {
        output::text(&summary(&report, &mapping, &results))?;
    }
    match ended {
        Ended::Finished => Ok(()),
        Ended::Unreadable(failure) => Err(failure),
        Ended::Interrupted => Err(interrupted(report.report.scans)),
    }
}

fn interrupted(scans: u64) -> Failure {
    Failure::Interrupted(format!("{scans} scans were processed and written"))
}

/// The true poses at the trajectory's times, in its map frame: the first scan's.
fn truth_at(trajectory: &Trajectory, world: &SimulationConfig) -> Trajectory {
    let stamps = trajectory.stamps().unwrap_or_default();
    let mut truth = Trajectory::new();
    let Some(first) = stamps.first() else {
        return truth;
    };
    let origin = world.map_from_lidar(*first).inverse();
    for stamp in stamps {
        // The trajectory's own stamps increase, so none is refused.
        let _ = truth.push(*stamp, origin * world.map_from_lidar(*stamp));
    }
    truth
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

fn write_all(
    results: &Results,
    mapping: &Mapping,
    truth: &Trajectory,
    measured: &Evaluation,
) -> Result<(), Failure> {
    let trajectory = mapping.trajectory();
    let subtitle = format!(
        "{} scans, {:.1} m, error {:.1} cm (rmse)",
        trajectory.len(),
        truth.path_length_m(),
        measured.ape.rmse * 100.0
    );
    let loops = mapping.slam().map_or_else(Vec::new, SlamStage::loop_lines);
    let picture = Plot {
        title: "Simulated building: estimate and truth",
        subtitle: &subtitle,
        estimate: &measured.estimate,
        reference: Some(&measured.reference),
        errors_m: Some(&measured.errors_m),
        links: &loops,
    };
    first_failure([
        results.trajectory("trajectory.tum", trajectory),
        results.trajectory("odometry.tum", &mapping.odometry()),
        results.trajectory("truth.tum", truth),
        results.picture(&picture),
        results.map(mapping.map(), trajectory),
        results.loops(mapping.slam()),
    ])
}

fn summary(demo: &DemoReport, mapping: &Mapping, results: &Results) -> String {
    let report = &demo.report;
    let times = &report.total_per_scan_ms;
    format!(
        "{} on a walking robot, {} building {}: {} scans, {:.1} s, {:.1} m\n\
         error against the truth {:.1} cm rmse, {:.1} cm at most; {:.1} cm rmse by odometry alone\n\
         {:.1} ms a scan in the mean, {:.1} ms at the 99th percentile, {} threads\n\
         condition OK {}, DEGRADED {}, LOST {}; {} of {} loop candidates closed\n\
         look at {} and {} ({} points)",
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
        mapping.map().len(),
    )
}
