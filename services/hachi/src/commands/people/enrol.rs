//! `hachi people enrol`: somebody from pictures of them.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use hachi_people::identify::Calibration;
use hachi_store::people::person::MOST_IMAGES;
use hachi_store::people::{NetworkIdentity, NewPerson, PeopleFile};
use serde::Serialize;

use super::portrait::{self, Meant};
use crate::cli::people::enrolled::PeopleEnrolArguments;
use crate::exit::Failure;
use crate::images;
use crate::interrupt::Cancelled;
use crate::{networks, output, progress, saved_people};

/// Somebody else's model that takes so many of the pictures for its person would mix the two up.
const ALIKE_SHARE: f64 = 0.5;

#[derive(Debug, Serialize)]
struct Summary {
    name: String,
    /// Pictures that the model is made of.
    images_used: usize,
    images_kept: usize,
    left_out: Vec<LeftOut>,
    network: String,
    network_sha256: String,
    /// A feature nearer to the model than this is taken for the person's.
    threshold: f64,
    /// People who are known already, and whose models take most of these pictures for theirs.
    alike: Vec<String>,
    store: PathBuf,
}

#[derive(Debug, Serialize)]
struct LeftOut {
    file: String,
    reason: String,
}

/// Runs the command.
///
/// # Errors
/// The name is taken, there is no network, too few pictures show the person, or nothing can be kept.
pub fn run(arguments: &PeopleEnrolArguments) -> Result<(), Failure> {
    let files = files(&arguments.images)?;
    let mut store = saved_people::open_or_create(&arguments.store)?;
    // A name that can't be had is better known before the work than after it.
    store.check_name(&arguments.name).map_err(Failure::said)?;
    let chosen = networks::chosen(&arguments.networks)?;
    let network = chosen.identity()?;
    let mut observer = chosen.open()?;
    let cancelled = Cancelled::on_interrupt()?;

    let mut calibration = Calibration::new(files.len());
    let (mut features, mut crops, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    let bar = progress::bar(Some(files.len() as u64), "pictures");
    for file in &files {
        if cancelled.is_cancelled() {
            return Err(Failure::Interrupted("nobody was enrolled".to_owned()));
        }
        let seen = portrait::read(&mut observer, file, Meant::Only)
            .and_then(|portrait| Ok((images::kept(portrait.crop)?, portrait.feature)));
        match seen {
            Ok((crop, feature)) => {
                calibration.push(&feature);
                features.push(feature);
                crops.push(crop);
            }
            Err(reason) => left_out.push(LeftOut {
                file: file.display().to_string(),
                reason,
            }),
        }
        let (got, wanted) = calibration.progress();
        bar.set_message(format!("{got} of {wanted} show the person"));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let model = calibration
        .finish()
        .map_err(|error| too_few(&error, &left_out))?;

    let alike = alike(&store, &network, &features)?;
    let crops = evenly(crops, MOST_IMAGES);
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let person = store.enrol(&NewPerson {
        name: &arguments.name,
        enrolled_unix_s: now.map_or(0, |since| since.as_secs() as i64),
        network: &network,
        model: &model,
        images: &crops,
    });
    let person = person.map_err(Failure::said)?;
    let summary = Summary {
        name: person.name,
        images_used: calibration.progress().0,
        images_kept: person.images,
        left_out,
        network_sha256: network.sha256_hex(),
        network: network.name,
        threshold: model.threshold(),
        alike,
        store: saved_people::paths(&arguments.store)?.file,
    };
    match arguments.json {
        true => output::json(&summary),
        false => output::text(&text(&summary)),
    }
}

/// Files as named, those in folders in their order.
fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in named {
        match path.is_dir() {
            true => files.extend(images::frames(path)?.into_iter().map(|frame| frame.path)),
            false => files.push(path.clone()),
        }
    }
    Ok(files)
}

/// At most so many of them, spread over all.
fn evenly(images: Vec<Vec<u8>>, most: usize) -> Vec<Vec<u8>> {
    let count = images.len();
    let chosen = |index: usize| index * most / count != (index + 1) * most / count;
    let all = count <= most;
    let numbered = images.into_iter().enumerate();
    let kept = numbered.filter(|(index, _)| all || chosen(*index));
    kept.map(|(_, image)| image).collect()
}

/// Who else the pictures look like.
fn alike(
    store: &PeopleFile,
    network: &NetworkIdentity,
    features: &[Vec<f32>],
) -> Result<Vec<String>, Failure> {
    let mut alike = Vec::new();
    for person in store.list().map_err(Failure::said)?.people {
        // Whose model is another network's, or damaged, says nothing about likeness.
        let Ok(model) = store.model_of(&person, network) else {
            continue;
        };
        let near = features
            .iter()
            .filter(|f| model.distance(f) < model.threshold());
        if near.count() as f64 >= ALIKE_SHARE * features.len() as f64 {
            alike.push(person.name);
        }
    }
    Ok(alike)
}

fn too_few(error: &impl std::fmt::Display, left_out: &[LeftOut]) -> Failure {
    let named = |out: &LeftOut| {
        let name = Path::new(&out.file).file_name().unwrap_or_default();
        format!("{}: {}", name.to_string_lossy(), out.reason)
    };
    match left_out.first() {
        None => Failure::new(error, "give more pictures of them"),
        Some(first) => Failure::new(
            format_args!(
                "{error}; {} pictures were left out ({})",
                left_out.len(),
                named(first)
            ),
            "give more pictures of them alone",
        ),
    }
}

fn text(summary: &Summary) -> String {
    let mut text = String::new();
    for out in &summary.left_out {
        text += &format!("left out: {}: {}\n", out.file, out.reason);
    }
    text += &format!(
        "{} is known from {} pictures ({} kept, encrypted), threshold {:.2}\n",
        summary.name, summary.images_used, summary.images_kept, summary.threshold
    );
    if !summary.alike.is_empty() {
        text += &format!(
            "most of them look like {} too: they may be taken for each other\n",
            summary.alike.join(" and ")
        );
    }
    text + &format!("store: {}", summary.store.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_kept_from_the_whole_series_and_no_larger_than_needed() {
        let images: Vec<Vec<u8>> = (0..10).map(|i| vec![i]).collect();
        assert_eq!(evenly(images.clone(), 10), images);
        let few: Vec<u8> = evenly(images, 4).concat();
        assert_eq!(few, [2, 4, 7, 9]);
        let large = images::Rgb {
            width: 300,
            height: 1_100,
            pixels: vec![9; 3 * 300 * 1_100],
        };
        let kept = images::decode(&images::kept(large).unwrap()).unwrap();
        assert_eq!((kept.width, kept.height), (75, 275));
    }
}
