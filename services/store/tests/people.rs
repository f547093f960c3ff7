//! People are there after the next start as they were saved, and where they can't be it is said.

mod support;

use std::os::unix::fs::PermissionsExt;
use std::time::Duration;

use hachi_store::people::{PeopleError, PeopleFile, PeoplePaths};
use support::{ENROLLED_UNIX_S, enrol, feature, images, model, network, open, paths};

#[test]
fn people_come_back_as_they_were_saved() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    assert!(PeopleFile::open_if_there(&paths).unwrap().is_none());
    let mut store = open(&paths);
    let zoe = enrol(&mut store, " Zoë ", 1, 3).unwrap();
    let anna = enrol(&mut store, "Anna", 2, 2).unwrap();
    let mut learnt = model(2);
    let distance = learnt.distance(&feature(77));
    learnt.learn(&feature(77), distance);
    store.save_model(&anna, &network("osnet"), &learnt).unwrap();
    store.add_images(&anna, &images(9, 1)).unwrap();
    store.rename(&zoe, "Zoë K.").unwrap();
    drop(store);

    let store = PeopleFile::open_if_there(&paths).unwrap().unwrap();
    let known = store.list().unwrap();
    assert!(known.unreadable.is_empty());
    let names: Vec<_> = known.people.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["Anna", "Zoë K."]);
    let anna = store.find("Anna").unwrap();
    assert_eq!((anna.enrolled_unix_s, anna.images), (ENROLLED_UNIX_S, 3));
    assert_eq!(store.model_of(&anna, &network("osnet")).unwrap(), learnt);
    let stored = store.images(&anna).unwrap();
    assert_eq!(stored.images, [images(2, 2), images(9, 1)].concat());
    assert_eq!(stored.damaged, 0);
    let zoe = store.find("Zoë K.").unwrap();
    assert_eq!(store.model(&zoe).unwrap().model, model(1));
    assert_eq!(store.images(&zoe).unwrap().images, images(1, 3));
    for file in [&paths.file, &paths.key] {
        let mode = std::fs::metadata(file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{}", file.display());
    }
}

#[test]
fn names_that_are_none_or_taken_and_people_who_are_not_there_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = open(&paths(folder.path()));
    let anna = enrol(&mut store, "Anna", 1, 1).unwrap();
    let berta = enrol(&mut store, "Berta", 2, 1).unwrap();
    for name in ["", "  ", "two\nlines", &"x".repeat(101)] {
        let error = enrol(&mut store, name, 3, 1).unwrap_err();
        assert!(matches!(error, PeopleError::NotAName { .. }), "{error:?}");
    }
    let taken = enrol(&mut store, "Anna ", 3, 1).unwrap_err();
    assert!(taken.to_string().contains("choose another name"), "{taken}");
    let taken = store.rename(&berta, "Anna").unwrap_err();
    assert!(matches!(taken, PeopleError::NameTaken { .. }), "{taken:?}");
    store.rename(&anna, "Anna").unwrap();
    let unknown = store.find("Clara").unwrap_err();
    assert!(unknown.to_string().contains("people list"), "{unknown}");

    store.forget(&anna).unwrap();
    let network = network("osnet");
    for error in [
        store.forget(&anna).unwrap_err(),
        store.save_model(&anna, &network, &model(1)).unwrap_err(),
        store.add_images(&anna, &images(1, 1)).unwrap_err(),
        store.rename(&anna, "Anni").unwrap_err(),
        store.model(&anna).unwrap_err(),
        store.images(&anna).unwrap_err(),
    ] {
        assert!(matches!(error, PeopleError::Unknown { .. }), "{error:?}");
    }
    assert_eq!(store.list().unwrap().people.len(), 1);
}

#[test]
fn features_of_another_network_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = open(&paths(folder.path()));
    let anna = enrol(&mut store, "Anna", 1, 1).unwrap();
    let error = store.model_of(&anna, &network("resnet")).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("osnet (sha256 6f736e65746f)"), "{said}");
    assert!(said.contains("resnet (sha256"), "{said}");
    // Its content counts, not its name.
    let mut renamed = network("osnet");
    renamed.name = "newest".to_owned();
    store.model_of(&anna, &renamed).unwrap();
    // Computed anew with the other network, the model is that one's.
    store
        .save_model(&anna, &network("resnet"), &model(5))
        .unwrap();
    assert_eq!(store.model_of(&anna, &network("resnet")).unwrap(), model(5));
}

#[test]
fn a_pool_is_bounded_and_its_oldest_pictures_go() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = open(&paths(folder.path()));
    let all = images(1, 70);
    let anna = enrol(&mut store, "Anna", 1, 70).unwrap();
    enrol(&mut store, "Berta", 2, 1).unwrap();
    assert_eq!(anna.images, 64);
    assert_eq!(store.images(&anna).unwrap().images, all[6..]);
    store.add_images(&anna, &images(3, 2)).unwrap();
    let kept = store.images(&anna).unwrap().images;
    assert_eq!(kept, [&all[8..], &images(3, 2)].concat());
    for wrong in [vec![], vec![0; (1 << 20) + 1]] {
        let error = store.add_images(&anna, &[wrong]).unwrap_err();
        assert!(matches!(error, PeopleError::Image { .. }), "{error:?}");
    }
}

#[test]
fn what_is_no_store_and_keys_that_do_not_fit_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| PeoplePaths::beside(&folder.path().join(name));
    let refused = |paths: &PeoplePaths| PeopleFile::open_or_create(paths).unwrap_err();

    std::fs::write(at("text.db").file, "no store\n".repeat(500)).unwrap();
    let text = refused(&at("text.db"));
    assert!(matches!(text, PeopleError::NotAStore { .. }), "{text:?}");
    let other = rusqlite::Connection::open(at("other.db").file).unwrap();
    other.execute_batch("CREATE TABLE person (id)").unwrap();
    drop(other);
    let before = std::fs::read(at("other.db").file).unwrap();
    let other = refused(&at("other.db"));
    assert!(matches!(other, PeopleError::NotAStore { .. }), "{other:?}");
    let after = std::fs::read(at("other.db").file).unwrap();
    assert!(before == after, "what is not ours is left as it is");
    std::fs::create_dir(at("folder.db").file).unwrap();
    let dir = refused(&at("folder.db"));
    assert!(matches!(dir, PeopleError::NotAStore { .. }), "{dir:?}");

    let ours = at("ours.db");
    let mut store = open(&ours);
    enrol(&mut store, "Anna", 1, 1).unwrap();
    drop(store);
    let second = at("second.db");
    drop(open(&second));
    let keys = std::fs::read(&ours.key).unwrap();

    std::fs::copy(&second.key, &ours.key).unwrap();
    let wrong = refused(&ours);
    assert!(matches!(wrong, PeopleError::WrongKeys { .. }), "{wrong:?}");
    std::fs::remove_file(&ours.key).unwrap();
    let none = refused(&ours);
    assert!(none.to_string().contains("restore the key file"), "{none}");
    assert!(
        !ours.key.exists(),
        "a new key hides that the old one is gone"
    );
    let write_key = |content: &[u8]| {
        std::fs::write(&ours.key, content).unwrap();
        std::fs::set_permissions(&ours.key, PermissionsExt::from_mode(0o600)).unwrap();
    };
    for cut in [0, 10, 60, 100, keys.len() - 2] {
        write_key(&keys[..cut]);
        let cut = refused(&ours);
        assert!(matches!(cut, PeopleError::DamagedKeys { .. }), "{cut:?}");
    }
    write_key(&keys);
    std::fs::set_permissions(&ours.key, PermissionsExt::from_mode(0o644)).unwrap();
    let open_to_all = refused(&ours).to_string();
    assert!(open_to_all.contains("chmod 600"), "{open_to_all}");
    std::fs::set_permissions(&ours.key, PermissionsExt::from_mode(0o600)).unwrap();

    // A new store does not take over the keys of one that was moved away.
    let moved = PeoplePaths {
        file: folder.path().join("new.db"),
        key: ours.key.clone(),
    };
    let taken = refused(&moved);
    assert!(matches!(taken, PeopleError::WrongKeys { .. }), "{taken:?}");
    assert_eq!(std::fs::read(&ours.key).unwrap(), keys);
    assert_eq!(open(&ours).list().unwrap().people.len(), 1);

    let newer = rusqlite::Connection::open(&ours.file).unwrap();
    newer.pragma_update(None, "user_version", 9).unwrap();
    drop(newer);
    let newer = refused(&ours);
    assert!(
        matches!(newer, PeopleError::Version { found: 9, .. }),
        "{newer:?}"
    );
}

#[test]
fn damage_costs_the_person_it_hits_and_they_can_be_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut store = open(&paths);
    for (seed, name) in ["Anna", "Berta", "Clara"].iter().enumerate() {
        enrol(&mut store, name, seed as u64, 3).unwrap();
    }
    let [anna, berta, clara] = ["Anna", "Berta", "Clara"].map(|name| store.find(name).unwrap());
    drop(store);
    // Anna gets Berta's model and one of her pictures; Clara's key is another.
    let connection = rusqlite::Connection::open(&paths.file).unwrap();
    let swap = "UPDATE model SET sealed = (SELECT sealed FROM model AS other \
                WHERE other.person != model.person) WHERE person = (SELECT min(person) FROM image \
                WHERE id = 1)";
    assert_eq!(connection.execute(swap, []).unwrap(), 1);
    let swap = "UPDATE image SET sealed = (SELECT sealed FROM image AS other WHERE other.id = 4) \
                WHERE id = 2";
    assert_eq!(connection.execute(swap, []).unwrap(), 1);
    let clara_number: i64 = connection
        .query_row("SELECT person FROM image WHERE id = 7", [], |row| {
            row.get(0)
        })
        .unwrap();
    drop(connection);
    let keys = std::fs::read_to_string(&paths.key).unwrap();
    let line = keys
        .lines()
        .find(|line| line.starts_with(&format!("{clara_number} ")));
    let line = line.unwrap();
    let changed = format!("{clara_number} {}", "5".repeat(64));
    std::fs::write(&paths.key, keys.replace(line, &changed)).unwrap();

    let mut store = open(&paths);
    let known = store.list().unwrap();
    assert_eq!(known.unreadable, [clara.id]);
    let error = store.model(&anna).unwrap_err();
    assert!(error.to_string().contains("of Anna is damaged"), "{error}");
    let kept = store.images(&anna).unwrap();
    assert_eq!((kept.images.len(), kept.damaged), (2, 1));
    assert_eq!(store.images(&berta).unwrap().images, images(1, 3));
    store.model(&berta).unwrap();
    assert_eq!(store.forget_unreadable().unwrap(), 1);
    assert_eq!(store.forget_unreadable().unwrap(), 0);
    store.forget(&anna).unwrap();
    let known = store.list().unwrap();
    assert_eq!((known.people, known.unreadable), (vec![berta], vec![]));
}

#[test]
fn a_full_disk_costs_what_did_not_fit_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut store = open(&paths);
    store.set_quota(300_000).unwrap();
    let mut kept = 0;
    let error = loop {
        match enrol(&mut store, &format!("person {kept}"), kept, 4) {
            Ok(_) => kept += 1,
            Err(error) => break error,
        }
    };
    assert!(matches!(error, PeopleError::Full { .. }), "{error:?}");
    assert!(error.to_string().contains("free some space"), "{error}");
    assert!(kept > 2);
    // Somebody can be forgotten nevertheless, and makes room.
    let first = store.find("person 0").unwrap();
    store.forget(&first).unwrap();
    enrol(&mut store, "another", 500, 4).unwrap();
    drop(store);
    let store = open(&paths);
    assert_eq!(store.list().unwrap().people.len() as u64, kept);
    for seed in 1..kept {
        let person = store.find(&format!("person {seed}")).unwrap();
        assert_eq!(store.images(&person).unwrap().images, images(seed, 4));
    }
}

#[test]
fn a_store_cut_short_or_scribbled_over_is_an_error_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let whole = paths(folder.path());
    let mut store = open(&whole);
    for seed in 0..5 {
        enrol(&mut store, &format!("person {seed}"), seed, 2).unwrap();
    }
    drop(store);
    let bytes = std::fs::read(&whole.file).unwrap();
    let broken = PeoplePaths {
        file: folder.path().join("broken.db"),
        key: whole.key.clone(),
    };
    // Whether everything can be read.
    let try_all = |content: &[u8]| -> bool {
        for ending in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(format!("{}{ending}", broken.file.display()));
        }
        std::fs::write(&broken.file, content).unwrap();
        let Ok(store) = PeopleFile::open_or_create(&broken) else {
            return false;
        };
        let Ok(known) = store.list() else {
            return false;
        };
        let whole = |person| {
            store.model(person).is_ok()
                && store.images(person).is_ok_and(|images| images.damaged == 0)
        };
        known.people.len() == 5 && known.people.iter().all(whole)
    };
    assert!(try_all(&bytes));
    for tenth in 0..10 {
        assert!(!try_all(&bytes[..bytes.len() * tenth / 10]), "{tenth}");
    }
    for at in (0..bytes.len()).step_by(911) {
        let mut changed = bytes.clone();
        changed[at] ^= 0xff;
        try_all(&changed);
    }
}

#[test]
fn two_programs_see_each_other_s_changes_and_one_that_waits_too_long_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut one = open(&paths);
    let mut other = open(&paths);
    let anna = enrol(&mut one, "Anna", 1, 1).unwrap();
    assert!(other.has_changed().unwrap() && !other.has_changed().unwrap());
    assert!(!one.has_changed().unwrap(), "it knows what it did itself");
    assert_eq!(other.find("Anna").unwrap(), anna);
    other.forget(&anna).unwrap();
    assert!(one.has_changed().unwrap());
    let gone = one
        .save_model(&anna, &network("osnet"), &model(1))
        .unwrap_err();
    assert!(matches!(gone, PeopleError::Unknown { .. }), "{gone:?}");

    let third = rusqlite::Connection::open(&paths.file).unwrap();
    third.execute_batch("BEGIN IMMEDIATE").unwrap();
    one.set_patience(Duration::from_millis(20)).unwrap();
    let busy = enrol(&mut one, "Berta", 2, 1).unwrap_err();
    assert!(matches!(busy, PeopleError::InUse { .. }), "{busy:?}");
    third.execute_batch("ROLLBACK").unwrap();
    enrol(&mut one, "Berta", 2, 1).unwrap();
}

#[test]
fn a_reader_never_stumbles_over_keys_that_change_under_it() {
    let folder = tempfile::tempdir().unwrap();
    let paths = paths(folder.path());
    let mut store = open(&paths);
    enrol(&mut store, "Anna", 1, 1).unwrap();
    let done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let store = open(&paths);
            let mut reads = 0;
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                let known = store.list().unwrap();
                assert_eq!(known.unreadable, []);
                store.model(&store.find("Anna").unwrap()).unwrap();
                reads += 1;
            }
            reads
        });
        for seed in 0..40 {
            let person = enrol(&mut store, "Berta", seed, 1).unwrap();
            if let Err(error) = store.forget(&person) {
                // The reader may hold the log for longer than is waited for.
                assert!(matches!(error, PeopleError::Remnants { .. }), "{error:?}");
            }
        }
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(reader.join().unwrap() > 0);
    });
}
