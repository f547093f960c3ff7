//! The flow: from the packets of a LiDAR and the states of a robot to a map and to commands.
//!
//! ```text
//! packets ─ lidar receive ─ filter ─ odometry ─ slam
//!                             │ obstacles  │ place ↖ correction
//! states ─ base command ←─────┴── gate ────┤
//! stop node ─────↗                         │
//!    │         ↑ wish                      ↓
//!    └ legs    └──────────────────── behaviour
//!
//! chip ─ imu ─ odometry
//!
//! pictures ─ camera receive ─ detection ─ tracking   (people)
//! ```

use std::sync::{Arc, Mutex};

use hachi_behaviour::{Causes, GuardedBase, ObstacleFinder, Obstacles, Patrol, SafetyGate, Sight};
use hachi_bridge::message::Sensor;
use hachi_cloud::Filters;
use hachi_hal::{LidarScans, PacketSource, Pose, Rotation, Stamp};
use hachi_imu::ImuCounters;
use hachi_odometry::{Odometry, OdometryConfig};
use hachi_people::observe::Observer;
use hachi_robosense::{RobosenseConfig, RobosenseScans};
use hachi_runtime::{Histogram, SoftWatchdog, TaskClock, TaskTable, WhenFull, Work, bounded};
use hachi_slam::Slam;
use hachi_unitree::LegTracker;
use hachi_unitree::device::{HighClient, RobotLink};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};
use nalgebra::Translation3;

use super::base::BaseCommandTask;
use super::behaviour::Behaviour;
use super::body::UnitreeBody;
use super::camera::PictureSource;
use super::crew::Crew;
use super::emergency_stop::{EmergencyStopTask, StopBus};
use super::filter::Filter;
use super::imu::{ImuDevice, ImuTask};
use super::keeper::Kept as KeptPeople;
use super::legs::Legs;
use super::lidar::LidarReceive;
use super::messages::{Belt, Correction, Kept, Placed, Scan, belt};
use super::odometry::OdometryTask;
use super::people::{NoPeople, PeopleDesk};
use super::record::{Datagram, RecorderTask, Tap};
use super::settings::{Platform, row};
use super::signs::SharedSigns;
use super::slam::SlamTask;
use super::supervisor::Supervisor;
use super::tracking::Audience;
use super::{imu, odometry, people, record, rows};
use crate::config::{MotionInput, Settings};
use crate::exit::Failure;
use crate::record::RunRecord;
use crate::recorder::Recorder;
use crate::slam_stage::SlamStage;

/// The base command task is fed to the watchdog; after this it hangs, ns. Twenty of its runs.
const WATCHDOG_NS: i64 = 100_000_000;

/// What the service is connected to.
pub struct Devices<P, L> {
    /// The robot.
    pub platform: Platform,
    /// Its high-level service.
    pub client: HighClient<L>,
    /// The LiDAR's packets.
    pub packets: P,
    /// Which sensor sends them.
    pub sensor: Sensor,
    /// The emergency stop's node and its bus, where the settings name one.
    pub stop_bus: Option<StopBus>,
    /// The inertial sensor on a bus, where the settings name one.
    pub imu: Option<ImuDevice>,
    /// The camera, where there is to be one.
    pub eyes: Option<Eyes>,
}

/// A camera, and what is made of its pictures.
pub struct Eyes {
    /// The camera.
    pub camera: Box<dyn PictureSource>,
    /// The networks; nobody is looked for without.
    pub people: Option<Watcher>,
    /// Whether networks were asked for and are not there.
    pub model_missing: bool,
}

/// Looks for people and knows some.
pub struct Watcher {
    /// The networks.
    pub observer: Observer,
    /// Who is known, and where what is learnt of them is kept; nobody is without.
    pub kept: Option<KeptPeople>,
    /// Who else sees it.
    pub audience: Option<Box<dyn Audience>>,
}

/// How the tasks are run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Running {
    /// By threads, each with so many cores for its parallel work (0: all); without an end, so that
    /// no path is kept.
    Threads(usize),
    /// By one thread in virtual time, with the path kept.
    VirtualTime,
}

impl Running {
    /// Whether the run ends by itself, so that what it keeps of its path is bounded.
    fn has_an_end(self) -> bool {
        self == Self::VirtualTime
    }

    fn crew(self, priority: u8) -> Crew {
        match self {
            Self::VirtualTime => Crew::ambient(),
            Self::Threads(0) => {
                let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
                Crew::own(cores, priority)
            }
            Self::Threads(threads) => Crew::own(threads, priority),
        }
    }
}

/// The service, ready for an executor.
pub struct Service {
    /// Its tasks.
    pub table: TaskTable,
    /// What they leave.
    pub signs: SharedSigns,
    /// What was done so far; the tasks hold it while they run.
    pub record: Arc<Mutex<RunRecord>>,
    /// SLAM; likewise.
    pub slam: Arc<Mutex<SlamStage>>,
    /// Where people are told of.
    pub people: Result<PeopleDesk, NoPeople>,
    /// Bites when the base command task hangs.
    pub watchdog: SoftWatchdog,
    /// How long a scan takes through filter, odometry and SLAM.
    pub scan_times: Arc<Histogram>,
}

/// Puts the tasks together.
///
/// # Errors
/// A setting that no filter can work with.
pub fn assemble<P, L>(
    settings: &Settings,
    devices: Devices<P, L>,
    slam: Slam,
    clock: TaskClock,
    running: Running,
    recorder: Option<Recorder>,
) -> Result<Service, Failure>
where
    P: PacketSource + Send + 'static,
    L: RobotLink + Send + 'static,
{
    let base_from_lidar = settings.base_from_lidar.pose();
    let mut table = TaskTable::new(clock);
    let signs = SharedSigns::default();
    let record = Arc::new(Mutex::new(RunRecord::new(running.has_an_end())));
    // On a map that was made before, nobody knows the place until SLAM says so.
    let begins_the_map = slam.map().nodes().is_empty();
    let stage = SlamStage::new(slam, base_from_lidar);
    let stage = match running.has_an_end() {
        true => stage,
        false => stage.without_path(),
    };
    let slam = Arc::new(Mutex::new(stage));
    let watchdog = SoftWatchdog::new(WATCHDOG_NS);

    let [to_legs, to_filter, to_odometry, to_slam, nobody] = [0; 5].map(|_| table.bell());
    let (scans, scans_end) = belt::<Scan>(&table, "scans", 2, &to_filter);
    let (kept, kept_end) = belt::<Kept>(&table, "kept scans", 2, &to_odometry);
    let (placed, placed_end) = belt::<Placed>(&table, "placed scans", 4, &to_slam);
    let (bodies, bodies_end) = bounded("bodies", 64, WhenFull::DropOldest, &to_legs);
    // A scan of a tenth of a second asks for the samples of a fifth.
    let (motion, motion_end) = bounded("leg motion", 256, WhenFull::DropOldest, &nobody);
    let (inertial, inertial_end) = bounded("inertial", 256, WhenFull::DropOldest, &nobody);
    let (ground, ground_end) = bounded("ground", 2, WhenFull::DropOldest, &nobody);
    let (around, around_end) = bounded("obstacles", 2, WhenFull::DropOldest, &nobody);
    let (around_patrol, behaviour_around) = bounded("obstacles", 2, WhenFull::DropOldest, &nobody);
    let (corrections, corrections_end) = bounded("corrections", 2, WhenFull::DropOldest, &nobody);
    let (to_gate, gate_places) = bounded("places", 2, WhenFull::DropOldest, &nobody);
    let (to_behaviour, behaviour_places) = bounded("places", 2, WhenFull::DropOldest, &nobody);
    let (record_bodies, bodies_to_record) =
        bounded("bodies to record", 64, WhenFull::DropOldest, &nobody);
    let (record_inertial, inertial_to_record) =
        bounded("inertial to record", 128, WhenFull::DropOldest, &nobody);
    let (record_packets, packets_to_record) =
        belt::<Datagram>(&table, "packets to record", record::WAITING, &nobody);
    let records = recorder.is_some();
    let (wishes, wishes_end) = bounded("wishes", 4, WhenFull::DropOldest, &nobody);

    let (to_stop, stop_samples) = bounded("emergency stop", 4, WhenFull::DropOldest, &nobody);

    let gate = SafetyGate::new(settings.safety);
    let base_command = BaseCommandTask {
        base: GuardedBase::new(gate, UnitreeBody(devices.client)),
        sight: Sight::default(),
        wishes: wishes_end,
        wish: None,
        stop_node: devices.stop_bus.is_some().then_some(stop_samples),
        node_stop: None,
        remote_stop: None,
        places: gate_places,
        around: around_end,
        obstacles: None,
        bodies,
        halt: table.halt().clone(),
        watchdog: watchdog.clone(),
        signs: Arc::clone(&signs),
        said: Causes::default(),
        failing: false,
        deaf: false,
    };
    let bell = table.bell();
    let spec = row(settings, rows::BASE_COMMAND);
    // Of states only the newest counts: that the others go is no loss, and is not told.
    table.add(spec, bell, vec![], Box::new(base_command));

    let has_stop_node = devices.stop_bus.is_some();
    if let Some(bus) = devices.stop_bus {
        let task = EmergencyStopTask {
            bus,
            clock: table.clock().clone(),
            out: to_stop,
            signs: Arc::clone(&signs),
            stop: None,
            opens_at: None,
            said: None,
        };
        let bell = table.bell();
        let spec = row(settings, rows::EMERGENCY_STOP);
        // Of samples only the newest counts: that the others go is no loss, and is not told.
        table.add(spec, bell, vec![], Box::new(task));
    }

    let packets = Tap {
        source: devices.packets,
        out: records.then_some(record_packets),
    };
    let receive = lidar_receive(devices.sensor, packets, scans, Arc::clone(&signs));
    let bell = table.bell();
    table.add(row(settings, rows::LIDAR_RECEIVE), bell, vec![], receive);

    let has_imu = devices.imu.is_some();
    // The robot's own samples are for a robot that has no better sensor.
    let from_the_robot =
        (!has_imu && settings.motion == MotionInput::Imu).then(|| inertial.clone());
    if let Some(device) = devices.imu {
        let spec = row(settings, imu::spec(&device.measuring));
        let task = ImuTask {
            device,
            clock: table.clock().clone(),
            out: inertial,
            record: records.then_some(record_inertial),
            signs: Arc::clone(&signs),
            sensor: None,
            starts_at: None,
            past: ImuCounters::default(),
            said: None,
        };
        let bell = table.bell();
        table.add(spec, bell, vec![], Box::new(task));
    }

    let gauges = vec![bodies_end.gauge()];
    let legs = Legs {
        tracker: LegTracker::new(devices.platform.robot),
        bodies: bodies_end,
        motion,
        inertial: from_the_robot,
        ground,
        record: records.then_some(record_bodies),
    };
    table.add(row(settings, rows::LEGS), to_legs, gauges, Box::new(legs));

    let supervisor = Supervisor {
        has_camera: devices.eyes.is_some(),
        signs: Arc::clone(&signs),
        health: table.health().clone(),
        has_stop_node,
        has_imu,
        begun: None,
        started: false,
    };
    let bell = table.bell();
    table.add(
        row(settings, rows::SUPERVISOR),
        bell,
        vec![],
        Box::new(supervisor),
    );

    let spec = row(settings, rows::FILTER);
    let gauges = vec![scans_end.full.gauge()];
    let standing = Translation3::new(0.0, 0.0, devices.platform.standing_m);
    let filter = Filter {
        filters: Filters::new(settings.filter.clone())
            .map_err(|error| Failure::new(error, "correct the [filter] section"))?,
        finder: ObstacleFinder::new(&settings.safety),
        base_from_lidar,
        usual_footprint_from_base: Pose::from_parts(standing, Rotation::identity()),
        felt: None,
        ground: ground_end,
        scans: scans_end,
        obstacles: [around, around_patrol],
        out: kept,
        crew: running.crew(spec.priority),
        level: 0,
    };
    table.add(spec, to_filter, gauges, Box::new(filter));

    let spec = row(settings, rows::ODOMETRY);
    let gauges = vec![
        kept_end.full.gauge(),
        motion_end.gauge(),
        inertial_end.gauge(),
    ];
    let latencies = [
        table.latency("first packet to pose"),
        table.latency("last packet to pose"),
    ];
    let config = OdometryConfig {
        // Samples come in the base's axes.
        lidar_from_imu: base_from_lidar.rotation.inverse(),
        ..settings.odometry.clone()
    };
    let odometry = OdometryTask {
        odometry: Odometry::new(config),
        base_from_lidar,
        scans: kept_end,
        motion: motion_end,
        samples: Vec::with_capacity(odometry::SAMPLES),
        inertial: inertial_end,
        inertial_samples: Vec::with_capacity(odometry::SAMPLES),
        corrections: corrections_end,
        correction: Correction {
            map_from_odom: Pose::identity(),
            trusted: begins_the_map,
        },
        out: placed,
        places: [to_gate, to_behaviour],
        record: Arc::clone(&record),
        latencies,
        signs: Arc::clone(&signs),
        clock: table.clock().clone(),
        crew: running.crew(spec.priority),
        uses_legs: settings.motion == MotionInput::Odometry,
    };
    table.add(spec, to_odometry, gauges, Box::new(odometry));

    let behaviour = Behaviour {
        patrol: Patrol::new(settings.patrol.clone(), settings.safety),
        places: behaviour_places,
        place: None,
        around: behaviour_around,
        obstacles: Obstacles::none(Stamp::default()),
        signs: Arc::clone(&signs),
        wishes,
    };
    let bell = table.bell();
    table.add(
        row(settings, rows::BEHAVIOUR),
        bell,
        vec![],
        Box::new(behaviour),
    );

    let spec = row(settings, rows::SLAM);
    let scan_times = table.latency("filter to map");
    let gauges = vec![placed_end.full.gauge()];
    let task = SlamTask {
        stage: Arc::clone(&slam),
        scans: placed_end,
        corrections,
        signs: Arc::clone(&signs),
        crew: running.crew(spec.priority),
        level: 0,
        count: 0,
        scan_times: Arc::clone(&scan_times),
    };
    table.add(spec, to_slam, gauges, Box::new(task));

    let people = match devices.eyes {
        Some(eyes) => people::open(eyes, settings, &mut table, &signs),
        None => Err(NoPeople::NotAskedFor),
    };

    if records {
        let gauges = vec![
            packets_to_record.full.gauge(),
            bodies_to_record.gauge(),
            inertial_to_record.gauge(),
        ];
        let task = RecorderTask {
            recorder,
            packets: packets_to_record,
            bodies: bodies_to_record,
            inertial: inertial_to_record,
            batch: Vec::with_capacity(record::WAITING + 2),
            signs: Arc::clone(&signs),
        };
        let bell = table.bell();
        table.add(row(settings, rows::RECORDER), bell, gauges, Box::new(task));
    }
    Ok(Service {
        table,
        signs,
        record,
        slam,
        people,
        watchdog,
        scan_times,
    })
}

/// The driver of a sensor, as a task.
fn lidar_receive<P: PacketSource + Send + 'static>(
    sensor: Sensor,
    packets: P,
    out: Belt<Scan>,
    signs: SharedSigns,
) -> Box<dyn Work> {
    fn task<S>(scans: S, out: Belt<Scan>, signs: SharedSigns) -> Box<dyn Work>
    where
        S: LidarScans + Send + 'static,
    {
        Box::new(LidarReceive {
            scans,
            out,
            signs,
            failures: 0,
        })
    }
    match sensor {
        Sensor::Velodyne => {
            let scans = VelodyneScans::new(packets, VelodyneConfig::default());
            task(scans, out, signs)
        }
        Sensor::Robosense => {
            let scans = RobosenseScans::new(packets, RobosenseConfig::default());
            task(scans, out, signs)
        }
    }
}
