//! The whole service and a simulated robot in one program, on one clock.
//!
//! In: settings, a world. Out: a table of the service's tasks and of the robot's, joined by wires in
//! memory. Elsewhere: the robot itself ([`super::simulator`]), who runs the table
//! (`hachi_runtime::executor`).

use hachi_bridge::message::Sensor;
use hachi_hal::Intrinsics;
use hachi_realsense::device::StreamFormat;
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_realsense::{RealSense, RealSenseConfig};
use hachi_runtime::{Overrun, TaskClock, TaskSpec, Trigger, VirtualClock};
use hachi_slam::Slam;
use hachi_unitree::device::{HighClient, MemoryLink, SimulatedRobotConfig, SimulatedService};
use hachi_world::{CameraConfig, LiveLidar, SensorKind, SimulatedCamera, SimulationConfig};

use super::camera::ColorOf;
use super::emergency_stop::StopBus;
use super::imu::ImuDevice;
use super::settings::Platform;
use super::simulator::{
    MemoryPackets, SeenPeople, SimulatedEye, SimulatorTask, Truth, WalkingBody,
};
use super::wiring::{Devices, Eyes, Running, Service, Watcher, assemble};
use crate::config::Settings;
use crate::exit::Failure;
use crate::recorder::Recorder;

/// The other side of the wires goes first: what it sends at a moment is there at that moment.
const SIMULATOR: TaskSpec = TaskSpec {
    name: "simulator",
    trigger: Trigger::Period {
        period_ns: 1_000_000,
    },
    budget_ns: i64::MAX,
    priority: 99,
    core: None,
    parallel: true,
    overrun: Overrun::Skip,
    hard: false,
    ladder: &[],
};

/// Whose packets a world's LiDAR sends.
pub fn sensor_of(world: &SimulationConfig) -> Sensor {
    match world.sensor {
        SensorKind::Helios16P => Sensor::Robosense,
        _ => Sensor::Velodyne,
    }
}

/// What not every robot has.
#[derive(Default)]
pub struct Besides {
    /// A camera.
    pub camera: Option<WatchedCamera>,
    /// An emergency stop's node and its bus.
    pub stop_bus: Option<StopBus>,
    /// An inertial sensor and its bus.
    pub imu: Option<ImuDevice>,
}

/// A camera on the simulated robot, and who sees what it sees.
pub struct WatchedCamera {
    /// The camera.
    pub camera: CameraConfig,
    /// Its cable.
    pub port: SimulatedPort,
    /// The networks, and who watches.
    pub watcher: Watcher,
    /// Who is truly seen.
    pub seen: SeenPeople,
}

impl WatchedCamera {
    /// The service's end of the cable, and the camera's.
    fn open(self, world: &SimulationConfig) -> (Eyes, SimulatedEye) {
        let geometry = self.camera.geometry;
        let rate = (1_000_000_000 / self.camera.period_ns.max(1)) as u32;
        let format = |o: &Intrinsics| StreamFormat::new(o.width, o.height, rate);
        let config = RealSenseConfig {
            depth: format(&geometry.depth),
            color: format(&geometry.color),
            ..RealSenseConfig::default()
        };
        let driver = RealSense::new(self.port.clone(), config);
        let pixels = [geometry.depth.pixels(), geometry.color.pixels()];
        let eyes = Eyes {
            camera: Box::new(ColorOf::new(driver, pixels[0], pixels[1])),
            people: Some(self.watcher),
            model_missing: false,
        };
        let eye = SimulatedEye {
            camera: SimulatedCamera::new(world, self.camera),
            port: self.port,
            seen: self.seen,
        };
        (eyes, eye)
    }
}

/// The service on one end of the wires, the simulated robot with what it has besides on the other; and
/// where that truly is.
///
/// # Errors
/// The settings do not fit together.
pub fn connect(
    settings: &Settings,
    platform: &Platform,
    world: &SimulationConfig,
    clock: &VirtualClock,
    running: Running,
    (slam, recorder): (Slam, Option<Recorder>),
    besides: Besides,
) -> Result<(Service, Truth), Failure> {
    let link = MemoryLink::new(clock.clone());
    let packets = MemoryPackets::default();
    let truth = Truth::default();
    let robot = platform.robot;
    let client = HighClient::over(robot, platform.client(&settings.robot), link.clone())
        .map_err(|error| Failure::new(error, "please report this"))?;
    let (eyes, eye) = besides.camera.map(|camera| camera.open(world)).unzip();
    let devices = Devices {
        eyes,
        platform: *platform,
        client,
        packets: packets.clone(),
        sensor: sensor_of(world),
        stop_bus: besides.stop_bus,
        imu: besides.imu,
    };
    let tasks = TaskClock::new(clock.clone());
    let mut service = assemble(settings, devices, slam, tasks, running, recorder)?;
    let body = WalkingBody::standing(platform, world);
    let config = SimulatedRobotConfig::for_robot(robot);
    let simulator = SimulatorTask {
        robot: SimulatedService::new(&robot.layout, body, config),
        link,
        lidar: LiveLidar::new(world.clone()),
        packets,
        truth: truth.clone(),
        eye,
    };
    let table = &mut service.table;
    table.add(SIMULATOR, table.bell(), vec![], Box::new(simulator));
    Ok((service, truth))
}
