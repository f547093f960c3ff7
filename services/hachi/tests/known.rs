//! Somebody whom `hachi people enrol` put into the store is known to the eyes that `hachi run` opens:
//! the program's own networks, the whole service in virtual time, the renderer's truth.

mod program;

use std::path::Path;
use std::sync::{Arc, Mutex};

use hachi::config::{MotionInput, Settings};
use hachi::people_truth::{followed, sight};
use hachi::service::eyes;
use hachi::service::messages::Looked;
use hachi::service::settings::Platform;
use hachi::service::simulated::{Besides, WatchedCamera, connect};
use hachi::service::simulator::SeenPeople;
use hachi::service::tracking::Audience;
use hachi::service::wiring::{Running, Watcher};
use hachi_datagram::SystemClock;
use hachi_hal::Stamp;
use hachi_people::followed::{Followed, ScoreKeeper, Sight};
use hachi_people::identify::Condition;
use hachi_people::watch::Watch;
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_runtime::VirtualClock;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_slam::{MemoryStore, Slam};
use hachi_world::{CameraConfig, Outfit, Person, Preset, SimulationConfig, Visit};
use program::scenes::{frames_of, somebody};
use program::{run, text};

/// From a picture to the next, ns.
const PERIOD_NS: i64 = 400_000_000;

/// A store that the command made, with one person in it.
fn enrol(person: &Person, store: &Path) {
    let frames = store.with_file_name("frames");
    std::fs::create_dir(&frames).unwrap();
    frames_of(person, &frames);
    let networks = ["--detector", "own:detector", "--reid", "own:reid"];
    let arguments = ["people", "enrol", "Walker", text(&frames), "--store"];
    run(&[&arguments[..], &[text(store)], &networks].concat()).success();
}

/// What the service said of its person in a picture, and what was true.
struct Moment {
    condition: Condition,
    followed: Followed,
    sight: Sight,
    others: usize,
}

/// Keeps book.
struct Witness {
    seen: SeenPeople,
    moments: Arc<Mutex<Vec<Moment>>>,
    person: u32,
}

impl Audience for Witness {
    fn see(&mut self, looked: &Looked, watch: &Watch) -> Option<[f64; 2]> {
        let people = self.seen.at(looked.picture.stamp).unwrap();
        let columns = looked.picture.width as u32;
        let clear = |id| {
            let person = people.iter().find(|person| person.id == id);
            sight(person, columns)
        };
        // The store is read beside the pictures: nobody is known for the first ones.
        if let Some(status) = watch.statuses().next() {
            let found = watch.followed(status.person);
            let found = found.map(|track| track.bounding_box());
            self.moments.lock().unwrap().push(Moment {
                condition: status.condition,
                followed: followed(found, &people, self.person),
                sight: clear(self.person),
                others: people
                    .iter()
                    .filter(|other| other.id != self.person && clear(other.id) == Sight::Clear)
                    .count(),
            });
        }
        None
    }
}

/// What the service makes of so many seconds in which these people are about.
fn watched(store: &Path, people: Vec<Person>, seconds: f64) -> Vec<Moment> {
    let mut settings = Settings::load(Some("b1"), None).unwrap();
    settings.motion = MotionInput::Odometry;
    settings.people.enabled = true;
    settings.people.detector = Some("own:detector".into());
    settings.people.reid = Some("own:reid".into());
    settings.people.store = Some(store.to_owned());
    // No camera has this number: the pictures come from the renderer.
    settings.camera.serial = Some("none".to_owned());
    let eyes = eyes::of_this_computer(&settings, SystemClock::new()).unwrap();
    assert!(!eyes.model_missing);
    let watcher = eyes.people.expect("networks that the program brings along");
    assert!(watcher.kept.is_some());

    let mut world = SimulationConfig::preset(Preset::Office, 2, f64::MAX);
    world.base_from_lidar = settings.base_from_lidar.pose();
    world.people = people.into();
    let camera = CameraConfig {
        period_ns: PERIOD_NS,
        ..CameraConfig::d455(424, 240, 0.2)
    };
    let (seen, moments) = (SeenPeople::default(), Arc::default());
    let witness = Witness {
        seen: seen.clone(),
        moments: Arc::clone(&moments),
        person: 1,
    };
    let watched = WatchedCamera {
        port: SimulatedPort::new(camera.geometry),
        camera,
        watcher: Watcher {
            audience: Some(Box::new(witness)),
            ..watcher
        },
        seen,
    };
    let clock = VirtualClock::starting_at(world.start);
    let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
    let (service, _) = connect(
        &settings,
        &Platform::of_name("b1").unwrap(),
        &world,
        &clock,
        Running::VirtualTime,
        (slam, None),
        Besides {
            camera: Some(watched),
            ..Besides::default()
        },
    )
    .unwrap();
    let end: Stamp = world.start + (seconds * 1e9) as i64;
    let mut run = VirtualTime::new(service.table, clock);
    run.run_until(end);
    drop(run);
    std::mem::take(&mut *moments.lock().unwrap())
}

/// Somebody in other clothes, about from the beginning.
fn stranger() -> Person {
    Person {
        id: 2,
        height_m: 1.7,
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![[6.0, -0.5], [4.5, -0.5]],
            speed_m_s: 0.5,
            stays_s: 60.0,
            outfit: Outfit {
                top: [44, 122, 62],
                trousers: [150, 128, 92],
                shoes: [212, 210, 206],
            },
        }],
        ..somebody()
    }
}

/// The person enrolled, who comes along the corridor later.
fn comes(from_s: f64) -> Person {
    let mut person = somebody();
    let visit = &mut person.visits[0];
    visit.begins_s = from_s;
    visit.path = vec![[9.0, 0.5], [3.2, 0.5]];
    visit.speed_m_s = 1.0;
    person
}

#[test]
fn whoever_was_enrolled_is_known_when_they_come_and_nobody_else_is() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("people.db");
    enrol(&somebody(), &store);
    let moments = watched(&store, vec![comes(5.0), stranger()], 13.0);

    let mut score = ScoreKeeper::new();
    for moment in &moments {
        score.step(PERIOD_NS as f64 * 1e-9, moment.sight, moment.followed);
    }
    let score = score.finish();
    // The stranger is there all the while, alone at first.
    let alone = |moment: &&Moment| moment.sight == Sight::None && moment.others == 1;
    assert!(moments.iter().filter(alone).count() >= 8);
    assert_eq!(score.wrong_s, 0.0, "{score:?}");
    assert!(score.visible_s > 5.0, "{score:?}");
    assert!(score.tracked_share() > 0.7, "{score:?}");
    let last = moments.last().unwrap();
    assert_eq!(last.followed, Followed::Right);
    assert!(matches!(last.condition, Condition::Seen | Condition::Found));
}
