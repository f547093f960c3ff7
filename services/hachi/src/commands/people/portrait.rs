//! Pictures of one person: crops, or frames in which they are found.
//!
//! In: a picture, and who is meant where more than one person is in it. Out: what the person looks like,
//! and the part of the picture that shows them.

use std::path::Path;

use hachi_people::BoundingBox;
use hachi_people::appearance::{Appearance, Person};
use hachi_people::observe::Observer;

use crate::images::{self, Rgb};

/// A picture at least this much higher than wide is a crop of a person.
const CROP_RATIO: f64 = 1.4;

/// Who is meant in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meant {
    /// Whoever is largest.
    Largest,
    /// The only one: a frame with others in it is no picture of them.
    Only,
}

/// A person in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Portrait {
    /// What they look like.
    pub feature: Vec<f32>,
    /// The picture, cut to them.
    pub crop: Rgb,
}

/// The person in a picture.
///
/// # Errors
/// Why it shows nobody, or does not say whom, in a few words.
pub fn read(observer: &mut Observer, path: &Path, meant: Meant) -> Result<Portrait, String> {
    let image = images::read(path)?;
    let view = image.view().map_err(|error| error.to_string())?;
    if image.height as f64 >= CROP_RATIO * image.width as f64 {
        let appearance = observer.appearance().ok_or("no network for it")?;
        let feature = whole(appearance, &image)?;
        return Ok(Portrait {
            feature,
            crop: image,
        });
    }
    let seen = observer.observe(&view).map_err(|error| error.to_string())?;
    let feature = |index: usize| seen.features.and_then(|features| features.get(index));
    let people = (0..seen.detections.len())
        .filter_map(|index| Some((seen.detections[index].bounding_box, feature(index)?)))
        .collect::<Vec<_>>();
    if meant == Meant::Only && people.len() > 1 {
        return Err(format!("{} people are in it", people.len()));
    }
    let largest = people
        .into_iter()
        .max_by(|a, b| a.0.area().total_cmp(&b.0.area()));
    let (bounding_box, feature) = largest.ok_or("nobody is in it")?;
    let crop = image.cut(&bounding_box);
    Ok(Portrait {
        feature: feature.to_vec(),
        crop: crop.ok_or("nobody is in it")?,
    })
}

fn whole(appearance: &mut Appearance, image: &Rgb) -> Result<Vec<f32>, String> {
    let view = image.view().map_err(|error| error.to_string())?;
    let person = Person {
        bounding_box: BoundingBox::new(0.0, 0.0, image.width as f64, image.height as f64),
        mask: None,
    };
    let features = appearance.features(&view, &[person]);
    features
        .map(<[f32]>::to_vec)
        .map_err(|error| error.to_string())
}
