//! Pictures of what was known of the people in a frame: boxes, masks, numbers, the person who is
//! followed; and contact sheets of many.
//!
//! In: an image, tracks, where enrolled people are, masks. Out: RGB pixels, PNG files.

mod canvas;

use std::path::Path;

use embedded_graphics::image::{Image, ImageRaw};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use embedded_graphics::prelude::{Drawable as _, Point};
use hachi_bridge::AtomicFile;
use hachi_inference::ImageView;
use hachi_people::detect::Found;
use hachi_people::identify::Status;
use hachi_people::track::Track;

use crate::exit::Failure;
use crate::images::Rgb;
use canvas::{blank, frame, label, tint};

/// What is drawn into a picture.
#[derive(Debug, Clone, Copy)]
pub struct Labels<'a> {
    /// Everyone who is followed.
    pub tracks: &'a [Track],
    /// Where enrolled people are.
    pub statuses: &'a [Status],
    /// What the detector found, in the order of the detections that tracks speak of.
    pub found: &'a [Found],
    /// Written in a corner.
    pub caption: &'a str,
}

/// Colours of tracks, one after the other; neighbours in number are easily told apart.
const TRACKS: [Rgb888; 8] = [
    Rgb888::new(86, 180, 233),
    Rgb888::new(230, 159, 0),
    Rgb888::new(0, 158, 115),
    Rgb888::new(204, 121, 167),
    Rgb888::new(240, 228, 66),
    Rgb888::new(0, 114, 178),
    Rgb888::new(213, 94, 0),
    Rgb888::new(170, 170, 170),
];
/// Of enrolled people.
const ENROLLED: Rgb888 = Rgb888::new(255, 40, 40);

/// The picture with everybody marked: those who are enrolled in red with their condition, the others by
/// the numbers of their tracks.
pub fn annotate(image: &ImageView<'_>, labels: &Labels<'_>) -> Rgb {
    let mut picture = Rgb {
        width: image.width(),
        height: image.height(),
        pixels: image.rgb().to_vec(),
    };
    let seen = labels
        .tracks
        .iter()
        .filter(|track| track.is_confirmed() && track.is_seen());
    let mut later = Vec::new();
    for track in seen {
        let person = labels
            .statuses
            .iter()
            .find(|status| status.unseen_s == 0.0 && status.track == Some(track.id));
        let color = match person {
            Some(_) => ENROLLED,
            None => TRACKS[track.id as usize % TRACKS.len()],
        };
        let found = track.detection.and_then(|index| labels.found.get(index));
        if let Some((found, mask)) = found.and_then(|found| Some((found, found.mask.as_ref()?))) {
            tint(&mut picture, &found.bounding_box, color, |at| {
                mask.covers(at)
            });
        }
        later.push((track, person, color));
    }
    // Enrolled people last, over everybody else.
    later.sort_by_key(|(_, person, _)| person.is_some());
    for (track, person, color) in later {
        let b = track.bounding_box();
        frame(
            &mut picture,
            &b,
            color,
            if person.is_some() { 2 } else { 1 },
        );
        let text = match person {
            Some(status) => format!("P{} {}", status.person.0, status.condition.name()),
            None => track.id.to_string(),
        };
        label(&mut picture, [b.left, b.top], &text, color);
    }
    label(&mut picture, [0.0, 0.0], labels.caption, Rgb888::WHITE);
    picture
}

/// Many pictures in one.
#[derive(Debug, Clone)]
pub struct ContactSheet {
    columns: usize,
    pictures: Vec<Rgb>,
}

/// Pixels between two pictures.
const GAP: usize = 4;
/// The widest picture on a sheet.
const MOST_COLUMNS: usize = 480;

impl ContactSheet {
    /// An empty one with so many pictures in a row.
    pub fn new(columns: usize) -> Self {
        Self {
            columns: columns.max(1),
            pictures: Vec::new(),
        }
    }

    /// Adds a picture; one that is wider than others are is made smaller.
    pub fn push(&mut self, picture: &Rgb) {
        let by = picture.width.div_ceil(MOST_COLUMNS);
        self.pictures.push(picture.shrunk(by));
    }

    /// All of them, row by row, each in a cell as large as the largest.
    pub fn picture(&self) -> Rgb {
        let width = self.pictures.iter().map(|p| p.width).max().unwrap_or(1);
        let height = self.pictures.iter().map(|p| p.height).max().unwrap_or(1);
        let columns = self.columns.min(self.pictures.len()).max(1);
        let rows = self.pictures.len().div_ceil(columns).max(1);
        let size = [columns * (width + GAP) - GAP, rows * (height + GAP) - GAP];
        let mut sheet = blank(size, Rgb888::WHITE);
        for (index, picture) in self.pictures.iter().enumerate() {
            let at = Point::new(
                (index % columns * (width + GAP)) as i32,
                (index / columns * (height + GAP)) as i32,
            );
            let raw = ImageRaw::<Rgb888>::new(&picture.pixels, picture.width as u32);
            let Ok(()) = Image::new(&raw, at).draw(&mut sheet);
        }
        sheet
    }

    /// Writes all of them to a PNG file.
    ///
    /// # Errors
    /// It can't be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        write_png(path, &self.picture())
    }
}

/// Writes a picture to a PNG file.
///
/// # Errors
/// It can't be written.
pub fn write_png(path: &Path, picture: &Rgb) -> Result<(), Failure> {
    let mut file = AtomicFile::create(path).map_err(|error| Failure::unwritten(&error))?;
    let bytes = picture
        .to_png()
        .map_err(|error| Failure::new(error, "please report this"))?;
    file.write(&bytes)
        .map_err(|error| Failure::unwritten(&error))?;
    file.commit().map_err(|error| Failure::unwritten(&error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_people::BoundingBox;
    use hachi_people::identify::{AppearanceModel, Identifier, IdentifierConfig};
    use hachi_people::track::{Detection, Frame, Tracker, TrackerConfig};

    fn pixel(picture: &Rgb, x: usize, y: usize) -> Rgb888 {
        let at = 3 * (y * picture.width + x);
        let [red, green, blue] = picture.pixels[at..at + 3].try_into().unwrap();
        Rgb888::new(red, green, blue)
    }

    const fn grey(shade: u8) -> Rgb888 {
        Rgb888::new(shade, shade, shade)
    }

    #[test]
    fn boxes_have_their_track_s_colour_and_the_enrolled_person_s_is_red() {
        let mut tracker = Tracker::new(TrackerConfig::default());
        let detections = [20.0, 60.0].map(|left| Detection {
            bounding_box: BoundingBox::new(left, 30.0, 20.0, 50.0),
            score: 0.95,
        });
        for _ in 0..4 {
            tracker.step(&Frame {
                dt_s: 0.1,
                detections: &detections,
                features: None,
            });
        }
        let tracks = tracker.tracks();
        let mut identifier = Identifier::new(IdentifierConfig::default());
        let model = AppearanceModel::first(&[1.0, 0.0]).unwrap();
        identifier.enrol(model, Some(tracks[1].id));
        identifier.step(tracks, None, None, 0.1);
        let statuses: Vec<_> = identifier.statuses().copied().collect();
        let wall = blank([100, 100], grey(100));
        let image = wall.view().unwrap();
        let picture = annotate(
            &image,
            &Labels {
                tracks,
                statuses: &statuses,
                found: &[],
                caption: "",
            },
        );
        // The lower left corners of both boxes, a place between them, a place inside.
        assert_eq!(pixel(&picture, 20, 79), TRACKS[tracks[0].id as usize]);
        assert_eq!(pixel(&picture, 60, 79), ENROLLED);
        assert_eq!(pixel(&picture, 50, 79), grey(100));
        assert_eq!(pixel(&picture, 30, 60), grey(100));
    }

    #[test]
    fn a_sheet_holds_its_pictures_row_by_row() {
        let mut sheet = ContactSheet::new(2);
        for shade in [10, 20, 30] {
            sheet.push(&Rgb {
                width: 4,
                height: 2,
                pixels: vec![shade; 24],
            });
        }
        let picture = sheet.picture();
        assert_eq!((picture.width, picture.height), (8 + GAP, 4 + GAP));
        assert_eq!(pixel(&picture, 0, 0), grey(10));
        assert_eq!(pixel(&picture, 4 + GAP, 1), grey(20));
        assert_eq!(pixel(&picture, 3, 2 + GAP), grey(30));
        assert_eq!(pixel(&picture, 4 + GAP, 2 + GAP), Rgb888::WHITE);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.png");
        sheet.write(&path).unwrap();
        assert_eq!(crate::images::read(&path).unwrap(), picture);
    }

    #[test]
    fn a_large_picture_is_made_smaller_on_a_sheet() {
        let wide = MOST_COLUMNS + 2;
        let mut sheet = ContactSheet::new(1);
        sheet.push(&Rgb {
            width: wide,
            height: 2,
            pixels: (0..2 * wide)
                .flat_map(|at| [(at % 2 * 10) as u8, 0, 200])
                .collect(),
        });
        let picture = sheet.picture();
        assert_eq!((picture.width, picture.height), (wide / 2, 1));
        assert_eq!(picture.pixels, [5, 0, 200].repeat(wide / 2));
    }

    #[test]
    fn a_label_stays_in_the_picture_and_lies_above_its_place() {
        let mut picture = blank([60, 40], grey(100));
        label(&mut picture, [50.0, 30.0], "12", Rgb888::WHITE);
        let changed: Vec<_> = (0..60 * 40)
            .map(|at| (at % 60, at / 60))
            .filter(|&(x, y)| pixel(&picture, x, y) != grey(100))
            .collect();
        // Two letters of 6 by 10 pixels.
        let bounds = |of: fn(&(usize, usize)) -> usize| {
            let places = changed.iter().map(of);
            (places.clone().min().unwrap(), places.max().unwrap())
        };
        assert_eq!(bounds(|at| at.0), (48, 59));
        assert_eq!(bounds(|at| at.1), (20, 29));
        assert!(
            changed
                .iter()
                .any(|&(x, y)| pixel(&picture, x, y) == Rgb888::WHITE)
        );
    }
}
