//! The service's camera: what it says when the camera is pulled out, when it comes back, and that a
//! robot that needs it stands meanwhile. The whole service in virtual time, with networks that see
//! nobody.

use hachi::config::{MotionInput, Settings};
use hachi::service::settings::Platform;
use hachi::service::signs::SharedSigns;
use hachi::service::simulated::{Besides, WatchedCamera, connect};
use hachi::service::simulator::SeenPeople;
use hachi::service::wiring::{Running, Watcher};
use hachi_behaviour::Cause;
use hachi_inference::fixed::FixedAnswers;
use hachi_inference::{Loaded, Manifest, Port, Signature, Tensor};
use hachi_people::detect::{Detector, Wanted};
use hachi_people::observe::Observer;
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Health, HealthState, VirtualClock};
use hachi_slam::{MemoryStore, Slam};
use hachi_world::{CameraConfig, Preset, SimulationConfig};

const SECOND_NS: i64 = 1_000_000_000;

/// A detector for pictures of 64 x 64 whose every place says that nobody is there.
fn blind() -> Observer {
    let manifest = "\
about = \"sees nobody\"

[input]
name = \"numbers\"
layout = \"nchw\"
width = 64
height = 64
channels = \"bgr\"
fit = \"letterbox-corner\"
fill = 114

[decoder]
kind = \"yolox\"
classes = 1
person = 0
even_score = 0.5
";
    let manifest = Manifest::from_toml(manifest).unwrap();
    // 8 x 8, 4 x 4 and 2 x 2 places of four numbers, sure, and one class.
    let shape = [1, 84, 6];
    let port = |shape: &[usize]| Port {
        name: "numbers".to_owned(),
        shape: Some(shape.iter().copied().map(Some).collect()),
        is_f32: true,
    };
    let signature = Signature {
        back_end: "fixed".to_owned(),
        inputs: vec![port(&[1, 3, 64, 64])],
        outputs: vec![port(&shape)],
    };
    let model = Box::new(FixedAnswers::new(signature, [vec![Tensor::zeros(&shape)]]));
    let detector = Detector::new(Loaded { manifest, model }, Wanted::People).unwrap();
    Observer::new(detector, None)
}

struct Rig {
    run: VirtualTime,
    port: SimulatedPort,
    signs: SharedSigns,
    health: Health,
    now: hachi_hal::Stamp,
}

impl Rig {
    fn new(camera_needed: bool) -> Self {
        let platform = Platform::of_name("b1").unwrap();
        let mut settings = Settings::load(Some("b1"), None).unwrap();
        settings.motion = MotionInput::Odometry;
        settings.safety.camera_needed = camera_needed;
        settings.patrol.places = vec![[8.0, 0.0], [0.0, 0.0]];
        let mut world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
        world.base_from_lidar = settings.base_from_lidar.pose();
        let clock = VirtualClock::starting_at(world.start);
        let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
        let camera = CameraConfig {
            period_ns: SECOND_NS / 5,
            ..CameraConfig::d455(424, 240, 0.2)
        };
        let port = SimulatedPort::new(camera.geometry);
        let watched = WatchedCamera {
            camera,
            port: port.clone(),
            watcher: Watcher {
                observer: blind(),
                kept: None,
                audience: None,
            },
            seen: SeenPeople::default(),
        };
        let besides = Besides {
            camera: Some(watched),
            ..Besides::default()
        };
        let (service, _) = connect(
            &settings,
            &platform,
            &world,
            &clock,
            Running::VirtualTime,
            (slam, None),
            besides,
        )
        .unwrap();
        Self {
            health: service.table.health().clone(),
            run: VirtualTime::new(service.table, clock),
            port,
            signs: service.signs,
            now: world.start,
        }
    }

    fn pass(&mut self, seconds: f64) {
        self.now = self.now + (seconds * 1e9) as i64;
        self.run.run_until(self.now);
    }

    fn runs(&self, task: &str) -> u64 {
        let rows = self.run.telemetry().rows();
        rows.iter()
            .find(|row| row.name == task)
            .map_or(0, |row| row.execution.runs)
    }
}

#[test]
fn a_camera_that_is_pulled_out_is_said_and_stops_a_robot_that_needs_it() {
    let mut rig = Rig::new(true);
    rig.pass(3.0);
    assert!(rig.signs.causes().is_empty(), "{}", rig.signs.causes());
    assert_eq!(rig.health.state(), HealthState::Running);
    // Five pictures a second, each looked at once.
    assert!((13..=15).contains(&rig.runs("tracking")));
    let latencies = rig.run.telemetry().latency_rows();
    let shutter = latencies.iter().find(|l| l.name == "shutter to target");
    // At most the way to the computer, 8 ms, and the camera task's period. The driver takes the least
    // way that it has seen for none, all but half an exposure.
    assert!((4.0..19.0).contains(&shutter.unwrap().times.p99_ms));

    rig.port.plug(false);
    rig.pass(1.5);
    assert!(rig.signs.causes().has(Cause::CameraStale));
    assert_eq!(rig.health.state(), HealthState::SensorLost);
    assert!(rig.health.line().contains("camera lost"));
    let (odometry, command) = (rig.runs("odometry"), rig.runs("base command"));

    rig.port.plug(true);
    rig.pass(2.0);
    assert!(rig.signs.causes().is_empty(), "{}", rig.signs.causes());
    assert_eq!(rig.health.state(), HealthState::Running);
    // Nothing else noticed.
    assert!(rig.runs("odometry") >= odometry + 19);
    assert!(rig.runs("base command") >= command + 399);
}

#[test]
fn a_robot_that_does_not_need_its_camera_goes_on_without_it() {
    let mut rig = Rig::new(false);
    rig.port.plug(false);
    rig.pass(7.0);
    assert!(rig.signs.causes().is_empty(), "{}", rig.signs.causes());
    assert!(rig.health.line().contains("camera lost"));
    assert_eq!(rig.runs("detection"), 0);
}
