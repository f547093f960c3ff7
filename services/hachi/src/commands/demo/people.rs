//! Who was seen on the robot's walk, and how well its person was followed.
//!
//! In: what the service made of each picture, who was truly in it. Out: figures and pictures. The user
//! is played here too: points at the robot's person as soon as there is somebody to point at.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hachi_hal::Stamp;
use hachi_inference::ImageView;
use hachi_people::followed::{ScoreKeeper, Sight};
use hachi_people::pointing::track_at;
use hachi_people::track::Track;
use hachi_people::watch::Watch;
use hachi_world::CameraConfig;
use serde::Serialize;

use crate::people_pictures::{ContactSheet, Labels, annotate};
use crate::people_truth::{followed, pointed_at, sight};
use crate::service::messages::Looked;
use crate::service::simulator::SeenPeople;
use crate::service::tracking::Audience;

/// The identity of the robot's person: the first of the building's people.
const PERSON: u32 = 1;
/// The user has looked around by then, seconds.
const POINTS_AFTER_S: f64 = 1.5;
/// Pictures of the walk, and in a row.
const PICTURES: f64 = 9.0;
const COLUMNS: usize = 3;

/// The camera of the demo: the smallest pictures of a D455, five in two seconds, looking up a little.
pub fn camera() -> CameraConfig {
    CameraConfig {
        period_ns: 400_000_000,
        ..CameraConfig::d455(424, 240, 0.2)
    }
}

/// What is told of the people.
#[derive(Debug, Clone, Serialize)]
pub struct PeopleReport {
    /// Pictures that were looked at.
    pub pictures: u64,
    /// People who truly were in clear sight at some time.
    pub truly_seen: usize,
    /// Numbers of the tracks that were believed.
    pub tracks: Vec<u64>,
    /// The robot's person; absent where the user pointed at nobody.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonReport>,
    /// From the middle of an exposure to where the person is, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shutter_to_target_p99_ms: Option<f64>,
}

/// How well the robot's person was followed.
#[derive(Debug, Clone, Serialize)]
pub struct PersonReport {
    /// The number they were enrolled under.
    pub id: u32,
    /// What is known of them at the end.
    pub condition: &'static str,
    /// Time in clear sight since the user pointed at them.
    pub visible_s: f64,
    /// Time of that in which they were followed.
    pub tracked_s: f64,
    /// The share.
    pub tracked_share: f64,
    /// Time in which somebody or something else was followed.
    pub wrong_s: f64,
    /// How often they were known again, of how often they had to be.
    pub re_identified: u32,
    /// How often they had to be.
    pub re_identifications_needed: u32,
    /// From when they were in clear sight again to when they were followed again, in the mean; absent
    /// where they never were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub re_identified_after_s: Option<f64>,
}

/// What was seen so far.
#[derive(Default)]
pub struct Album {
    pictures: u64,
    truly_seen: BTreeSet<u32>,
    tracks: BTreeSet<u64>,
    person: Option<(u32, &'static str)>,
    keeper: ScoreKeeper,
    /// Frames of the walk with everybody marked.
    pub sheet: Option<ContactSheet>,
}

impl Album {
    /// In figures.
    pub fn report(&self) -> PeopleReport {
        let score = self.keeper.clone().finish();
        PeopleReport {
            pictures: self.pictures,
            truly_seen: self.truly_seen.len(),
            tracks: self.tracks.iter().copied().collect(),
            person: self.person.map(|(id, condition)| PersonReport {
                id,
                condition,
                visible_s: score.visible_s,
                tracked_s: score.tracked_s,
                tracked_share: score.tracked_share(),
                wrong_s: score.wrong_s,
                re_identified: score.right,
                re_identifications_needed: score.needed,
                re_identified_after_s: score.mean_delay_s(),
            }),
            shutter_to_target_p99_ms: None,
        }
    }
}

/// Sees what the robot sees.
pub struct Spectator {
    seen: SeenPeople,
    album: Arc<Mutex<Album>>,
    start: Stamp,
    last: Option<Stamp>,
    /// From one picture of the walk to the next, seconds, and when the next is due.
    every_s: f64,
    due_s: f64,
}

impl Spectator {
    /// One for a walk that begins then and takes so long; and where it leaves what it saw.
    pub fn new(seen: SeenPeople, start: Stamp, lasts_s: f64) -> (Self, Arc<Mutex<Album>>) {
        let album = Arc::new(Mutex::new(Album::default()));
        let every_s = lasts_s / PICTURES;
        let spectator = Self {
            seen,
            album: Arc::clone(&album),
            start,
            last: None,
            every_s,
            due_s: every_s / 2.0,
        };
        (spectator, album)
    }
}

impl Audience for Spectator {
    fn see(&mut self, looked: &Looked, watch: &Watch) -> Option<[f64; 2]> {
        let stamp = looked.picture.stamp;
        let at_s = stamp.secs_since(self.start);
        let dt_s = self.last.map_or(0.0, |last| stamp.secs_since(last));
        self.last = Some(stamp);
        let people = self.seen.at(stamp)?;
        let mut album = lock(&self.album);
        let columns = looked.picture.width as u32;
        album.pictures += 1;
        let clear = people
            .iter()
            .filter(|person| sight(Some(person), columns) == Sight::Clear);
        album.truly_seen.extend(clear.map(|person| person.id));
        let believed = watch.tracks().iter().filter(|track| track.is_confirmed());
        album.tracks.extend(believed.map(|track| track.id));
        if at_s >= self.due_s {
            self.due_s += self.every_s;
            album.paste(looked, watch, at_s);
        }
        let Some(status) = watch.statuses().next() else {
            let at = pointed_at(&people, PERSON)?;
            return (at_s >= POINTS_AFTER_S && track_at(watch.tracks(), at).is_some())
                .then_some(at);
        };
        album.person = Some((status.person.0, status.condition.name()));
        let bounding_box = watch.followed(status.person).map(Track::bounding_box);
        let person = people.iter().find(|person| person.id == PERSON);
        let right = followed(bounding_box, &people, PERSON);
        album.keeper.step(dt_s, sight(person, columns), right);
        None
    }
}

impl Album {
    fn paste(&mut self, looked: &Looked, watch: &Watch, at_s: f64) {
        let picture = &looked.picture;
        let image = ImageView::new(picture.width, picture.height, &picture.rgb);
        // It was looked at, so it is one.
        let Ok(image) = image else { return };
        let statuses: Vec<_> = watch.statuses().copied().collect();
        let labels = Labels {
            tracks: watch.tracks(),
            statuses: &statuses,
            found: &looked.found,
            caption: &format!("{at_s:.1} s"),
        };
        let sheet = self.sheet.get_or_insert_with(|| ContactSheet::new(COLUMNS));
        sheet.push(&annotate(&image, &labels));
    }
}

/// The album, when nobody else looks at it.
pub fn lock(album: &Mutex<Album>) -> MutexGuard<'_, Album> {
    album.lock().unwrap_or_else(PoisonError::into_inner)
}
