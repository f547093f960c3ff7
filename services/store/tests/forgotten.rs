//! After `forget` nothing of a person is left in any file: every byte is looked at.

mod support;

use std::path::Path;
use std::time::Duration;

use hachi_store::people::{PeopleError, PeopleFile, PeoplePaths, PersonEntry};
use support::{enrol, feature, found_in, images, model, network, open, paths, sealed};

/// What would give a person away as it is: name, numbers of their features and model, pictures.
fn plain(seed: u64, name: &str) -> Vec<Vec<u8>> {
    let mut traces = vec![name.as_bytes().to_vec()];
    let statistics = model(seed).statistics();
    for numbers in [&feature(seed), &statistics.mean, &statistics.variance] {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        traces.extend(bytes.chunks_exact(12).map(<[u8]>::to_vec));
    }
    for image in images(seed, 6) {
        traces.extend(image.chunks_exact(16).map(<[u8]>::to_vec));
    }
    traces
}

/// Whoever is stored and was not before.
fn newcomer(paths: &PeoplePaths, before: &[(i64, Vec<u8>)]) -> i64 {
    let mut numbers = sealed(paths).into_iter().map(|(person, _)| person);
    let new = |person: &i64| before.iter().all(|(other, _)| other != person);
    numbers.find(new).unwrap()
}

/// A person's number, key, and sealed bytes in pieces.
fn hidden(paths: &PeoplePaths, number: i64) -> Vec<Vec<u8>> {
    let mut traces = Vec::new();
    for (_, bytes) in sealed(paths).iter().filter(|(person, _)| *person == number) {
        // A page of the file ends anywhere within: pieces short enough to lie within one somewhere.
        traces.extend(bytes.chunks_exact(16).map(<[u8]>::to_vec));
    }
    let keys = std::fs::read_to_string(&paths.key).unwrap();
    let line = keys.lines().find(|l| l.starts_with(&format!("{number} ")));
    traces.push(line.unwrap().split_once(' ').unwrap().1.as_bytes().to_vec());
    traces.push(number.to_be_bytes().to_vec());
    traces.push(number.to_string().into_bytes());
    traces
}

/// How many of these are in any file.
fn left(folder: &Path, traces: &[Vec<u8>]) -> usize {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        all.extend(std::fs::read(entry.unwrap().path()).unwrap());
        all.extend([0; 32]);
    }
    let mut windows = std::collections::HashMap::<usize, std::collections::HashSet<&[u8]>>::new();
    let lengths: std::collections::BTreeSet<usize> = traces.iter().map(Vec::len).collect();
    for length in lengths {
        windows.insert(length, all.windows(length).collect());
    }
    let there = |trace: &&Vec<u8>| windows[&trace.len()].contains(trace.as_slice());
    traces.iter().filter(there).count()
}

/// Berta among others, her model saved and her pictures added to again and again.
fn with_berta(paths: &PeoplePaths) -> (PeopleFile, PersonEntry, Vec<Vec<u8>>) {
    let mut store = open(paths);
    enrol(&mut store, "Anna", 1, 6).unwrap();
    let before = sealed(paths);
    let berta = enrol(&mut store, "Berta Unverwechselbar", 2, 6).unwrap();
    let number = newcomer(paths, &before);
    let mut traces = hidden(paths, number);
    for round in 0..20 {
        store
            .save_model(&berta, &network("osnet"), &model(2))
            .unwrap();
        store.add_images(&berta, &images(2, 1)).unwrap();
        if round % 10 == 0 {
            traces.extend(hidden(paths, number));
            enrol(&mut store, &format!("other {round}"), 30 + round, 3).unwrap();
        }
    }
    (store, berta, traces)
}

#[test]
fn nothing_of_a_forgotten_person_is_left_in_any_file() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let (mut store, berta, hidden) = with_berta(&paths);
    let plain = plain(2, "Berta Unverwechselbar");
    assert_eq!(left(folder.path(), &plain), 0, "kept in plain text");
    let there = left(folder.path(), &hidden);
    assert!(there > 1_000, "{there} of {} found", hidden.len());
    assert!(
        !found_in(folder.path(), &hidden[0]).is_empty(),
        "found one by one too"
    );

    store.forget(&berta).unwrap();
    assert!(!store.has_remnants().unwrap());
    // While the store is open: the log and its index are looked at too.
    assert!(folder.path().join("people.db-wal").exists());
    assert_eq!(left(folder.path(), &hidden), 0);
    assert_eq!(left(folder.path(), &plain), 0);
    drop(store);
    assert_eq!(left(folder.path(), &hidden), 0);

    let store = open(&paths);
    let known = store.list().unwrap();
    assert_eq!((known.people.len(), known.unreadable.len()), (3, 0));
    let anna = store.find("Anna").unwrap();
    assert_eq!(store.images(&anna).unwrap().images, images(1, 6));
    store.model_of(&anna, &network("osnet")).unwrap();
}

/// A change that was killed before its key file took the old one's place leaves one beside it. The
/// second name of that file shows what becomes of its bytes.
#[test]
fn keys_that_an_interrupted_change_left_are_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let (mut store, berta, hidden) = with_berta(&paths);
    let (left_over, second) = (
        folder.path().join("people.key.new"),
        folder.path().join("second name"),
    );
    std::fs::copy(&paths.key, &left_over).unwrap();
    std::fs::hard_link(&left_over, &second).unwrap();
    store.forget(&berta).unwrap();
    assert!(!left_over.exists());
    assert_eq!(left(folder.path(), &hidden), 0);

    // Where a link lies in the way, what it leads to is somebody else's.
    let other = folder.path().join("other");
    std::fs::write(&other, "somebody else's").unwrap();
    std::os::unix::fs::symlink(&other, &left_over).unwrap();
    enrol(&mut store, "Clara", 3, 1).unwrap();
    assert_eq!(std::fs::read(&other).unwrap(), b"somebody else's");
    assert!(!left_over.exists() && !paths.key.is_symlink());
}

#[test]
fn a_copy_of_the_store_from_before_says_nothing_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut store = open(&paths);
    enrol(&mut store, "Anna", 1, 1).unwrap();
    let berta = enrol(&mut store, "Berta", 2, 1).unwrap();
    drop(store);
    let snapshot = std::fs::read(&paths.file).unwrap();
    open(&paths).forget(&berta).unwrap();
    std::fs::write(&paths.file, snapshot).unwrap();
    let store = open(&paths);
    let known = store.list().unwrap();
    assert_eq!((known.people.len(), known.unreadable.len()), (1, 1));
    assert_eq!(store.images(&berta).unwrap_err().to_string(), {
        let unknown = PeopleError::Unknown {
            name: "Berta".to_owned(),
        };
        unknown.to_string()
    });
}

#[test]
fn a_reader_that_holds_the_log_delays_the_end_and_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let (mut store, berta, hidden) = with_berta(&paths);
    let reader = rusqlite::Connection::open(&paths.file).unwrap();
    reader.execute_batch("BEGIN").unwrap();
    let rows: i64 = reader
        .query_row("SELECT count(*) FROM image", [], |row| row.get(0))
        .unwrap();
    assert!(rows > 0);
    store.set_patience(Duration::from_millis(20)).unwrap();
    let error = store.forget(&berta).unwrap_err();
    assert!(matches!(error, PeopleError::Remnants { .. }), "{error:?}");
    assert!(error.to_string().contains("people list"), "{error}");
    assert!(store.has_remnants().unwrap());
    // For everybody who asks she is gone at once, and her key is.
    assert!(store.find("Berta Unverwechselbar").is_err());
    reader.execute_batch("ROLLBACK").unwrap();
    drop(store);
    let store = open(&paths);
    assert!(!store.has_remnants().unwrap());
    assert_eq!(left(folder.path(), &hidden), 0);
    drop(reader);
}

/// What the child process of the next tests does, and to which store; unset in an ordinary run.
const VICTIM: &str = "HACHI_PEOPLE_VICTIM";
const DEED: &str = "HACHI_PEOPLE_DEED";

/// Not a test of its own: changes a store until it is killed.
#[test]
fn changes_until_it_is_killed() {
    let (Ok(folder), Ok(deed)) = (std::env::var(VICTIM), std::env::var(DEED)) else {
        return;
    };
    // The parent reads these lines: each says what is done.
    #[allow(clippy::print_stdout, reason = "a line to the parent process")]
    let say = |what: &str| println!("done {what}");
    let mut store = open(&paths(Path::new(&folder)));
    if deed == "forget" {
        let berta = store.find("Berta Unverwechselbar").unwrap();
        say("opened");
        store.forget(&berta).unwrap();
        say("forgotten");
        loop {
            std::thread::sleep(Duration::from_secs(1));
        }
    }
    // Who writes without a pause for longer than another program's patience keeps it from writing at all.
    for i in 0..200_u64 {
        let person = enrol(&mut store, &format!("person {i}"), i, 3).unwrap();
        say(&format!("enrolled {i}"));
        let network = network("osnet");
        store
            .save_model(&person, &network, &model(i + 500))
            .unwrap();
        store.add_images(&person, &images(i + 500, 1)).unwrap();
        say(&format!("saved {i}"));
    }
    loop {
        std::thread::sleep(Duration::from_secs(1));
    }
}

/// A process of this test program that does this, and what it says.
fn victim(
    folder: &Path,
    deed: &str,
) -> (std::process::Child, impl Iterator<Item = String> + use<>) {
    use std::io::{BufRead, BufReader};
    let mut child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "changes_until_it_is_killed", "--nocapture"])
        .env(VICTIM, folder)
        .env(DEED, deed)
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let said = lines.map(Result::unwrap).filter(|l| l.contains("done "));
    (child, said)
}

#[test]
fn killed_at_any_instant_everything_said_to_be_saved_is_there() {
    for (round, kills_after) in [1_usize, 2, 3, 6, 9, 14].into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let (mut child, mut said) = victim(folder.path(), "enrol");
        let said: Vec<String> = said.by_ref().take(kills_after).collect();
        // Somewhere within the next change.
        std::thread::sleep(Duration::from_micros(900 * round as u64));
        child.kill().unwrap();
        child.wait().unwrap();

        let mut store = open(&paths(folder.path()));
        let known = store.list().unwrap();
        assert!(known.unreadable.is_empty(), "{known:?}");
        let enrolled = said.iter().filter(|line| line.contains("enrolled"));
        let enrolled = enrolled.count();
        assert!(known.people.len() >= enrolled, "{said:?} {known:?}");
        for i in 0..known.people.len() as u64 {
            let person = store.find(&format!("person {i}")).unwrap();
            let now = store.model_of(&person, &network("osnet")).unwrap();
            let kept = store.images(&person).unwrap();
            assert_eq!(kept.damaged, 0);
            assert_eq!(kept.images[..3], images(i, 3));
            let saved = said.iter().any(|l| l.contains(&format!("saved {i}")));
            if saved {
                assert_eq!(now, model(i + 500));
                assert_eq!(kept.images[3..], images(i + 500, 1));
            } else {
                assert!(now == model(i) || now == model(i + 500));
            }
        }
        // And it can be gone on with.
        enrol(&mut store, "afterwards", 9_000, 1).unwrap();
    }
}

#[test]
fn killed_while_forgetting_a_person_is_whole_or_gone_without_a_trace() {
    const ROUNDS: u64 = 12;
    for round in 0..ROUNDS {
        let folder = tempfile::tempdir().unwrap();
        let paths = paths(folder.path());
        let (store, berta, hidden) = with_berta(&paths);
        let images = store.images(&berta).unwrap().images;
        drop(store);
        let (mut child, mut said) = victim(folder.path(), "forget");
        assert!(said.next().unwrap().contains("opened"));
        if round == ROUNDS - 1 {
            assert!(said.next().unwrap().contains("forgotten"));
        }
        std::thread::sleep(Duration::from_micros(300 * round * round));
        child.kill().unwrap();
        child.wait().unwrap();

        let store = open(&paths);
        match store.find(&berta.name) {
            Ok(berta) => {
                assert!(round < ROUNDS - 1, "said to be forgotten");
                assert_eq!(store.images(&berta).unwrap().images, images);
                store.model(&berta).unwrap();
            }
            Err(_) => assert_eq!(left(folder.path(), &hidden), 0, "round {round}"),
        }
        assert!(store.list().unwrap().unreadable.is_empty());
    }
}

#[test]
fn two_programs_that_write_at_once_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut store = open(&paths);
    let (mut child, mut said) = victim(folder.path(), "enrol");
    for i in 0..12_u64 {
        let person = enrol(&mut store, &format!("own {i}"), 100 + i, 2).unwrap();
        if i % 3 == 0 {
            store.forget(&person).unwrap();
        }
    }
    let last = said.nth(3).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(last.contains("saved 1"), "{last}");
    let known = store.list().unwrap();
    assert!(known.unreadable.is_empty());
    let own = known.people.iter().filter(|p| p.name.starts_with("own"));
    assert_eq!(own.count(), 8);
    for i in 0..2_u64 {
        let person = store.find(&format!("person {i}")).unwrap();
        assert_eq!(store.model(&person).unwrap().model, model(i + 500));
    }
    let check: String = rusqlite::Connection::open(&paths.file)
        .unwrap()
        .pragma_query_value(None, "integrity_check", |row| row.get(0))
        .unwrap();
    assert_eq!(check, "ok");
}
