//! `hachi run`: the service on a robot.
//!
//! From the settings to the devices, from the devices to the tasks, then waiting for the end: the
//! calling thread watches the watchdog, tells systemd, and looks whether to stop. Settings that
//! can't be worked with do not end the program: nobody moves the robot, and the file is read again
//! when it changes.

use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use hachi_bridge::message::Sensor;
use hachi_datagram::{SystemClock, UdpConfig, UdpSource};
use hachi_hal::{Clock, Stamp};
use hachi_imu::system::BusFault;
use hachi_runtime::executor::threads::{self, ThreadsConfig};
use hachi_runtime::notify::Notifier;
use hachi_runtime::{Health, SoftWatchdog, TaskClock, Telemetry, Trouble};
use hachi_unitree::command::CommanderConfig;
use hachi_unitree::device::{HighClient, StopLine};
use tracing::{error, info, warn};

use super::replay::slam;
use super::simulate::platform_of;
use crate::cli::service::{RecordArguments, RunArguments};
use crate::config::Settings;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::recorder::Recorder;
use crate::service::emergency_stop::StopBus;
use crate::service::eyes;
use crate::service::imu::ImuDevice;
use crate::service::settings::{LidarKind, Platform};
use crate::service::signs::SharedSigns;
use crate::service::web::people::PeoplePage;
use crate::service::web::{self, Page};
use crate::service::wiring::{Devices, Running, Service, assemble};
use crate::{can, imu};

/// Runs `hachi run`.
///
/// # Errors
/// A device or the map can't be opened, or a task ended that should not have.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    serve(&arguments.config, None)
}

/// Runs `hachi record`.
///
/// # Errors
/// As [`run`]; also where the recording can't be begun.
pub fn record(arguments: &RecordArguments) -> Result<(), Failure> {
    serve(&arguments.config, Some(arguments))
}

fn serve(config: &Path, recording: Option<&RecordArguments>) -> Result<(), Failure> {
    let cancelled = Cancelled::on_interrupt()?;
    let mut notifier = Notifier::default();
    let (mut settings, platform) = settings_in_the_end(config, &cancelled, &mut notifier)?;
    if recording.is_some() {
        settings.patrol.places.clear();
        settings.service.map = None;
        settings.people.enabled = false;
    }
    let clock = SystemClock::new();
    let config = platform.client(&settings.robot);
    let stop_line = stop_line(&platform, config.robot)?;
    let devices = Devices {
        platform,
        client: HighClient::open(platform.robot, config, clock)
            .map_err(|error| unopened("the robot", &error, "robot.local_port"))?,
        packets: UdpSource::open(&udp_of(&settings), clock)
            .map_err(|error| unopened("the lidar", &error, "lidar.ports"))?,
        sensor: match settings.lidar.kind {
            LidarKind::Vlp16 => Sensor::Velodyne,
            LidarKind::Helios16p => Sensor::Robosense,
        },
        eyes: eyes::of_this_computer(&settings, clock),
        stop_bus: stop_bus(&settings)?,
        imu: imu_device(&settings),
    };
    let listen = settings.service.listen;
    let listener = web::listen(listen)
        .map_err(|error| unopened(&format!("http at {listen}"), &error, "service.listen"))?;
    let map = settings.service.map.as_deref();
    let slam = slam(map, settings.robot.platform.as_deref(), &settings.mapping())?;
    let running = Running::Threads(settings.service.threads);
    let recorder = match recording {
        Some(recording) => Some(Recorder::create(&recording.out, devices.sensor)?),
        None => None,
    };
    let tasks = TaskClock::new(clock);
    let service = assemble(&settings, devices, slam, tasks, running, recorder)?;
    info!(
        robot = platform.robot.name(),
        http = %listen,
        map = settings.service.map.as_deref().map(|p| p.display().to_string()),
        "starting"
    );

    let Service {
        table,
        signs,
        slam,
        people,
        watchdog,
        ..
    } = service;
    let mut people = Some(PeoplePage::new(people));
    let health = table.health().clone();
    let stop = AtomicBool::new(false);
    let mut watch = Watch {
        cancelled: &cancelled,
        notifier,
        health: health.clone(),
        signs: Arc::clone(&signs),
        watchdog,
        stop_line: &stop_line,
        bitten: false,
        ready: false,
        told: Instant::now(),
        ends: recording
            .and_then(|recording| recording.seconds)
            .map(|seconds| clock.now() + (seconds * 1e9) as i64),
    };
    let config = ThreadsConfig {
        real_time: settings.service.real_time,
        ..ThreadsConfig::default()
    };
    let outcome = std::thread::scope(|scope| {
        let outcome = threads::run(table, config, |now, telemetry| {
            if let Some(people) = people.take() {
                let mut page = Page {
                    platform: platform.robot.name().to_owned(),
                    telemetry: Arc::clone(telemetry),
                    health: health.clone(),
                    signs: Arc::clone(&signs),
                    people,
                };
                let (listener, stop) = (&listener, &stop);
                scope.spawn(move || web::serve(listener, &mut page, stop));
            }
            watch.look(now, telemetry)
        });
        health.stopping();
        watch.notifier.stopping();
        stand_still(&stop_line);
        stop.store(true, Ordering::Release);
        outcome
    });
    // The tasks are gone: what is under way is finished and kept.
    let mut stage = slam
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    stage.finish();
    info!(nodes = stage.slam().map().nodes().len(), "stopped");
    outcome
        .map_err(|error| Failure::new(error, "see the log; systemd starts the service again"))?;
    match signs.recording_fails.load(Ordering::Relaxed) {
        true => Err(recording_failed()),
        false => Ok(()),
    }
}

/// What was to be kept is not, or not to its end.
pub(super) fn recording_failed() -> Failure {
    Failure::new(
        "the recording is not whole",
        "see the log (--log error); free some space or choose another place",
    )
}

/// The settings, once they can be worked with.
fn settings_in_the_end(
    path: &Path,
    cancelled: &Cancelled,
    notifier: &mut Notifier,
) -> Result<(Settings, Platform), Failure> {
    let mut ready = false;
    loop {
        let seen = changed(path);
        let failure = match settings(path) {
            Ok(good) => return Ok(good),
            Err(failure) => failure,
        };
        error!("{}: {failure}", Trouble::Settings.name());
        if !ready {
            notifier.ready();
            ready = true;
        }
        notifier.status(&format!("the robot is not moved: {failure}"));
        while changed(path) == seen {
            if cancelled.is_cancelled() {
                return Err(failure);
            }
            notifier.alive();
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}

fn settings(path: &Path) -> Result<(Settings, Platform), Failure> {
    let settings = Settings::load(None, Some(path))?;
    let Some(name) = &settings.robot.platform else {
        return Err(Failure::new(
            format_args!("{} does not say which robot it is", path.display()),
            "set robot.platform to b1 or go1",
        ));
    };
    let platform = platform_of(name)?;
    Ok((settings, platform))
}

/// When a file was last written; `None` where it is not there.
fn changed(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|m| m.modified()).ok()
}

fn unopened(what: &str, error: &dyn std::fmt::Display, key: &str) -> Failure {
    Failure::new(
        format_args!("{what} can't be opened: {error}"),
        format_args!("see what else uses it, or change {key}"),
    )
}

fn stop_line(platform: &Platform, address: SocketAddr) -> Result<StopLine, Failure> {
    let commander = CommanderConfig::default();
    let local = match address.ip().is_loopback() {
        true => address.ip(),
        false => [0, 0, 0, 0].into(),
    };
    StopLine::open(
        platform.robot,
        address,
        local,
        commander.check_form,
        commander.level,
    )
    .map_err(|error: io::Error| unopened("the second line to the robot", &error, "robot.address"))
}

/// The bus of the emergency stop's node, where the settings name one. It is opened here once: a name
/// that is wrong is better known at the start than while the robot stands and nobody knows why.
fn stop_bus(settings: &Settings) -> Result<Option<StopBus>, Failure> {
    let Some((interface, node)) = settings.emergency_stop.node() else {
        return Ok(None);
    };
    let (interface, ids) = (interface.to_owned(), node.ids());
    let mut opened = Some(can::open(&interface, &ids).map_err(|error| {
        Failure::new(
            error,
            "correct emergency_stop.can, or take it out where there is no such stop",
        )
    })?);
    let open = Box::new(move || match opened.take() {
        Some(bus) => Ok(bus),
        None => can::open(&interface, &ids),
    });
    Ok(Some(StopBus { node, open }))
}

/// The inertial sensor and its bus, where the settings name one. The robot walks without it, so a bus
/// that is not there does not keep the service from starting.
fn imu_device(settings: &Settings) -> Option<ImuDevice> {
    let bus = settings.imu.bus()?;
    Some(ImuDevice {
        open: Box::new(move || {
            imu::open(&bus).map_err(|fault| BusFault(format!("{bus}: {fault:?}")))
        }),
        measuring: settings.imu.measuring(),
        base_from_imu: settings.imu.base_from_imu.pose().rotation,
    })
}

fn udp_of(settings: &Settings) -> UdpConfig {
    UdpConfig {
        bind_address: settings.lidar.bind_address,
        source_address: settings.lidar.source_address,
        ..UdpConfig::on_ports(&settings.lidar.ports())
    }
}

/// A robot that nobody talks to any more is told so, some times: datagrams get lost.
fn stand_still(line: &StopLine) {
    for _ in 0..10 {
        if let Err(error) = line.stop() {
            warn!(%error, "the robot can't be told to stand still");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// What the calling thread does while the tasks run.
struct Watch<'a> {
    cancelled: &'a Cancelled,
    notifier: Notifier,
    health: Health,
    signs: SharedSigns,
    watchdog: SoftWatchdog,
    stop_line: &'a StopLine,
    bitten: bool,
    ready: bool,
    told: Instant,
    ends: Option<Stamp>,
}

impl Watch<'_> {
    /// Looks at everything once; whether to go on.
    fn look(&mut self, now: Stamp, telemetry: &Arc<Telemetry>) -> bool {
        let late_ns = self.watchdog.bites(now);
        if let Some(late_ns) = late_ns {
            if !self.bitten {
                let late_ms = late_ns / 1_000_000;
                error!(
                    late_ms,
                    "the command task hangs: the robot is told to stand still"
                );
            }
            if let Err(error) = self.stop_line.stop() {
                warn!(%error, "the robot can't be told to stand still");
            }
        }
        self.bitten = late_ns.is_some();
        if !self.ready {
            self.ready = true;
            self.notifier.ready();
        }
        // systemd starts a service again that does not say that it is alive: it is not where the
        // command task or the event loop hangs.
        let alive = late_ns.is_none() && self.signs.event_loop.is_fresh(now, 1_000_000_000);
        let period = Notifier::watchdog_period().unwrap_or(Duration::from_secs(1));
        if self.told.elapsed() >= period.min(Duration::from_secs(1)) {
            self.told = Instant::now();
            if alive {
                self.notifier.alive();
            }
            let overruns = telemetry.hard_overruns();
            let line = self.health.line();
            self.notifier.status(&match overruns {
                0 => line,
                overruns => format!("{line}; {overruns} overruns of hard tasks"),
            });
        }
        let over = self.ends.is_some_and(|ends| now >= ends);
        !over && !self.cancelled.is_cancelled()
    }
}
