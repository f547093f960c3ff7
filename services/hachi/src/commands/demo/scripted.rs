//! A simulated robot that follows a fixed walk: the pipeline alone, without a service.

use hachi_trajectory::Trajectory;
use hachi_world::{SimulatedLidar, Simulation, SimulationConfig};

use super::{SCANS_PER_SECOND, Walked};
use crate::cli::mapping::{DemoArguments, StageArgument};
use crate::commands::replay::{slam, thread_pool};
use crate::config::MappingConfig;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::mapping::{Mapping, run as run_mapping};
use crate::motion_samples::MotionSamples;
use crate::progress;
use crate::recording::from_packets;
use crate::results::Results;
use crate::service::simulated::sensor_of;
use crate::slam_stage::{LEDGER_HEADING, SlamStage};

/// Walks the robot along its path.
///
/// # Errors
/// Threads can't be started, or a submap can't be read back.
pub fn walk(
    arguments: &DemoArguments,
    results: &Results,
    cancelled: &Cancelled,
) -> Result<Walked, Failure> {
    let mut world = SimulationConfig::preset(arguments.world, arguments.seed, arguments.seconds);
    world.sensor = arguments.sensor;
    let bar = progress::bar(Some((arguments.seconds * SCANS_PER_SECOND) as u64), "scans");
    let mut config = MappingConfig::default();
    if let Some(filter) = arguments.filter {
        filter.apply(&mut config.filter);
    }
    let driver = sensor_of(&world);
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
    let (ended, finished, mut report) = thread_pool(None)?.install(|| {
        let mut motion = MotionSamples::default();
        let ended = run_mapping(
            &mut mapping,
            &mut *source,
            &mut motion,
            cancelled,
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
    Ok(Walked {
        truth: truth_at(mapping.trajectory(), &world),
        odometry: mapping.odometry(),
        loop_lines: mapping.slam().map_or_else(Vec::new, SlamStage::loop_lines),
        loops: mapping
            .slam()
            .map_or_else(|| LEDGER_HEADING.to_owned(), SlamStage::ledger_csv),
        trajectory: mapping.trajectory().clone(),
        map: mapping.into_map(),
        report,
        ended,
        robot: None,
        people: None,
    })
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
