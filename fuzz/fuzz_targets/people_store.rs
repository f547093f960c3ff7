//! Any bytes as a key file and a store of people: opened, read, written to, somebody forgotten.
//! The first two bytes say how long the key file is.
#![no_main]

use std::os::unix::fs::PermissionsExt;

use hachi_store::people::{PeopleFile, PeoplePaths};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((length, bytes)) = bytes.split_first_chunk::<2>() else {
        return;
    };
    let length = usize::from(u16::from_le_bytes(*length)).min(bytes.len());
    let (key, store) = bytes.split_at(length);
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let paths = PeoplePaths::beside(&folder.path().join("fuzzed.db"));
    std::fs::write(&paths.file, store).expect("room for a temporary file");
    std::fs::write(&paths.key, key).expect("room for a temporary file");
    let owner_alone = std::fs::Permissions::from_mode(0o600);
    std::fs::set_permissions(&paths.key, owner_alone).expect("our own file");
    let Ok(Some(mut people)) = PeopleFile::open_if_there(&paths) else {
        return;
    };
    let Ok(known) = people.list() else {
        return;
    };
    for person in &known.people {
        let _ = people.images(person);
        if let Ok(stored) = people.model(person) {
            let _ = people.save_model(person, &stored.network, &stored.model);
        }
    }
    let _ = people.forget_unreadable();
    if let Some(person) = known.people.first() {
        let _ = people.forget(person);
    }
});
