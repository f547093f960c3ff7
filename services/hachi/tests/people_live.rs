//! A running service that is told who its person is: over HTTP, by the command line, with the program's
//! own networks, against the renderer's truth. The service runs in virtual time, its page for real.

mod program;

#[path = "people_live/rig.rs"]
mod rig;

use std::path::PathBuf;
use std::time::Duration;

use hachi_people::followed::Followed;
use hachi_store::people::{PeopleFile, PeoplePaths};
use hachi_world::{Outfit, Person, Visit};
use program::scenes::somebody;
use program::{finished, hachi as command};
use rig::{Rig, exchange, logged, order};
use serde_json::{Value, json};

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
