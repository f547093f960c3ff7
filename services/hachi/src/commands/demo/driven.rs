//! The whole service in virtual time, driving a simulated robot.
//!
//! In: a world with a patrol, and a robot. Out: where the service thinks it was, and where it truly
//! was. The robot is told by HighCmds and tells by HighStates, the LiDAR by its packets, as over
//! sockets; the tasks are those of `hachi run`. The same arguments give the same bytes.

use std::io::IsTerminal;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use hachi_realsense::device::simulated::SimulatedPort;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Health, VirtualClock};
use hachi_trajectory::Trajectory;
use hachi_world::SimulationConfig;
use tracing::warn;

use super::Walked;
use super::people::{self, Album, Spectator};
use crate::cli::mapping::DemoArguments;
use crate::cli::people::NetworkArguments;
use crate::commands::replay::slam;
use crate::commands::run::recording_failed;
use crate::commands::simulate::platform_of;
use crate::config::{MotionInput, Settings};
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::map_builder::MapBuilder;
use crate::mapping::Ended;
use crate::recorder::Recorder;
use crate::results::Results;
use crate::service::signs::SharedSigns;
use crate::service::simulated::{Besides, WatchedCamera, connect, sensor_of};
use crate::service::simulator::{SeenPeople, Truth, route};
use crate::service::web::Status;
use crate::service::wiring::{Running, Service, Watcher};
use crate::{networks, output, progress, task_table};

/// Virtual time that passes between two looks at Ctrl-C and the screen, ns.
const SLICE_NS: i64 = 100_000_000;

/// Between two tables on the screen.
const REFRESH: Duration = Duration::from_millis(500);

/// A place of the patrol is reached when the robot is this near, m.
const REACH_M: f64 = 0.5;

/// Walks the robot round its patrol.
///
/// # Errors
/// No such robot, or a submap can't be read back.
pub fn walk(
    arguments: &DemoArguments,
    results: &Results,
    cancelled: &Cancelled,
) -> Result<Walked, Failure> {
    let platform = platform_of(&arguments.platform)?;
    let mut settings = Settings::load(Some(&arguments.platform), None)?;
    if let Some(filter) = arguments.filter {
        filter.apply(&mut settings.filter);
    }
    settings.motion = MotionInput::Odometry;
    let mut world = SimulationConfig::preset(arguments.world, arguments.seed, f64::MAX);
    world.sensor = arguments.sensor;
    world.base_from_lidar = settings.base_from_lidar.pose();
    if !arguments.nobody {
        world.people = arguments.world.people(arguments.seed).into();
    }
    settings.patrol.places = route(&world.trajectory);
    settings.patrol.reach_m = REACH_M;
    let speed = world.trajectory.gait().speed;
    settings.patrol.speed_m_per_s = speed.min(settings.safety.forward_m_per_s);

    let clock = VirtualClock::starting_at(world.start);
    let map = arguments.map.as_deref();
    let slam = slam(map, Some(&arguments.platform), &settings.mapping())?;
    let recorder = match &arguments.record {
        Some(path) => Some(Recorder::create(path, sensor_of(&world))?),
        None => None,
    };
    let running = Running::VirtualTime;
    let (camera, album) = camera(arguments, &world).unzip();
    let (service, truth) = connect(
        &settings,
        &platform,
        &world,
        &clock,
        running,
        (slam, recorder),
        Besides {
            camera,
            ..Besides::default()
        },
    )?;
    let Service {
        table,
        signs,
        record,
        slam,
        scan_times,
        ..
    } = service;
    let health = table.health().clone();
    let mut run = VirtualTime::new(table, clock);
    let end = world.start + (arguments.seconds * 1e9) as i64;
    let mut screen = Screen::new(arguments, platform.robot.name(), health, signs);
    let mut ended = Ended::Finished;
    let mut now = world.start;
    while now < end {
        if cancelled.is_cancelled() {
            ended = Ended::Interrupted;
            break;
        }
        now = (now + SLICE_NS).min(end);
        run.run_until(now);
        screen.show(&run, lock(&record).scans())?;
    }
    screen.leave();

    let mut stage = lock(&slam);
    stage.finish();
    let trajectory = stage.trajectory();
    let mut map = MapBuilder::new(settings.map.voxel_m, results.folder());
    stage.build_map(&mut map)?;
    let mut report = lock(&record).report(&trajectory);
    stage.fill(&mut report);
    report.total_per_scan_ms = scan_times.summary().into();
    for (name, stage) in [
        ("lidar receive", "read"),
        ("filter", "filter"),
        ("odometry", "odometry"),
        ("slam", "slam"),
    ] {
        let telemetry = run.telemetry();
        let task = telemetry.tasks().find(|(spec, _)| spec.name == name);
        if let Some((_, record)) = task {
            let times = record.execution.summary().into();
            report.stages.insert(stage.to_owned(), times);
        }
    }
    let album = album.map(|album| {
        let album = std::mem::take(&mut *people::lock(&album));
        let mut told = album.report();
        let latencies = run.telemetry().latency_rows();
        let shutter = latencies.iter().find(|row| row.name == "shutter to target");
        told.shutter_to_target_p99_ms = shutter.map(|row| row.times.p99_ms);
        (told, album.sheet)
    });
    // The recorder's last lines are written when its task goes.
    drop(run);
    if screen.signs.recording_fails.load(Ordering::Relaxed) {
        ended = Ended::Failed(recording_failed());
    }
    let walked = Walked {
        truth: true_path(&truth, &trajectory),
        odometry: stage.odometry(),
        loop_lines: stage.loop_lines(),
        loops: stage.ledger_csv(),
        trajectory,
        map,
        report,
        ended,
        robot: Some(platform.robot.name()),
        people: album,
    };
    Ok(walked)
}

/// The camera, the networks behind it and who sees it, where somebody walks about to be seen; and what
/// will have been seen. Without networks nobody is looked for, which the log says.
fn camera(
    arguments: &DemoArguments,
    world: &SimulationConfig,
) -> Option<(WatchedCamera, Arc<Mutex<Album>>)> {
    if world.people.is_empty() {
        return None;
    }
    let observer = match networks::observer(&NetworkArguments::own()) {
        Ok(observer) => observer,
        Err(failure) => {
            warn!("nobody is looked for: {failure}");
            return None;
        }
    };
    let seen = SeenPeople::default();
    let (spectator, album) = Spectator::new(seen.clone(), world.start, arguments.seconds);
    let camera = people::camera();
    let watched = WatchedCamera {
        port: SimulatedPort::new(camera.geometry),
        camera,
        watcher: Watcher {
            observer,
            kept: None,
            audience: Some(Box::new(spectator)),
        },
        seen,
    };
    Some((watched, album))
}

/// Where the robot truly was at the trajectory's times, in its frame: the base at the first scan.
fn true_path(truth: &Truth, trajectory: &Trajectory) -> Trajectory {
    let mut path = Trajectory::new();
    let mut origin = None;
    for stamp in trajectory.stamps().unwrap_or_default() {
        let Some(pose) = truth.map_from_base(*stamp) else {
            continue;
        };
        let origin = origin.get_or_insert(pose.inverse());
        // The trajectory's own stamps increase, so none is refused.
        let _ = path.push(*stamp, *origin * pose);
    }
    path
}

fn lock<T>(shared: &Arc<Mutex<T>>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What people see while it runs: the live task table on a terminal, else a bar.
struct Screen {
    live: bool,
    bar: indicatif::ProgressBar,
    shown: Instant,
    platform: &'static str,
    health: Health,
    signs: SharedSigns,
}

impl Screen {
    fn new(
        arguments: &DemoArguments,
        platform: &'static str,
        health: Health,
        signs: SharedSigns,
    ) -> Self {
        let live = !arguments.headless && !arguments.json && std::io::stdout().is_terminal();
        let bar = match live {
            true => indicatif::ProgressBar::hidden(),
            false => progress::bar(
                Some((arguments.seconds * super::SCANS_PER_SECOND) as u64),
                "scans",
            ),
        };
        Self {
            live,
            bar,
            shown: Instant::now(),
            platform,
            health,
            signs,
        }
    }

    fn show(&mut self, run: &VirtualTime, scans: u64) -> Result<(), Failure> {
        self.bar.set_position(scans);
        self.bar.set_message(self.signs.condition.get());
        if self.live && self.shown.elapsed() >= REFRESH {
            self.shown = Instant::now();
            let status = Status::of(self.platform, run.telemetry(), &self.health, &self.signs);
            output::text(&task_table::on_screen(&status))?;
        }
        Ok(())
    }

    fn leave(&self) {
        self.bar.finish_and_clear();
    }
}
