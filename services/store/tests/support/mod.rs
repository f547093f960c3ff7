//! People to keep, and every byte of a folder.
#![allow(dead_code, reason = "each test file uses its own part of this")]

use std::path::Path;

use hachi_people::identify::AppearanceModel;
use hachi_store::people::{
    NetworkIdentity, NewPerson, PeopleError, PeopleFile, PeoplePaths, PersonEntry,
};

pub const ENROLLED_UNIX_S: i64 = 1_790_000_000;

pub fn network(name: &str) -> NetworkIdentity {
    NetworkIdentity {
        name: name.to_owned(),
        sha256: std::array::from_fn(|i| name.as_bytes()[i % name.len()]),
    }
}

/// Bytes that look like nothing else.
pub fn noise(seed: u64, length: usize) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let byte = |_| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 24) as u8
    };
    (0..length).map(byte).collect()
}

pub fn feature(seed: u64) -> Vec<f32> {
    let bytes = noise(seed, 2 * 128);
    let pairs = bytes.chunks_exact(2);
    let number = |pair: &[u8]| f32::from(i16::from_le_bytes([pair[0], pair[1]])) / 32_768.0;
    pairs.map(number).collect()
}

pub fn model(seed: u64) -> AppearanceModel {
    let mut model = AppearanceModel::first(&feature(seed)).unwrap();
    let other = feature(seed + 1_000);
    let distance = model.distance(&other);
    model.learn(&other, distance);
    model
}

pub fn images(seed: u64, count: usize) -> Vec<Vec<u8>> {
    let image = |i| noise(1_000 * seed + i as u64, 3_000 + 700 * i);
    (0..count).map(image).collect()
}

pub fn enrol(
    store: &mut PeopleFile,
    name: &str,
    seed: u64,
    count: usize,
) -> Result<PersonEntry, PeopleError> {
    store.enrol(&NewPerson {
        name,
        enrolled_unix_s: ENROLLED_UNIX_S,
        network: &network("osnet"),
        model: &model(seed),
        images: &images(seed, count),
    })
}

pub fn open(paths: &PeoplePaths) -> PeopleFile {
    PeopleFile::open_or_create(paths).unwrap()
}

pub fn paths(folder: &Path) -> PeoplePaths {
    PeoplePaths::beside(&folder.join("people.db"))
}

/// Where the needle is in any file of the folder.
pub fn found_in(folder: &Path, needle: &[u8]) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        if bytes.windows(needle.len()).any(|window| window == needle) {
            found.push(path.display().to_string());
        }
    }
    found
}

/// All that is stored of people as SQLite gives it: sealed bytes, by person.
pub fn sealed(paths: &PeoplePaths) -> Vec<(i64, Vec<u8>)> {
    let connection = rusqlite::Connection::open(&paths.file).unwrap();
    let query = "SELECT id, record FROM person UNION ALL SELECT person, sealed FROM model \
                 UNION ALL SELECT person, sealed FROM image";
    let mut statement = connection.prepare(query).unwrap();
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)));
    rows.unwrap().map(Result::unwrap).collect()
}
