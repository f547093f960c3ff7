//! `hachi simulate`: a robot and its LiDAR that speak the real ones' bytes, in real time.

use std::net::UdpSocket;
use std::time::Duration;

use hachi_datagram::SystemClock;
use hachi_hal::{Clock, Stamp};
use hachi_unitree::device::{SimulatedRobot, SimulatedRobotConfig};
use hachi_world::{LiveLidar, SensorKind, SimulationConfig};
use serde::Serialize;

use super::replay::thread_pool;
use crate::cli::service::SimulateArguments;
use crate::config::Settings;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::output;
use crate::service::settings::{LidarKind, Platform};
use crate::service::simulator::WalkingBody;

/// From one step to the next.
const STEP: Duration = Duration::from_millis(1);
/// From one line of the trace to the next, ns.
const TRACE_NS: i64 = 100_000_000;

/// A line of the trace.
#[derive(Debug, Serialize)]
struct Line {
    time_s: f64,
    x_m: f64,
    y_m: f64,
    speed_m_per_s: f64,
    yaw_rate_rad_per_s: f64,
    way_m: f64,
    commands: u64,
}

/// Runs the command.
///
/// # Errors
/// No such robot, or an address is taken.
pub fn run(arguments: &SimulateArguments) -> Result<(), Failure> {
    let settings = Settings::load(Some(&arguments.platform), arguments.config.as_deref())?;
    let platform = platform_of(&arguments.platform)?;
    let clock = SystemClock::new();
    let world = world_of(arguments, &settings, clock.now());
    let body = WalkingBody::standing(&platform, &world);
    let config = SimulatedRobotConfig {
        bind: arguments.robot,
        ..SimulatedRobotConfig::for_robot(platform.robot)
    };
    let taken = |what: &str, error: &std::io::Error| {
        Failure::new(
            format_args!("{what}: {error}"),
            "give another address or port",
        )
    };
    let mut robot = SimulatedRobot::open(&platform.robot.layout, body, config)
        .map_err(|e| taken(&format!("{} can't be listened at", arguments.robot), &e))?;
    let local = (arguments.lidar.ip(), 0);
    let local = if arguments.lidar.ip().is_loopback() {
        local
    } else {
        ([0, 0, 0, 0].into(), 0)
    };
    let sender = UdpSocket::bind(local).map_err(|e| taken("the lidar has no port", &e))?;
    let mut lidar = LiveLidar::new(world.clone());
    let cancelled = Cancelled::on_interrupt()?;
    output::text(&format!(
        "{} at {}, its lidar to {}",
        platform.robot.name(),
        robot.address(),
        arguments.lidar
    ))?;
    let seconds = arguments.seconds.unwrap_or(f64::INFINITY);
    let mut traced = world.start;
    thread_pool(None)?.install(|| {
        while !cancelled.is_cancelled() {
            let now = clock.now();
            if now.secs_since(world.start) >= seconds {
                break;
            }
            robot
                .step(now)
                .map_err(|e| taken("the robot's socket can't be read", &e))?;
            let walker = robot.body().walker();
            lidar.advance(
                now,
                |stamp| walker.map_from_base(stamp),
                |_, _, bytes| {
                    // As on a wire: nobody hears of what is lost.
                    let _ = sender.send_to(bytes, arguments.lidar);
                },
            );
            if arguments.trace && now.nanos_since(traced) >= TRACE_NS {
                traced = now;
                trace(&robot, now.secs_since(world.start))?;
            }
            std::thread::sleep(STEP);
        }
        Ok(())
    })
}

/// The robot of a name.
///
/// # Errors
/// There is none that can be driven.
pub fn platform_of(name: &str) -> Result<Platform, Failure> {
    Platform::of_name(name).ok_or_else(|| match name {
        // It takes velocities as ROS twists, and sends the speeds of its wheels there.
        "kairos" => Failure::new(
            "a kairos is driven over ROS 2, which hachi does not speak yet",
            "choose b1 or go1, or map its recordings with hachi replay --platform kairos",
        ),
        _ => Failure::new(
            format_args!("no robot {name:?} can be driven"),
            "choose b1 or go1",
        ),
    })
}

fn world_of(arguments: &SimulateArguments, settings: &Settings, start: Stamp) -> SimulationConfig {
    let mut world = SimulationConfig::preset(arguments.world, arguments.seed, f64::MAX);
    world.sensor = sensor_of(settings.lidar.kind);
    world.base_from_lidar = settings.base_from_lidar.pose();
    world.start = start;
    world
}

/// The sensor as the simulation names it.
pub fn sensor_of(kind: LidarKind) -> SensorKind {
    match kind {
        LidarKind::Vlp16 => SensorKind::Vlp16,
        LidarKind::Helios16p => SensorKind::Helios16P,
    }
}

fn trace(robot: &SimulatedRobot<WalkingBody>, time_s: f64) -> Result<(), Failure> {
    let walker = robot.body().walker();
    let at = walker.map_from_base(walker.stamp()).translation.vector;
    let v = walker.velocity();
    let line = Line {
        time_s,
        x_m: at.x,
        y_m: at.y,
        speed_m_per_s: v.forward.hypot(v.left),
        yaw_rate_rad_per_s: v.yaw_rate,
        way_m: walker.way_m(),
        commands: robot.counters().commands,
    };
    let json =
        serde_json::to_string(&line).map_err(|error| Failure::new(error, "please report this"))?;
    output::text(&json)
}
