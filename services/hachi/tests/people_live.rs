//! A running service that is told who its person is: over HTTP, by the command line, with the program's
//! own networks, against the renderer's truth. The service runs in virtual time, its page for real.

mod program;

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
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
use hachi_store::people::{PeopleFile, PeoplePaths};
use hachi_world::{CameraConfig, Outfit, Person, PersonTruth, Preset, SimulationConfig, Visit};
use program::scenes::somebody;
use program::{Run, finished, hachi as command};
use serde_json::{Value, json};

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
fn logged() -> String {
    String::from_utf8(LOG.lock().unwrap().clone()).unwrap()
}

/// A service with a camera, and its page.
struct Rig {
    run: VirtualTime,
    port: SimulatedPort,
    seen: SeenPeople,
    start: Stamp,
    now: Stamp,
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    server: Option<std::thread::JoinHandle<()>>,
}

impl Rig {
    /// One before whose camera these people are about; it looks for them if it has a store.
    fn new(people: Vec<Person>, store: Option<&Path>) -> Self {
        Self::with(people, store, Duration::from_secs(60), None)
    }

    /// One that waits so long for an order, and has so many bytes of room in its store.
    fn with(
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

    fn pass_ns(&mut self, ns: i64) {
        self.now = self.now + ns;
        self.run.run_until(self.now);
    }

    fn pass(&mut self, seconds: f64) {
        self.pass_ns((seconds * 1e9) as i64);
    }

    /// Until so many seconds after the beginning.
    fn pass_until(&mut self, seconds: f64) {
        let left = seconds - self.now.secs_since(self.start);
        assert!(left > 0.0, "it took {left} s longer than the test has");
        self.pass(left);
    }

    /// What somebody else gets who asks while the service goes on.
    fn meanwhile<T: Send>(&mut self, ask: impl FnOnce() -> T + Send) -> T {
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
    fn post(&mut self, path: &str, body: &Value) -> (u16, Value) {
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

    fn people(&self) -> Value {
        let request = "GET /people HTTP/1.1\r\nHost: localhost\r\n\r\n";
        let (status, body) = exchange(self.address, request.as_bytes());
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    /// `hachi people` while the service goes on.
    fn command(&mut self, arguments: &[&str]) -> Run {
        let address = self.address.to_string();
        let mut command = command();
        command.arg("people").args(arguments);
        command.args(["--address", &address]);
        finished(self.meanwhile(|| command.output().unwrap()))
    }

    /// Who is truly in the last picture.
    fn truth(&self, people: &Value) -> Vec<PersonTruth> {
        let stamp = people["picture"]["stamp_ns"].as_i64().unwrap();
        self.seen.at(Stamp::from_nanos(stamp)).unwrap()
    }

    /// Where a user points who means somebody.
    fn place_of(&self, who: u32) -> Value {
        let people = self.people();
        json!({ "at": pointed_at(&self.truth(&people), who).unwrap() })
    }

    /// Whether whom the robot is thought to know by a number is truly this person.
    fn is_on(&self, number: &Value, who: u32) -> Followed {
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

fn order(path: &str, body: &str) -> String {
    format!(
        "POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

/// Status and body of the answer to some bytes.
fn exchange(address: SocketAddr, request: &[u8]) -> (u16, String) {
    let mut link = TcpStream::connect(address).unwrap();
    link.write_all(request).unwrap();
    let mut answer = String::new();
    link.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    (status, body.to_owned())
}

/// Somebody in red and blue who comes to the robot, stands before it, and comes back much later.
fn anna() -> Person {
    let mut person = somebody();
    let first = &mut person.visits[0];
    first.path = vec![[4.4, 0.0], [3.2, 0.0]];
    first.stays_s = 17.0;
    let again = Visit {
        begins_s: 23.0,
        path: vec![[7.0, 0.5], [3.2, 0.3]],
        speed_m_s: 1.0,
        stays_s: 60.0,
        ..first.clone()
    };
    person.visits.push(again);
    person
}

/// Somebody in green who stands there, from then on.
fn berta(at: [f64; 2], from_s: f64) -> Person {
    Person {
        id: 2,
        height_m: 1.7,
        visits: vec![Visit {
            begins_s: from_s,
            path: vec![at],
            speed_m_s: 0.5,
            stays_s: 600.0,
            outfit: Outfit {
                top: [44, 122, 62],
                trousers: [150, 128, 92],
                shoes: [212, 210, 206],
            },
        }],
        ..somebody()
    }
}

fn store() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("people.db");
    (folder, store)
}

#[test]
fn whoever_is_picked_by_place_or_by_track_is_followed_until_they_are_released() {
    let (_folder, store) = store();
    let mut person = somebody();
    person.visits[0].path = vec![[4.0, -0.6], [4.4, -0.6]];
    let mut rig = Rig::new(vec![person, berta([4.2, 0.7], 0.0)], Some(&store));
    rig.pass(2.0);
    assert_eq!(rig.people()["known"], json!([]));

    let (status, berta) = rig.post("/people/pick", &rig.place_of(2));
    assert_eq!((status, &berta["known"]), (200, &json!(false)), "{berta}");
    rig.pass(1.0);
    assert_eq!(rig.is_on(&berta["person"], 2), Followed::Right);

    // Somebody else, by the number of their track; who was only picked before is nobody any more.
    let people = rig.people();
    let others = people["in_view"].as_array().unwrap().iter();
    let other = others
        .map(|seen| &seen["track"])
        .find(|track| **track != berta["track"]);
    let track = other.unwrap().to_string();
    let anna = rig.command(&["pick", "--track", &track, "--json"]).json();
    rig.pass(1.0);
    assert_eq!(rig.is_on(&anna["person"], 1), Followed::Right);
    let known = rig.people()["known"].clone();
    assert_eq!(known.as_array().unwrap().len(), 1, "{known}");
    assert_eq!(
        (&known[0]["picked"], &known[0]["name"]),
        (&json!(true), &Value::Null)
    );
    assert_eq!(known[0]["condition"], "SEEN");
    // Once more, by a place: it is the same person.
    let (_, again) = rig.post("/people/pick", &rig.place_of(1));
    assert_eq!(
        (&again["person"], &again["known"]),
        (&anna["person"], &json!(true))
    );

    let (status, refused) = rig.post("/people/pick", &json!({ "track": 4_000 }));
    assert_eq!(status, 404);
    assert!(
        refused["error"]
            .as_str()
            .unwrap()
            .contains("no such track any more")
    );
    let (status, refused) = rig.post("/people/pick", &json!({ "at": [3.0, 3.0] }));
    assert_eq!(status, 404);
    assert!(
        refused["error"]
            .as_str()
            .unwrap()
            .contains("nobody is there")
    );
    let failed = rig.command(&["pick", "--at", "3,3"]);
    assert!(failed.failure().contains("point at the middle of somebody"));
    let table = rig.command(&["watch", "--once"]);
    assert!(
        table.success().contains("the robot's person"),
        "{}",
        table.stdout
    );

    let (status, released) = rig.post("/people/release", &json!({}));
    assert_eq!((status, &released["released"]), (200, &anna["person"]));
    rig.pass(0.3);
    assert_eq!(rig.people()["known"], json!([]));
    assert_eq!(
        rig.command(&["release", "--json"]).json()["released"],
        Value::Null
    );
}

#[test]
fn whoever_is_enrolled_in_front_of_the_robot_is_known_by_name_when_they_come_back() {
    let (_folder, store) = store();
    let mut rig = Rig::new(vec![anna(), berta([5.5, 1.2], 19.5)], Some(&store));
    rig.pass(2.5);
    let (_, picked) = rig.post("/people/pick", &rig.place_of(1));
    let enrolled = rig.command(&["enrol", "Anna", "--live", "--json"]).json();
    assert_eq!(enrolled["images_used"], 30);
    let number = &enrolled["person"];
    assert_eq!(
        number, &picked["person"],
        "who was picked keeps their number"
    );
    let people = rig.people();
    assert_eq!(people["enrolment"]["stage"], "done");
    assert_eq!(people["known"][0]["name"], "Anna");
    assert_eq!(rig.is_on(number, 1), Followed::Right);
    // Model and crops are in the store, readable to whoever has its key.
    let paths = PeoplePaths::beside(&store);
    let mut file = PeopleFile::open_or_create(&paths).unwrap();
    let entry = file.find("Anna").unwrap();
    assert_eq!(entry.images, 30);
    let crop = hachi::images::decode(&file.images(&entry).unwrap().images[0]).unwrap();
    assert!(crop.height > crop.width, "{} x {}", crop.width, crop.height);
    let taken = rig.command(&["enrol", "Anna", "--live"]);
    assert!(taken.failure().contains("choose another name"));

    // Gone; somebody else is there meanwhile.
    rig.pass_until(22.5);
    let known = rig.people()["known"][0].clone();
    assert_eq!(
        (&known["condition"], &known["track"]),
        (&json!("SEARCHING"), &Value::Null)
    );
    rig.pass_until(27.5);
    let known = rig.people()["known"][0].clone();
    assert_eq!(
        (&known["name"], &known["number"]),
        (&json!("Anna"), number),
        "{known}"
    );
    assert_eq!(rig.is_on(number, 1), Followed::Right, "{known}");

    // She is known, so that picking her by place says so; and forgotten, she is nobody.
    let (_, picked) = rig.post("/people/pick", &rig.place_of(1));
    assert_eq!(
        (&picked["person"], &picked["known"]),
        (number, &json!(true))
    );
    file.forget(&entry).unwrap();
    rig.pass(1.5);
    assert_eq!(rig.people()["known"], json!([]));

    // All of that is in the log, and nobody's name.
    let log = logged();
    for line in [
        "order=\"/people/enrol\" answer=Ok(Begun(1))",
        "stage=Done",
        "answer=Ok(Picked",
    ] {
        assert!(log.contains(line), "{line}");
    }
    assert!(!log.contains("Anna"));
}

#[test]
fn an_enrolment_is_refused_cancelled_and_fails_without_a_trace() {
    let (_folder, store) = store();
    let mut person = somebody();
    person.visits[0].path = vec![[4.0, 0.5]];
    let people = vec![person, berta([4.0, -0.5], 16.0)];
    let mut rig = Rig::with(people, Some(&store), Duration::from_secs(60), Some(1));
    let anna = json!({ "name": "Anna" });
    let (status, refused) = rig.post("/people/enrol", &json!({ "name": " " }));
    assert_eq!(status, 422, "{refused}");
    rig.pass(2.0);
    let (status, begun) = rig.post("/people/enrol", &anna);
    assert_eq!((status, &begun["wanted"]), (202, &json!(30)));
    let (status, refused) = rig.post("/people/enrol", &anna);
    assert_eq!(status, 409, "{refused}");
    assert!(
        refused["error"]
            .as_str()
            .unwrap()
            .contains("cancel that first")
    );
    rig.pass(1.0);
    let enrolment = rig.people()["enrolment"].clone();
    assert_eq!(enrolment["stage"], "taking");
    assert!(enrolment["taken"].as_u64().unwrap() >= 3, "{enrolment}");
    let (status, cancelled) = rig.post("/people/cancel", &json!({}));
    assert_eq!((status, &cancelled["cancelled"]), (200, &json!(true)));
    let (_, cancelled) = rig.post("/people/cancel", &json!({}));
    assert_eq!(cancelled["cancelled"], false);
    // All looks are taken, and there is no room for them.
    let failed = rig.command(&["enrol", "Anna", "--live"]);
    let line = failed.failure();
    assert!(
        line.contains("no room to write") && line.contains("free some space"),
        "{line}"
    );
    assert_eq!(rig.people()["known"], json!([]));
    rig.pass_until(18.0);
    let refused = rig.command(&["enrol", "Anna", "--live"]);
    assert!(
        refused.failure().contains("2 people stand in front"),
        "{}",
        refused.stderr
    );
    let file = PeopleFile::open_or_create(&PeoplePaths::beside(&store)).unwrap();
    assert_eq!(file.list().unwrap(), Default::default());
}

#[test]
fn what_is_no_order_or_comes_from_elsewhere_is_refused_with_what_to_do() {
    let mut rig = Rig::new(Vec::new(), None);
    let refused = |request: &str, status: u16, what: &str| {
        let (got, body) = exchange(rig.address, request.as_bytes());
        assert!(
            got == status && body.contains(what),
            "{got} {body}: {request}"
        );
    };
    let release = order("/people/release", "{}");
    let json = "application/json";
    refused(&release, 503, "people.enabled = true");
    refused(
        "GET /people HTTP/1.1\r\nHost: localhost\r\n\r\n",
        503,
        "people.enabled = true",
    );
    refused(
        "GET /people HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        403,
        "127.0.0.1",
    );
    refused(&release.replace(json, "text/plain"), 415, json);
    refused(
        &release.replace("Host: 127.0.0.1", "Host: evil.example"),
        403,
        "127.0.0.1",
    );
    let origin = "Host: 127.0.0.1\r\nOrigin: http://evil.example";
    refused(&release.replace("Host: 127.0.0.1", origin), 403, "web page");
    refused(
        &order("/people/release", &" ".repeat(5_000)),
        413,
        "4096 bytes",
    );
    refused(
        "OPTIONS /people/pick HTTP/1.1\r\nHost: localhost\r\n\r\n",
        405,
        "GET and POST",
    );
    refused(&release.replace("/people/release", "/tasks"), 405, "GET");
    refused("\0\0\0\0\r\n\r\n", 400, "no HTTP");
    refused("GET /nonsense HTTP/1.1\r\n\r\n", 404, "/people");
    // One that comes drop by drop is left after a second, whole or not.
    let begun = std::time::Instant::now();
    refused("POST /people/pick HTTP/1.1\r\nContent-Le", 408, "1000 ms");
    assert!(begun.elapsed() < Duration::from_secs(3));
    let failed = rig.command(&["watch", "--once"]);
    assert!(failed.failure().contains("people.enabled = true"));
}

#[test]
fn orders_are_checked_and_rated_and_one_that_no_picture_carries_out_is_withdrawn() {
    let (_folder, store) = store();
    let person = berta([3.5, 0.0], 0.0);
    let mut rig = Rig::with(vec![person], Some(&store), Duration::from_millis(300), None);
    let address = rig.address;
    for (path, body, status) in [
        ("/people/pick", "{\"track\": 3", 400),
        ("/people/pick", "{\"trakc\": 3}", 400),
        ("/people/pick", "{\"track\": -3}", 400),
        ("/people/pick", "{\"at\": [1e999, 3]}", 400),
        ("/people/pick", "{\"at\": [1e9, 3]}", 422),
        ("/people/pick", "{\"at\": [1, 3], \"track\": 3}", 422),
        ("/people/pick", "{}", 422),
        ("/people/enrol", "{\"name\": \"\\u0007\"}", 422),
        ("/people/enrol", "[]", 400),
        ("/people/release", "{\"now\": true}", 400),
        ("/people/follow", "{}", 404),
    ] {
        let (got, said) = exchange(address, order(path, body).as_bytes());
        let said: Value = serde_json::from_str(&said).unwrap();
        assert_eq!(got, status, "{path} {body}: {said}");
        assert!(said["error"].as_str().unwrap().len() > 20, "{said}");
    }
    // The camera is pulled out: nothing carries out an order, and nothing does later.
    rig.pass(2.0);
    rig.port.plug(false);
    rig.pass(0.5);
    let (status, said) = rig.post("/people/pick", &json!({ "at": [212, 150] }));
    assert_eq!(status, 503, "{said}");
    assert!(
        said["error"].as_str().unwrap().contains("withdrawn"),
        "{said}"
    );
    assert!(rig.people()["picture"]["age_s"].as_f64().unwrap() > 0.5);
    rig.port.plug(true);
    rig.pass(3.0);
    assert_eq!(rig.people()["known"], json!([]));
    // With nobody to carry them out they fill the queue, and then they come too fast.
    let release = order("/people/release", "{}");
    let answers: Vec<_> = (0..14)
        .map(|_| exchange(address, release.as_bytes()))
        .collect();
    let said = |status: u16, what: &str| {
        let is = |answer: &(u16, String)| answer.0 == status && answer.1.contains(what);
        answers.iter().any(is)
    };
    assert!(said(503, "too many orders wait"), "{answers:?}");
    assert!(said(429, "two a second"), "{answers:?}");
    let failed = command()
        .args(["people", "release", "--address", "127.0.0.1:1"])
        .output();
    assert!(finished(failed.unwrap()).failure().contains("hachi run"));
}
