//! An inertial sensor on a bus and the service that reads it, in virtual time.

mod program;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use hachi::config::{MotionInput, Settings};
use hachi::motion_samples::MotionSamples;
use hachi::record::RunRecord;
use hachi::recorder::{IMU_ON_BUS, Recorder};
use hachi::service::imu::ImuDevice;
use hachi::service::legs::Legs;
use hachi::service::settings::Platform;
use hachi::service::signs::SharedSigns;
use hachi::service::simulated::{Besides, connect, sensor_of};
use hachi::service::simulator::{Truth, WalkingBody};
use hachi::service::wiring::Running;
use hachi_bridge::{Bag, Body};
use hachi_hal::{Clock, Rotation, Stamp, Vector3};
use hachi_imu::Registers;
use hachi_imu::simulated::{Measures, SimulatedChip};
use hachi_imu::system::{AnyRegisters, BusFault};
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Health, TaskClock, TaskTable, VirtualClock, WhenFull, Work, bounded};
use hachi_slam::{MemoryStore, Slam};
use hachi_unitree::device::RobotBody;
use hachi_unitree::frame::HighCmd;
use hachi_unitree::{BodySample, LegTracker};
use hachi_world::{Preset, SimulationConfig};

const MS: i64 = 1_000_000;

/// What a chip on the robot's back would measure: turned as its mount says.
#[derive(Clone)]
struct OnTheBack {
    chip: SimulatedChip<VirtualClock>,
    truth: Arc<OnceLock<Truth>>,
    clock: VirtualClock,
    base_from_imu: Rotation,
    paused: Arc<AtomicBool>,
}

impl OnTheBack {
    /// How the base turns, by its last true poses.
    fn angular_velocity(&self) -> Option<Vector3> {
        let now = self.clock.now();
        let at = |ago_ms: i64| self.truth.get()?.map_from_base(now + -ago_ms * MS);
        let (before, after) = (at(22)?, at(12)?);
        let turn = before.rotation.inverse() * after.rotation;
        Some(turn.scaled_axis() / 0.01)
    }
}

impl Registers for OnTheBack {
    type Error = BusFault;

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), BusFault> {
        let imu_from_base = self.base_from_imu.inverse();
        let turning = self.angular_velocity().unwrap_or_default();
        let force = Vector3::new(0.0, 0.0, 9.81);
        self.chip.set(match self.paused.load(Ordering::Relaxed) {
            false => Measures::Motion(imu_from_base * turning, imu_from_base * force),
            true => Measures::Nothing,
        });
        self.chip.read(first, bytes)
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        self.chip.write(register, value)
    }
}

/// The service, the simulated robot that it drives round a corner, and the chip.
struct Rig {
    run: VirtualTime,
    clock: VirtualClock,
    signs: SharedSigns,
    health: Health,
    truth: Truth,
    record: Arc<Mutex<RunRecord>>,
    chip: SimulatedChip<VirtualClock>,
    /// Whether it measures nothing.
    paused: Arc<AtomicBool>,
    /// Whether the bus can't be opened.
    gone: Arc<AtomicBool>,
}

impl Rig {
    /// With a chip that is mounted so, and one that the settings take to be mounted so.
    fn new(mounted: Rotation, told: Rotation, recorder: Option<Recorder>) -> Self {
        let platform = Platform::of_name("b1").unwrap();
        let mut settings = Settings::load(Some("b1"), None).unwrap();
        settings.motion = MotionInput::None;
        settings.patrol.places = vec![[1.5, 0.0], [0.0, 0.0]];
        let mut world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
        world.base_from_lidar = settings.base_from_lidar.pose();
        let clock = VirtualClock::starting_at(world.start);
        let chip = SimulatedChip::new(clock.clone());
        let truth = Arc::new(OnceLock::new());
        let paused = Arc::new(AtomicBool::new(false));
        let back = OnTheBack {
            chip: chip.clone(),
            truth: Arc::clone(&truth),
            clock: clock.clone(),
            base_from_imu: mounted,
            paused: Arc::clone(&paused),
        };
        let gone = Arc::new(AtomicBool::new(false));
        let is_gone = Arc::clone(&gone);
        let imu = ImuDevice {
            open: Box::new(move || match is_gone.load(Ordering::Relaxed) {
                false => Ok(Box::new(back.clone()) as AnyRegisters),
                true => Err(BusFault("No such file or directory".to_owned())),
            }),
            measuring: settings.imu.measuring(),
            base_from_imu: told,
        };
        let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
        let (service, true_path) = connect(
            &settings,
            &platform,
            &world,
            &clock,
            Running::VirtualTime,
            (slam, recorder),
            Besides {
                imu: Some(imu),
                ..Besides::default()
            },
        )
        .unwrap();
        truth.set(true_path.clone()).unwrap();
        Self {
            health: service.table.health().clone(),
            run: VirtualTime::new(service.table, clock.clone()),
            signs: service.signs,
            record: service.record,
            truth: true_path,
            clock,
            chip,
            paused,
            gone,
        }
    }

    fn pass(&mut self, ms: i64) {
        self.run.run_until(self.clock.now() + ms * MS);
    }

    /// The farthest that odometry was off until now, m, and the most that it was turned, rad.
    fn error(&self) -> (f64, f64) {
        let record = self.record.lock().unwrap();
        let mut worst = (0.0_f64, 0.0_f64);
        let mut first = None;
        let stamps = record.trajectory.stamps().unwrap();
        for (stamp, odom_from_base) in stamps.iter().zip(record.trajectory.poses()) {
            let Some(truth) = self.truth.map_from_base(*stamp) else {
                continue;
            };
            let map_from_odom = *first.get_or_insert(truth * odom_from_base.inverse());
            let off = truth.inv_mul(&(map_from_odom * odom_from_base));
            worst.0 = worst.0.max(off.translation.vector.norm());
            worst.1 = worst.1.max(off.rotation.angle());
        }
        assert!(first.is_some());
        worst
    }

    fn samples(&self) -> u64 {
        self.signs.imu.counters().samples
    }
}

/// On its side, its plug to the left.
fn on_its_side() -> Rotation {
    Rotation::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.4)
}

#[test]
fn what_a_chip_on_a_bus_measures_turns_the_scans_as_the_chip_is_mounted() {
    let mut rig = Rig::new(on_its_side(), on_its_side(), None);
    rig.pass(9_000);
    assert_eq!(rig.health.line(), "running");
    // Two hundred a second.
    let samples = rig.samples();
    assert!((1_790..=1_800).contains(&samples), "{samples}");
    assert_eq!(rig.signs.imu.counters().missed, 0);
    let (off_m, off_rad) = rig.error();
    assert!(off_m < 0.05 && off_rad < 0.02, "{off_m} m, {off_rad} rad");
    // Told another mount than the chip has, odometry is misled: it does believe the chip.
    let off = Rotation::from_euler_angles(0.6, 0.0, 0.0);
    let mut rig = Rig::new(on_its_side(), off * on_its_side(), None);
    rig.pass(9_000);
    assert_eq!(rig.health.line(), "running");
    let (_, misled_rad) = rig.error();
    assert!(
        misled_rad > 3.0 * off_rad,
        "{misled_rad} rad, {off_rad} rad"
    );
}

#[test]
fn a_chip_that_lies_otherwise_than_the_settings_say_is_not_believed() {
    let mut rig = Rig::new(on_its_side(), Rotation::identity(), None);
    rig.pass(5_200);
    assert_eq!(rig.health.line(), "sensor lost: inertial sensor lost");
    let tilted = rig.signs.imu.tilted.load(Ordering::Relaxed);
    assert_eq!(tilted, rig.samples());
    let (off_m, off_rad) = rig.error();
    assert!(off_m < 0.05 && off_rad < 0.03, "{off_m} m, {off_rad} rad");
}

#[test]
fn a_bus_that_fails_is_opened_anew_and_odometry_goes_on_meanwhile() {
    let mut rig = Rig::new(on_its_side(), on_its_side(), None);
    rig.pass(3_000);
    assert_eq!(rig.health.line(), "running");
    let before = rig.samples();
    // One read that fails costs that read.
    rig.chip.fail(1);
    rig.pass(100);
    assert_eq!(rig.signs.imu.starts.load(Ordering::Relaxed), 1);
    assert!(rig.samples() >= before + 19);
    rig.gone.store(true, Ordering::Relaxed);
    rig.chip.fail(u32::MAX);
    rig.pass(2_900);
    assert_eq!(
        rig.health.line(),
        "sensor lost: inertial sensor lost",
        "a second without a sample"
    );
    let (lost, faults) = (rig.samples(), rig.signs.imu.faults.load(Ordering::Relaxed));
    // Ten reads, and every half second an attempt to open the bus.
    assert!((14..=18).contains(&faults), "{faults}");
    let scans = rig.record.lock().unwrap().scans();
    rig.gone.store(false, Ordering::Relaxed);
    rig.chip.fail(0);
    rig.pass(3_000);
    assert_eq!(rig.health.line(), "running");
    assert!(rig.samples() > lost + 400);
    assert!(rig.record.lock().unwrap().scans() >= scans + 29);
    let (off_m, off_rad) = rig.error();
    assert!(off_m < 0.05 && off_rad < 0.02, "{off_m} m, {off_rad} rad");
}

#[test]
fn a_chip_that_measures_nothing_or_lost_its_power_is_started_anew() {
    let mut rig = Rig::new(on_its_side(), on_its_side(), None);
    rig.pass(1_000);
    rig.chip.lose_power();
    rig.pass(300);
    // By the driver, which looks after 20 measurements; the bus stays open.
    assert_eq!(rig.signs.imu.counters().restarts, 1);
    assert_eq!(rig.signs.imu.starts.load(Ordering::Relaxed), 1);
    let before = rig.samples();
    rig.pass(200);
    assert!(rig.samples() >= before + 39);
    rig.paused.store(true, Ordering::Relaxed);
    rig.pass(1_800);
    // After half a second, and after each half second that it is given.
    let starts = rig.signs.imu.starts.load(Ordering::Relaxed);
    assert!((2..=3).contains(&starts), "{starts}");
    rig.pass(200);
    assert_eq!(rig.health.line(), "sensor lost: inertial sensor lost");
    rig.paused.store(false, Ordering::Relaxed);
    rig.pass(1_500);
    assert_eq!(rig.health.line(), "running");
}

#[test]
fn another_chip_is_said_and_not_believed() {
    let mut rig = Rig::new(on_its_side(), on_its_side(), None);
    // An MPU-6050.
    rig.chip.call_itself(0x68);
    rig.pass(3_000);
    assert_eq!(rig.samples(), 0);
    assert_eq!(rig.signs.imu.faults.load(Ordering::Relaxed), 6);
    // Nothing that the robot needs: it walks, and is patient as with other sensors.
    assert_eq!(rig.health.line(), "running");
    rig.pass(2_200);
    assert_eq!(rig.health.line(), "sensor lost: inertial sensor lost");
    let (off_m, _) = rig.error();
    assert!(off_m < 0.05, "{off_m} m");
    rig.chip.call_itself(0x47);
    rig.pass(1_000);
    assert_eq!(rig.health.line(), "running");
}

#[test]
fn its_samples_are_kept_beside_the_robots() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.mcap");
    let world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
    let recorder = Recorder::create(&path, sensor_of(&world)).unwrap();
    let mut rig = Rig::new(on_its_side(), on_its_side(), Some(recorder));
    rig.pass(1_000);
    let samples = rig.samples();
    let (begun, now) = (rig.clock.now() + -1_000 * MS, rig.clock.now());
    drop(rig);
    // A replay is given the chip's samples alone, not the robot's in between.
    let mut motion = MotionSamples::open(&path, MotionInput::Imu, None).unwrap();
    motion.read_until(begun, now);
    assert_eq!(motion.imu().len() as u64, samples);
    let mut bag = Bag::open(&path).unwrap();
    assert!(bag.topics().iter().any(|topic| topic.name == "/imu"));
    bag.retain(|topic| topic.name == IMU_ON_BUS);
    let mut stamps: Vec<Stamp> = Vec::new();
    while let Some(message) = bag.next_message().unwrap() {
        let Body::Imu(sample) = message.body else {
            panic!("{message:?}");
        };
        // In the base's axes, whichever way the chip lies.
        assert!((sample.specific_force - Vector3::new(0.0, 0.0, 9.81)).amax() < 0.01);
        stamps.push(sample.stamp);
    }
    assert_eq!(stamps.len() as u64, samples);
    assert!(stamps.is_sorted_by(|a, b| a < b));
}

#[test]
fn settings_that_cannot_work_are_said_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |section: &str| {
        let text = format!("[robot]\nplatform = \"b1\"\n[imu]\n{section}\n");
        let path = program::file(folder.path(), "hachi.toml", &text);
        Settings::load(None, Some(&path))
            .err()
            .map(|e| e.to_string())
    };
    for (section, said) in [
        ("buss = \"/dev/i2c-1\"", "line 4"),
        ("buss = \"/dev/i2c-1\"", "unknown field `buss`"),
        (
            "bus = \"/dev/ttyUSB0\"",
            "line 4: imu.bus = \"/dev/ttyUSB0\" can't work; name an I2C bus",
        ),
        ("bus = \"/dev/spidev0\"", "imu.bus"),
        (
            "bus = \"/dev/i2c-1\"\naddress = 0x76",
            "line 5: imu.address = 0x76 can't work; give 0x68, or 0x69",
        ),
        ("rate_hz = 400", "give 100, 200, 500 or 1000"),
        ("gyro_range_dps = 125", "give 250, 500, 1000 or 2000"),
        ("accel_range_g = 3", "give 2, 4, 8 or 16"),
        (
            "base_from_imu.rpy_deg = [0.0, nan, 0.0]",
            "line 4: imu.base_from_imu.rpy_deg",
        ),
        (
            "base_from_imu.rpy_rad = [0.0, 0.0, 0.0]",
            "unknown field `rpy_rad`",
        ),
    ] {
        let error = refused(section).unwrap();
        assert!(error.contains(said), "{error}");
    }
    assert_eq!(refused("bus = \"/dev/i2c-7\"\naddress = 0x69"), None);
    assert_eq!(refused("bus = \"/dev/spidev1.0\"\nrate_hz = 1000"), None);
}

#[test]
fn doctor_says_whether_the_chip_is_there() {
    let imu = program::doctor_finding("[imu]\nbus = \"/dev/i2c-250\"\n", "inertial sensor");
    assert_eq!(imu["level"], "warn");
    let what = imu["what"].as_str().unwrap();
    assert!(what.starts_with("0x68 on /dev/i2c-250: "), "{what}");
    let next_step = imu["next_step"].as_str().unwrap();
    assert!(next_step.contains("[imu] in hachi.toml"), "{next_step}");
}

#[test]
fn without_a_chip_the_robots_own_samples_can_be_asked_for() {
    let platform = Platform::of_name("go1").unwrap();
    let world = SimulationConfig::preset(Preset::Office, 1, 1.0);
    let mut body = WalkingBody::standing(&platform, &world);
    body.step(&HighCmd::default(), 0.002);
    let tick = body.walker().tick();
    let table = TaskTable::new(TaskClock::new(VirtualClock::starting_at(Stamp::default())));
    let (bodies, bodies_end) = bounded("bodies", 8, WhenFull::DropOldest, &table.bell());
    let (sender, receiver) = bounded("inertial", 8, WhenFull::DropOldest, &table.bell());
    let mut legs = Legs {
        tracker: LegTracker::new(platform.robot),
        bodies: bodies_end,
        motion: bounded("motion", 8, WhenFull::DropOldest, &table.bell()).0,
        inertial: Some(sender),
        ground: bounded("ground", 8, WhenFull::DropOldest, &table.bell()).0,
        record: None,
    };
    bodies.send(BodySample {
        legs: tick.legs,
        imu: tick.imu,
        attitude: tick.attitude,
    });
    legs.run(tick.imu.stamp);
    assert_eq!(receiver.receive(), Some(tick.imu));
}
