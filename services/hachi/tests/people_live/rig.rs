//! A service with a simulated camera in virtual time, and its page for real: what a user does to it, what it
//! says, and who is truly in view.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once};
use std::time::Duration;

use hachi::config::{MotionInput, Settings};
use hachi::people_truth::{followed, pointed_at};
use hachi::service::eyes;
use hachi::service::settings::Platform;
use hachi::service::simulated::{Besides, WatchedCamera, connect};
use hachi::service::simulator::SeenPeople;
use hachi::service::web::people::PeoplePage;
use hachi::service::web::{self, Page};
use hachi::service::wiring::Running;
use hachi_datagram::SystemClock;
use hachi_hal::Stamp;
use hachi_people::BoundingBox;
use hachi_people::followed::Followed;
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_runtime::VirtualClock;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_slam::{MemoryStore, Slam};
use hachi_world::{CameraConfig, Person, PersonTruth, Preset, SimulationConfig};
use serde_json::{Value, json};

use crate::program::{Run, finished, hachi as command};

const MS: i64 = 1_000_000;
/// From a picture to the next.
const PERIOD_NS: i64 = 250 * MS;
/// A step of virtual time while somebody waits for an answer.
const STEP_NS: i64 = 50 * MS;

/// Everything that is logged in this process.
static LOG: Mutex<Vec<u8>> = Mutex::new(Vec::new());

struct Log;

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        LOG.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn keep_the_log() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        tracing_subscriber::fmt()
            .with_ansi(false)
            .with_max_level(tracing::Level::TRACE)
            .with_writer(|| Log)
            .init();
    });
}

/// What was logged so far.
pub fn logged() -> String {
    String::from_utf8(LOG.lock().unwrap().clone()).unwrap()
}

/// A service with a camera, and its page.
pub struct Rig {
    run: VirtualTime,
    pub port: SimulatedPort,
    seen: SeenPeople,
    start: Stamp,
    now: Stamp,
    pub address: SocketAddr,
    stop: Arc<AtomicBool>,
    server: Option<std::thread::JoinHandle<()>>,
}

impl Rig {
    /// One before whose camera these people are about; it looks for them if it has a store.
    pub fn new(people: Vec<Person>, store: Option<&Path>) -> Self {
        Self::with(people, store, Duration::from_secs(60), None)
    }

    /// One that waits so long for an order, and has so many bytes of room in its store.
    pub fn with(
        people: Vec<Person>,
        store: Option<&Path>,
        patience: Duration,
        room: Option<u64>,
    ) -> Self {
        keep_the_log();
        let mut settings = Settings::load(Some("b1"), None).unwrap();
        settings.motion = MotionInput::Odometry;
        settings.people.enabled = store.is_some();
        settings.people.detector = Some("own:detector".into());
        settings.people.reid = Some("own:reid".into());
        settings.people.store = store.map(Path::to_owned);
        // No camera has this number: the pictures come from the renderer.
        settings.camera.serial = Some("none".to_owned());
        let eyes = eyes::of_this_computer(&settings, SystemClock::new());
        if let (Some(eyes), Some(room)) = (&eyes, room) {
            let kept = eyes.people.as_ref().and_then(|people| people.kept.as_ref());
            kept.unwrap().store.set_quota(room).unwrap();
        }

        let mut world = SimulationConfig::preset(Preset::Office, 2, f64::MAX);
        world.base_from_lidar = settings.base_from_lidar.pose();
        world.people = people.into();
        let camera = CameraConfig {
            period_ns: PERIOD_NS,
            ..CameraConfig::d455(424, 240, 0.2)
        };
        let (seen, port) = (SeenPeople::default(), SimulatedPort::new(camera.geometry));
        let watched = eyes
            .and_then(|eyes| eyes.people)
            .map(|watcher| WatchedCamera {
                port: port.clone(),
                camera,
                watcher,
                seen: seen.clone(),
            });
        let clock = VirtualClock::starting_at(world.start);
        let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
        let besides = Besides {
            camera: watched,
            ..Besides::default()
        };
        let platform = Platform::of_name("b1").unwrap();
        let running = Running::VirtualTime;
        let (service, _) = connect(
            &settings,
            &platform,
            &world,
            &clock,
            running,
            (slam, None),
            besides,
        )
        .unwrap();
        let health = service.table.health().clone();
        let run = VirtualTime::new(service.table, clock);
        let mut page = Page {
            platform: "B1".to_owned(),
            telemetry: Arc::clone(run.telemetry()),
            health,
            signs: service.signs,
            people: PeoplePage::new(service.people).with_patience(patience),
        };
        let listener = web::listen((Ipv4Addr::LOCALHOST, 0).into()).unwrap();
        let address = listener.local_addr().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let server = std::thread::spawn(move || web::serve(&listener, &mut page, &stopped));
        Self {
            run,
            port,
            seen,
            start: world.start,
            now: world.start,
            address,
            stop,
            server: Some(server),
        }
    }

    pub fn pass_ns(&mut self, ns: i64) {
        self.now = self.now + ns;
        self.run.run_until(self.now);
    }

    pub fn pass(&mut self, seconds: f64) {
        self.pass_ns((seconds * 1e9) as i64);
    }

    /// Until so many seconds after the beginning.
    pub fn pass_until(&mut self, seconds: f64) {
        let left = seconds - self.now.secs_since(self.start);
        assert!(left > 0.0, "it took {left} s longer than the test has");
        self.pass(left);
    }

    /// What somebody else gets who asks while the service goes on.
    pub fn meanwhile<T: Send>(&mut self, ask: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| {
            let asking = scope.spawn(ask);
            while !asking.is_finished() {
                self.pass_ns(STEP_NS);
            }
            asking.join().unwrap()
        })
    }

    /// An order, as `curl -H 'Content-Type: application/json' -d` gives it. Where they come too fast it
    /// is given again, as its answer says.
    pub fn post(&mut self, path: &str, body: &Value) -> (u16, Value) {
        let (address, request) = (self.address, order(path, &body.to_string()));
        self.meanwhile(|| {
            loop {
                let (status, body) = exchange(address, request.as_bytes());
                if status != 429 {
                    return (status, serde_json::from_str(&body).unwrap());
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        })
    }

    pub fn people(&self) -> Value {
        let request = "GET /people HTTP/1.1\r\nHost: localhost\r\n\r\n";
        let (status, body) = exchange(self.address, request.as_bytes());
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    /// `hachi people` while the service goes on.
    pub fn command(&mut self, arguments: &[&str]) -> Run {
        let address = self.address.to_string();
        let mut command = command();
        command.arg("people").args(arguments);
        command.args(["--address", &address]);
        finished(self.meanwhile(|| command.output().unwrap()))
    }

    /// Who is truly in the last picture.
    pub fn truth(&self, people: &Value) -> Vec<PersonTruth> {
        let stamp = people["picture"]["stamp_ns"].as_i64().unwrap();
        self.seen.at(Stamp::from_nanos(stamp)).unwrap()
    }

    /// Where a user points who means somebody.
    pub fn place_of(&self, who: u32) -> Value {
        let people = self.people();
        json!({ "at": pointed_at(&self.truth(&people), who).unwrap() })
    }

    /// Whether whom the robot is thought to know by a number is truly this person.
    pub fn is_on(&self, number: &Value, who: u32) -> Followed {
        let people = self.people();
        let known = people["known"].as_array().unwrap();
        let known = known.iter().find(|k| k["number"] == *number).unwrap();
        let in_view = people["in_view"].as_array().unwrap();
        let on = in_view.iter().find(|seen| seen["track"] == known["track"]);
        let bounding_box = on.map(|seen| {
            let edge = |key: &str| seen["box"][key].as_f64().unwrap();
            BoundingBox::new(edge("left"), edge("top"), edge("width"), edge("height"))
        });
        followed(bounding_box, &self.truth(&people), who)
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}

pub fn order(path: &str, body: &str) -> String {
    format!(
        "POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

/// Status and body of the answer to some bytes.
pub fn exchange(address: SocketAddr, request: &[u8]) -> (u16, String) {
    let mut link = TcpStream::connect(address).unwrap();
    link.write_all(request).unwrap();
    let mut answer = String::new();
    link.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, body.to_owned())
}
