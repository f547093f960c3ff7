//! How long the store of people takes: `cargo run --release -p hachi-store --example people_store_cost
//! [FOLDER]`, on the disk of that folder.
//!
//! Models have 512 numbers, pictures 60 kB, as those of a small re-identification network's crops.

use std::path::PathBuf;
use std::time::Instant;

use hachi_people::identify::AppearanceModel;
use hachi_store::people::{NetworkIdentity, NewPerson, PeopleError, PeopleFile, PeoplePaths};

const PEOPLE: usize = 100;
const IMAGES: usize = 64;
const IMAGE_BYTES: usize = 60_000;
const FEATURE: usize = 512;
const SAVES: usize = 500;

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1);
    let folder = folder.map_or_else(std::env::temp_dir, PathBuf::from);
    let folder = tempfile::tempdir_in(folder)?;
    let paths = PeoplePaths::beside(&folder.path().join("people.db"));
    let network = NetworkIdentity {
        name: "figures".to_owned(),
        sha256: [0; 32],
    };
    let feature: Vec<f32> = (0..FEATURE).map(|i| (i as f32 * 0.37).sin()).collect();
    let model = AppearanceModel::first(&feature).ok_or("no feature")?;
    let images: Vec<Vec<u8>> = (0..IMAGES).map(|i| vec![i as u8; IMAGE_BYTES]).collect();
    let mut store = PeopleFile::open_or_create(&paths)?;

    println!("{:<28} {:>8} {:>8} {:>8}", "ms", "median", "p99", "max");
    let mut number = 0;
    measure("enrol, 64 pictures", PEOPLE, || {
        number += 1;
        let person = store.enrol(&NewPerson {
            name: &format!("person {number}"),
            enrolled_unix_s: 0,
            network: &network,
            model: &model,
            images: &images,
        });
        person.map(drop)
    })?;
    let person = store.find("person 1")?;
    measure("save a model", SAVES, || {
        store.save_model(&person, &network, &model)
    })?;
    measure("add a picture", SAVES, || {
        store.add_images(&person, &images[..1])
    })?;
    measure("load a model", SAVES, || store.model(&person).map(drop))?;
    measure("load 64 pictures", 20, || store.images(&person).map(drop))?;
    measure("list 100 people", 50, || store.list().map(drop))?;
    measure("forget one of 100 (400 MB)", 5, || {
        let person = store.find(&format!("person {number}"))?;
        number -= 1;
        store.forget(&person)
    })?;
    Ok(())
}

/// Runs something so often, and prints how long it took.
#[allow(clippy::print_stdout, reason = "an example prints")]
fn measure(
    what: &str,
    runs: usize,
    mut run: impl FnMut() -> Result<(), PeopleError>,
) -> Result<(), PeopleError> {
    let mut times = Vec::new();
    for _ in 0..runs {
        let begun = Instant::now();
        run()?;
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{what:<28} {:8.2} {:8.2} {:8.2}",
        at(0.5),
        at(0.99),
        at(1.0)
    );
    Ok(())
}
