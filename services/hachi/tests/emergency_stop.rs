//! An emergency stop's node on a CAN bus and the service that listens to it, in virtual time.

mod program;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use hachi::config::{MotionInput, Settings};
use hachi::service::emergency_stop::{OpenBus, StopBus};
use hachi::service::settings::Platform;
use hachi::service::signs::SharedSigns;
use hachi::service::simulated::{Besides, connect};
use hachi::service::simulator::Truth;
use hachi::service::wiring::Running;
use hachi_behaviour::Cause;
use hachi_canbus::BusError;
use hachi_canbus::device::{CanBus, Received};
use hachi_canbus::frame::CanFrame;
use hachi_hal::{Clock, Stamp};
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Health, VirtualClock};
use hachi_slam::{MemoryStore, Slam};
use hachi_world::{Preset, SimulationConfig};

const MS: i64 = 1_000_000;

/// A CANopen input node on a bus that can go down: a heartbeat every 100 ms, its inputs once after
/// it went into operation and whenever they change.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    powered: bool,
    /// Nothing that it sends arrives, and it goes on sending.
    cut_off: bool,
    /// Of its first two inputs, a bit each.
    closed: u8,
    bus_down: bool,
    told: Option<u8>,
    heartbeat_at: i64,
    /// Reads of the bus so far.
    reads: u32,
}

#[derive(Clone)]
struct Bus(Arc<Mutex<Node>>, VirtualClock);

impl CanBus for Bus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        assert_eq!(CanFrame::request(0x185), Some(*frame));
        self.0.lock().unwrap().told = None;
        Ok(())
    }

    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, BusError> {
        assert!(limit.is_zero(), "a task that waits: {limit:?}");
        let mut node = self.0.lock().unwrap();
        node.reads += 1;
        let now = self.1.now().as_nanos();
        if node.bus_down {
            return Err(BusError::Down(std::io::ErrorKind::NetworkDown.into()));
        }
        if !node.powered {
            node.told = None;
            return Ok(None);
        }
        if node.cut_off {
            node.told = Some(node.closed);
            return Ok(None);
        }
        // Node 5 in operation, CiA 301; its inputs, CiA 401.
        let frame = if now >= node.heartbeat_at {
            node.heartbeat_at = now + 100 * MS;
            CanFrame::new(0x705, &[0x05])
        } else if node.told != Some(node.closed) {
            node.told = Some(node.closed);
            CanFrame::new(0x185, &[node.closed])
        } else {
            None
        };
        Ok(frame.map(|frame| Received { frame, age_ns: 0 }))
    }
}

/// The service, the simulated robot that it drives through the office, and the stop's node.
struct Rig {
    run: VirtualTime,
    clock: VirtualClock,
    signs: SharedSigns,
    health: Health,
    truth: Truth,
    node: Arc<Mutex<Node>>,
}

impl Rig {
    fn new(node: Node) -> Self {
        let platform = Platform::of_name("b1").unwrap();
        let mut settings = Settings::load(Some("b1"), None).unwrap();
        settings.motion = MotionInput::Odometry;
        settings.patrol.places = vec![[8.0, 0.0], [0.0, 0.0]];
        settings.emergency_stop.can = Some("can0".to_owned());
        settings.emergency_stop.node = 5;
        let mut world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
        world.base_from_lidar = settings.base_from_lidar.pose();
        let clock = VirtualClock::starting_at(world.start);
        let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
        let node = Arc::new(Mutex::new(node));
        let bus = Bus(Arc::clone(&node), clock.clone());
        let open: OpenBus = Box::new(move || match bus.0.lock().unwrap().bus_down {
            true => Err(BusError::Down(std::io::ErrorKind::NetworkDown.into())),
            false => Ok(Box::new(bus.clone())),
        });
        let (_, node_config) = settings.emergency_stop.node().unwrap();
        let stop_bus = StopBus {
            node: node_config,
            open,
        };
        let (service, truth) = connect(
            &settings,
            &platform,
            &world,
            &clock,
            Running::VirtualTime,
            (slam, None),
            Besides {
                stop_bus: Some(stop_bus),
                ..Besides::default()
            },
        )
        .unwrap();
        let health = service.table.health().clone();
        Self {
            run: VirtualTime::new(service.table, clock.clone()),
            signs: service.signs,
            clock,
            health,
            truth,
            node,
        }
    }

    fn set(&self, change: impl FnOnce(&mut Node)) {
        change(&mut self.node.lock().unwrap());
    }

    fn pass(&mut self, ns: i64) {
        self.run.run_until(self.clock.now() + ns);
    }

    /// How far the robot gets in so long, m.
    fn way_m(&mut self, ns: i64) -> f64 {
        // The newest true pose is a moment old.
        let at = |truth: &Truth, now: Stamp| truth.map_from_base(now + -20 * MS).unwrap();
        let before = at(&self.truth, self.clock.now());
        self.pass(ns);
        let after = at(&self.truth, self.clock.now());
        (after.translation.vector - before.translation.vector)
            .xy()
            .norm()
    }

    /// How long until the gate stops the robot for this fault, ns.
    #[track_caller]
    fn stops_after(&mut self, fault: &str) -> i64 {
        let cause = Cause::EmergencyStop;
        let begun = self.clock.now();
        while !self.signs.causes().iter().any(|c| c == cause) {
            self.pass(MS);
            assert!(self.clock.now().nanos_since(begun) < 2_000 * MS, "never");
        }
        let noticed = self.clock.now().nanos_since(begun);
        program::stop_time(fault, noticed as f64 * 1e-9);
        noticed
    }

    /// It stands, and not because it has nowhere to go.
    #[track_caller]
    fn stands(&mut self) {
        self.pass(500 * MS);
        let way_m = self.way_m(500 * MS);
        assert!(way_m < 0.01, "{way_m} m");
    }

    #[track_caller]
    fn walks(&mut self) {
        self.pass(1_000 * MS);
        let way_m = self.way_m(1_000 * MS);
        assert!(way_m > 0.2, "{way_m} m: {:?}", self.signs.causes());
    }
}

const CLOSED: Node = Node {
    powered: true,
    cut_off: false,
    closed: 0b11,
    bus_down: false,
    told: None,
    heartbeat_at: 0,
    reads: 0,
};

#[test]
fn a_stop_on_the_can_bus_stops_the_robot_and_releases_it_again() {
    let mut rig = Rig::new(CLOSED);
    rig.pass(1_000 * MS);
    rig.walks();
    assert_eq!(rig.health.line(), "running");
    rig.set(|node| node.closed = 0);
    let noticed = rig.stops_after("CAN stop pressed");
    assert!(noticed <= 15 * MS, "{noticed} ns");
    rig.stands();
    // Pressed is no fault of the node, and no reason to read more: two hundred runs, ten frames.
    rig.set(|node| node.reads = 0);
    rig.pass(1_000 * MS);
    rig.set(|node| assert!((205..=215).contains(&node.reads), "{}", node.reads));
    assert_eq!(rig.health.line(), "running");
    rig.set(|node| node.closed = 0b11);
    rig.walks();
    // One of the two contacts opens: a wire is broken.
    rig.set(|node| node.closed = 0b01);
    let noticed = rig.stops_after("CAN stop, a wire broken");
    assert!(noticed <= 15 * MS, "{noticed} ns");
    rig.stands();
    rig.pass(1_000 * MS);
    assert_eq!(rig.health.line(), "sensor lost: emergency stop lost");
}

#[test]
fn a_silent_stop_node_is_taken_for_pressed_and_one_that_comes_back_lets_the_robot_go_on() {
    let mut rig = Rig::new(CLOSED);
    rig.pass(1_000 * MS);
    rig.walks();
    rig.set(|node| node.powered = false);
    // 0.25 s after its last heartbeat, which is up to 0.1 s ago, and two runs of 5 ms.
    let noticed = rig.stops_after("CAN stop silent: power");
    assert!((140 * MS..=260 * MS).contains(&noticed), "{noticed} ns");
    rig.stands();
    rig.pass(500 * MS);
    assert_eq!(rig.health.line(), "sensor lost: emergency stop lost");
    rig.set(|node| node.powered = true);
    rig.walks();
    assert_eq!(rig.health.line(), "running");
}

#[test]
fn a_stop_that_is_pressed_while_its_cable_is_out_is_pressed_when_it_is_back() {
    let mut rig = Rig::new(CLOSED);
    rig.pass(1_000 * MS);
    rig.walks();
    rig.set(|node| {
        node.cut_off = true;
        node.closed = 0;
    });
    rig.stops_after("CAN stop silent: cable");
    rig.pass(500 * MS);
    rig.set(|node| node.cut_off = false);
    rig.stands();
    rig.set(|node| node.closed = 0b11);
    rig.walks();
}

#[test]
fn a_can_bus_that_goes_down_stops_the_robot_and_is_opened_anew() {
    let mut rig = Rig::new(CLOSED);
    rig.pass(1_000 * MS);
    rig.walks();
    rig.set(|node| node.bus_down = true);
    let noticed = rig.stops_after("CAN bus down");
    assert!(noticed <= 15 * MS, "{noticed} ns");
    rig.stands();
    rig.set(|node| node.bus_down = false);
    rig.walks();
}

#[test]
fn a_stop_node_that_was_never_heard_moves_nothing() {
    let mut rig = Rig::new(Node::default());
    rig.pass(1_000 * MS);
    assert!(rig.way_m(3_000 * MS) < 0.01);
    assert_eq!(rig.health.line(), "starting");
    rig.pass(2_000 * MS);
    assert_eq!(rig.health.line(), "sensor lost: emergency stop lost");
    rig.set(|node| {
        *node = CLOSED;
    });
    rig.walks();
}

#[test]
fn a_stop_that_cannot_be_listened_to_is_said_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |section: &str| {
        let text = format!(
            "[robot]\nplatform = \"b1\"\naddress = \"127.0.0.1:9\"\nlocal_port = 0\n\
             [lidar]\nports = [0]\nbind_address = \"127.0.0.1\"\n[emergency_stop]\n{section}\n"
        );
        let path = program::file(folder.path(), "hachi.toml", &text);
        Settings::load(None, Some(&path))
            .err()
            .map(|e| e.to_string())
    };
    for (section, said) in [
        (
            "can = \"can0\"\nnode = 0",
            "line 10: emergency_stop.node = 0 can't work; give 1 to 127",
        ),
        (
            "inputs = []",
            "line 9: emergency_stop.inputs = [] can't work",
        ),
        ("inputs = [9]", "inputs 1 to 8"),
        ("heartbeat_stale_s = 250.0", "give 0.05 to 2 s"),
        ("can = \"a/b\"", "name an interface"),
        ("interface = \"can0\"", "unknown field `interface`"),
    ] {
        let error = refused(section).unwrap();
        assert!(error.contains(said), "{error}");
    }
    assert_eq!(refused("can = \"nobus9\""), None);
    let config = folder.path().join("hachi.toml");
    let failed = program::finished(
        program::hachi()
            .args(["run", "--log", "off", "--config", program::text(&config)])
            .output()
            .unwrap(),
    );
    let line = failed.failure();
    assert!(
        line.contains("nobus9") && line.contains("emergency_stop.can"),
        "{line}"
    );
}

#[test]
fn a_kairos_cannot_be_driven_and_it_is_said_why() {
    let folder = tempfile::tempdir().unwrap();
    let config = program::file(folder.path(), "k.toml", "robot.platform = \"kairos\"\n");
    let error = hachi::commands::simulate::platform_of("kairos").unwrap_err();
    assert!(error.to_string().contains("over ROS 2"), "{error}");
    // It can be mapped with.
    Settings::load(None, Some(&config)).unwrap();
}
