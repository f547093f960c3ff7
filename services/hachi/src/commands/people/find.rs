//! `hachi people find`: the person of some pictures, in other images.

use std::path::{Path, PathBuf};

use hachi_people::gallery;
use hachi_people::observe::{Observation, Observer};
use serde::Serialize;

use super::portrait::{self, Meant};
use crate::cli::people::PeopleFindArguments;
use crate::exit::Failure;
use crate::images::{self, Frame};
use crate::{networks, output, progress};

#[derive(Debug, Serialize)]
struct Summary {
    /// In how many frames the person is.
    found: usize,
    max_distance: f64,
    frames: Vec<Sighting>,
}

#[derive(Debug, Serialize)]
struct Sighting {
    file: String,
    found: bool,
    /// Left, top, width and height of whoever looks most like the person, pixels.
    #[serde(rename = "box")]
    bounding_box: Option<[f64; 4]>,
    /// How far their looks lie apart.
    distance: Option<f64>,
    score: Option<f64>,
    /// How many people are in the frame.
    people: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

/// Runs the command.
///
/// # Errors
/// There is no network, no picture of the person can be used, or no frame can be looked at.
pub fn run(arguments: &PeopleFindArguments) -> Result<(), Failure> {
    let (queries, input) = split(arguments)?;
    let frames = match input.is_dir() {
        true => images::frames(input)?,
        false => vec![Frame {
            number: 1,
            path: input.to_owned(),
        }],
    };
    let mut observer = networks::observer(&arguments.networks)?;
    let appearance = observer.appearance().ok_or_else(networks::no_appearance)?;
    let usual = appearance.same_person_distance();
    let max_distance = arguments.max_distance.unwrap_or(usual);
    let mut looks = Vec::new();
    for query in queries {
        let portrait = portrait::read(&mut observer, query, Meant::Largest);
        looks.extend(portrait.map_err(|reason| unusable(query, reason))?.feature);
    }
    let bar = progress::bar(Some(frames.len() as u64), "frames");
    let mut sightings = Vec::new();
    for frame in &frames {
        bar.inc(1);
        sightings.push(search(&mut observer, &looks, frame, max_distance));
    }
    bar.finish_and_clear();
    let mut reasons = sightings.iter().map(|sighting| &sighting.error);
    if let (Some(Some(first)), true) = (reasons.next(), reasons.all(Option::is_some)) {
        return Err(Failure::new(
            format_args!(
                "no frame can be looked at: {}: {first}",
                frames[0].path.display()
            ),
            "give JPEG or PNG images",
        ));
    }
    let summary = Summary {
        found: sightings.iter().filter(|sighting| sighting.found).count(),
        max_distance,
        frames: sightings,
    };
    match arguments.json {
        true => output::json(&summary),
        false => output::text(&text(&summary)),
    }
}

/// `--query A B INPUT`: the list takes INPUT too.
fn split(arguments: &PeopleFindArguments) -> Result<(&[PathBuf], &Path), Failure> {
    match (&arguments.input, &arguments.query[..]) {
        (Some(input), queries) => Ok((queries, input)),
        (None, [queries @ .., input]) if !queries.is_empty() => Ok((queries, input)),
        _ => Err(Failure::Usage(
            "INPUT is missing: hachi people find --query IMG... INPUT".to_owned(),
        )),
    }
}

fn unusable(path: &Path, reason: impl std::fmt::Display) -> Failure {
    Failure::new(
        format_args!("{}: {reason}", path.display()),
        "give a JPEG or PNG picture of the person",
    )
}

fn search(observer: &mut Observer, looks: &[f32], frame: &Frame, max_distance: f64) -> Sighting {
    let mut sighting = Sighting {
        file: frame.path.display().to_string(),
        found: false,
        bounding_box: None,
        distance: None,
        score: None,
        people: 0,
        error: None,
    };
    let image = images::read(&frame.path);
    let searched = image.and_then(|image| {
        let view = image.view().map_err(|e| e.to_string())?;
        let seen = observer.observe(&view).map_err(|e| e.to_string())?;
        sighting.fill(&seen, looks, max_distance);
        Ok(())
    });
    sighting.error = searched.err();
    sighting
}

impl Sighting {
    fn fill(&mut self, seen: &Observation<'_>, looks: &[f32], max_distance: f64) {
        let Some(features) = seen.features else {
            return;
        };
        let people = (0..seen.detections.len())
            .filter_map(|index| Some((index, features.get(index)?)))
            .collect::<Vec<_>>();
        self.people = people.len();
        let distances = people
            .iter()
            .map(|(index, feature)| (*index, gallery::distance(looks, feature)));
        let Some((index, distance)) = distances.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return;
        };
        let nearest = &seen.detections[index];
        let b = nearest.bounding_box;
        self.found = distance <= max_distance;
        self.bounding_box = Some([b.left, b.top, b.width, b.height]);
        self.distance = Some(distance);
        self.score = Some(nearest.score);
    }
}

fn text(summary: &Summary) -> String {
    let mut text = String::new();
    for frame in &summary.frames {
        let what = match (&frame.error, frame.bounding_box, frame.distance) {
            (Some(error), ..) => format!("not looked at: {error}"),
            (None, Some([left, top, width, height]), Some(distance)) => {
                let found = if frame.found {
                    "here"
                } else {
                    "not here; nearest"
                };
                format!(
                    "{found} at {left:.0},{top:.0} {width:.0}x{height:.0}, distance {distance:.3}"
                )
            }
            _ => "nobody".to_owned(),
        };
        text += &format!("{}  {what}\n", frame.file);
    }
    text + &format!(
        "in {} of {} frames (distance up to {:.3})",
        summary.found,
        summary.frames.len(),
        summary.max_distance
    )
}
