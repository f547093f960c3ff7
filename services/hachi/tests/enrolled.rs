//! `hachi people list`, `enrol`, `rename`, `export` and `forget` from outside.

mod program;

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use hachi_people::identify::AppearanceModel;
use hachi_store::people::{NetworkIdentity, NewPerson, PeopleFile, PeoplePaths};
use program::scenes::{frames_of, somebody};
use program::{Run, finished, hachi, names, recording, text};

/// `hachi people` with temporary files in a folder that the test looks into.
fn people(store: &Path, arguments: &[&str]) -> Run {
    let folder = store.parent().unwrap();
    let mut command = hachi();
    command.env("TMPDIR", folder).env("SQLITE_TMPDIR", folder);
    command.arg("people").args(arguments);
    finished(command.args(["--store", text(store)]).output().unwrap())
}

/// A store with somebody of this name, and the number of their model.
fn enrolled(store: &Path, name: &str, mean: f32) {
    let paths = PeoplePaths::beside(store);
    let network = NetworkIdentity {
        name: "osnet".to_owned(),
        sha256: [0xab; 32],
    };
    let mut file = PeopleFile::open_or_create(&paths).unwrap();
    file.enrol(&NewPerson {
        name,
        enrolled_unix_s: 1_700_000_000,
        network: &network,
        model: &AppearanceModel::first(&[mean, 0.25]).unwrap(),
        images: &[b"\x89PNG of them".to_vec(), b"\xFF\xD8 of them".to_vec()],
    })
    .unwrap();
}

#[test]
fn people_are_listed_renamed_exported_and_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("people.db");
    let nobody = people(&store, &["list", "--json"]).json();
    assert_eq!(nobody["people"].as_array().unwrap().len(), 0);
    assert!(!store.exists(), "to look makes no files");
    let failed = people(&store, &["forget", "Anna"]);
    assert!(failed.failure().contains("enrol somebody first"));

    enrolled(&store, "Anna", 0.5);
    enrolled(&store, "Berta", 0.75);
    people(&store, &["rename", "Anna", "Anna Unverwechselbar"]).success();
    let taken = people(&store, &["rename", "Berta", "Anna Unverwechselbar"]);
    assert!(taken.failure().contains("choose another name"));
    let unknown = people(&store, &["rename", "Anna", "Anni"]);
    assert!(unknown.failure().contains("hachi people list"));
    let listed = people(&store, &["list", "--json"]).json();
    let anna = &listed["people"][0];
    assert_eq!(anna["name"], "Anna Unverwechselbar");
    assert_eq!(
        (&anna["images"], &anna["network"]),
        (&2.into(), &"osnet".into())
    );
    assert_eq!(anna["network_sha256"], "ab".repeat(32));
    assert_eq!(anna["enrolled_unix_s"], 1_700_000_000);
    assert!(
        people(&store, &["list"])
            .success()
            .contains("2 pictures, model of osnet")
    );

    let out = folder.path().join("hers");
    let exported = ["export", "Anna Unverwechselbar", "--out", text(&out)];
    people(&store, &exported).success();
    assert_eq!(names(&out), ["001.png", "002.jpg", "person.json"]);
    let mode = std::fs::metadata(&out).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o700);
    assert_eq!(
        std::fs::read(out.join("001.png")).unwrap(),
        b"\x89PNG of them"
    );
    let person = std::fs::read(out.join("person.json")).unwrap();
    let person: serde_json::Value = serde_json::from_slice(&person).unwrap();
    assert_eq!(person["model"]["mean"], serde_json::json!([0.5, 0.25]));
    assert_eq!(person["name"], "Anna Unverwechselbar");

    std::fs::remove_dir_all(&out).unwrap();
    people(&store, &["forget", "Anna Unverwechselbar"]).success();
    for name in names(folder.path()) {
        let bytes = std::fs::read(folder.path().join(&name)).unwrap();
        let traces = [&b"Unverwechselbar"[..], b" of them"];
        let found = |trace: &&[u8]| bytes.windows(trace.len()).any(|window| window == *trace);
        assert!(!traces.iter().any(found), "{name}");
    }
    let listed = people(&store, &["list", "--json"]).json();
    assert_eq!(listed["people"].as_array().unwrap().len(), 1);
    assert_eq!(listed["remnants"], false);
    assert_eq!(people(&store, &["forget"]).status, 2);
    let none = people(&store, &["forget", "--unreadable", "--json"]).json();
    assert_eq!(none["forgotten"], 0);
}

#[test]
fn without_its_key_file_a_store_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("people.db");
    enrolled(&store, "Anna", 0.5);
    std::fs::rename(
        folder.path().join("people.key"),
        folder.path().join("other.key"),
    )
    .unwrap();
    let refused = people(&store, &["list"]);
    assert!(refused.failure().contains("restore the key file"));
    let other = folder.path().join("other.key");
    people(&store, &["list", "--key", text(&other)]).success();
}

/// Crops of a person in `reid_col780`.
fn crops(people: &Path, identity: &str) -> Vec<PathBuf> {
    let folder = people.join("reid_col780/train").join(identity);
    names(&folder)
        .iter()
        .map(|name| folder.join(name))
        .collect()
}

#[test]
fn a_person_is_enrolled_from_crops_and_is_known_by_the_model() {
    let Some(recordings) = recording("people") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("people.db");
    let crops = crops(&recordings, "001");
    let empty = folder.path().join("empty.jpg");
    std::fs::write(&empty, b"").unwrap();
    let mut arguments = vec!["enrol", "Anna", text(&empty), "--json"];
    arguments.extend(crops.iter().map(|crop| text(crop)));
    let enrolled = people(&store, &arguments).json();
    assert_eq!(enrolled["images_used"], crops.len());
    assert_eq!(enrolled["left_out"][0]["reason"], "the file is empty");
    assert_eq!(enrolled["network"], "osnet_x0_25_msmt17");
    let listed = people(&store, &["list", "--json"]).json();
    assert_eq!(
        listed["people"][0]["network_sha256"],
        enrolled["network_sha256"]
    );
    let out = folder.path().join("hers");
    people(&store, &["export", "Anna", "--out", text(&out)]).success();
    let written = pixels(&out.join("001.png"));
    assert_eq!(written, pixels(&crops[0]), "the crop as it was");

    // The same person under another name is said; a name twice is refused before the work.
    arguments[1] = "Hanna";
    let again = people(&store, &arguments).json();
    assert_eq!(again["alike"], serde_json::json!(["Anna"]));
    let twice = people(&store, &arguments);
    assert!(twice.failure().contains("Hanna"), "{}", twice.stderr);
    let few = people(&store, &["enrol", "Few", text(&crops[0]), text(&empty)]);
    let line = few.failure();
    assert!(
        line.contains("1 times, 9 are needed") && line.contains("empty.jpg"),
        "{line}"
    );
}

/// An image's size and pixels.
fn pixels(path: &Path) -> ::hachi::images::Rgb {
    ::hachi::images::read(path).unwrap()
}

#[test]
fn frames_with_more_than_one_person_are_no_pictures_of_anybody() {
    let Some(recordings) = recording("people") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir(&frames).unwrap();
    let crowd = recordings.join("MOT17-mini/train/MOT17-04-FRCNN/img1/000001.jpg");
    std::fs::copy(crowd, frames.join("1.jpg")).unwrap();
    let store = folder.path().join("people.db");
    let failed = people(&store, &["enrol", "Anna", text(&frames)]);
    let line = failed.failure();
    assert!(
        line.contains("people are in it") && line.contains("of them alone"),
        "{line}"
    );
}

#[test]
fn a_person_in_front_of_the_simulated_robot_is_enrolled_with_nothing_installed() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir(&frames).unwrap();
    frames_of(&somebody(), &frames);
    let store = folder.path().join("people.db");
    let networks = ["--detector", "own:detector", "--reid", "own:reid"];
    let arguments = ["enrol", "Walker", text(&frames), "--json"];
    let enrolled = people(&store, &[&arguments[..], &networks].concat()).json();
    assert!(
        enrolled["images_used"].as_u64().unwrap() >= 12,
        "{enrolled}"
    );
    assert_eq!(enrolled["network"], "own:reid");
    let listed = people(&store, &["list", "--json"]).json();
    assert_eq!(
        listed["people"][0]["network_sha256"],
        enrolled["network_sha256"]
    );
    // What is kept shows them and little else: red above blue.
    let out = folder.path().join("theirs");
    people(&store, &["export", "Walker", "--out", text(&out)]).success();
    let crop = pixels(&out.join("001.png"));
    assert!(crop.height > crop.width, "{} x {}", crop.width, crop.height);
    let middle = |share: usize| {
        let at = 3 * (crop.height * share / 10 * crop.width + crop.width / 2);
        [crop.pixels[at], crop.pixels[at + 1], crop.pixels[at + 2]]
    };
    let (top, trousers) = (middle(3), middle(7));
    assert!(top[0] > top[2], "{top:?}");
    assert!(trousers[2] > trousers[0], "{trousers:?}");
}
