//! CARPE-ID: the user picks a track, and from then on the person is known, whatever becomes of it.
//!
//! In: the tracks and features of each frame. Out: a [`Status`] for each person. A person is where
//! their track is; when it is gone, whoever of the other tracks looks like them, nearest first. All
//! the while what they look like is learnt.
//!
//! As the publication's Algorithm 1, with what it leaves open: the distance is computed for a person
//! matched by track too; in frames where a person's track looks like them, everybody else in the
//! image is a distractor and stays one until their track ends (the blacklist).

use super::AppearanceModel;
use crate::track::{Features, Track};

/// An enrolled person's number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PersonId(pub u32);

/// What is known of where a person is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Condition {
    /// In view, on their track.
    Seen,
    /// In view on a new track, recognised a moment ago.
    Found,
    /// On their track, which does not look like them any more.
    Unsure,
    /// Not in view since a moment ago.
    #[default]
    Lost,
    /// Not in view for longer.
    Searching,
}

impl Condition {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Seen => "SEEN",
            Self::Found => "FOUND",
            Self::Unsure => "UNSURE",
            Self::Lost => "LOST",
            Self::Searching => "SEARCHING",
        }
    }
}

/// Where a person is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Status {
    /// Who.
    pub person: PersonId,
    /// In one word.
    pub condition: Condition,
    /// Their track; while they are not in view the last one, `None` if there was none.
    pub track: Option<u64>,
    /// How much they look like themselves: 1 at no distance, a half at the threshold, 0 from twice
    /// the threshold on; 0 if not in view, the last one if they are hidden in part.
    pub confidence: f64,
    /// Statistical distance of this frame's feature, where there is one.
    pub distance: Option<f64>,
    /// Since when they are not in view, seconds; 0 if they are.
    pub unseen_s: f64,
}

/// How people are identified.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct IdentifierConfig {
    /// Whether what a person looks like goes on being learnt.
    pub adapts: bool,
    /// Not seen for longer than this is `SEARCHING`, seconds.
    pub lost_s: f64,
}

impl Default for IdentifierConfig {
    fn default() -> Self {
        Self {
            adapts: true,
            lost_s: 2.0,
        }
    }
}

/// A person is said to be `FOUND` for so long, seconds.
const FOUND_S: f64 = 1.0;
/// A track whose distance is so many thresholds may have become somebody else's.
const UNSURE_THRESHOLDS: f64 = 2.0;
/// A track whose looks were hidden for longer may have become somebody else's meanwhile, seconds.
const HIDDEN_S: f64 = 0.3;
/// Room for so many names is made at once.
const USUAL_TRACKS: usize = 128;

struct Person {
    model: AppearanceModel,
    /// Tracks of others, in order.
    blacklist: Vec<u64>,
    since_found_s: f64,
    /// Since when nothing was seen of their looks.
    hidden_s: f64,
    status: Status,
}

/// Knows enrolled people among tracks.
pub struct Identifier {
    config: IdentifierConfig,
    people: Vec<Person>,
    last_person: u32,
}

impl Identifier {
    /// One that knows nobody.
    pub fn new(config: IdentifierConfig) -> Self {
        Self {
            config,
            people: Vec::new(),
            last_person: 0,
        }
    }

    /// Enrols a person by what they look like: a calibration, a model kept from another day, or
    /// [`AppearanceModel::first`] of the track that the user picked, which is named then.
    pub fn enrol(&mut self, model: AppearanceModel, track: Option<u64>) -> PersonId {
        self.last_person += 1;
        let person = PersonId(self.last_person);
        let condition = match track {
            Some(_) => Condition::Seen,
            None => Condition::Searching,
        };
        self.people.push(Person {
            model,
            blacklist: Vec::with_capacity(USUAL_TRACKS),
            since_found_s: f64::INFINITY,
            hidden_s: 0.0,
            status: Status {
                person,
                condition,
                track,
                confidence: 0.0,
                distance: None,
                unseen_s: 0.0,
            },
        });
        person
    }

    /// Forgets a person. Whether there was one.
    pub fn forget(&mut self, person: PersonId) -> bool {
        let before = self.people.len();
        self.people.retain(|p| p.status.person != person);
        self.people.len() < before
    }

    /// What a person looks like by now.
    pub fn model(&self, person: PersonId) -> Option<&AppearanceModel> {
        let found = self.people.iter().find(|p| p.status.person == person);
        found.map(|p| &p.model)
    }

    /// Where everybody is, in the order in which they were enrolled.
    pub fn statuses(&self) -> impl Iterator<Item = &Status> {
        self.people.iter().map(|person| &person.status)
    }

    /// Takes in the tracks of one frame, and the features of its detections.
    pub fn step(&mut self, tracks: &[Track], features: Option<Features<'_>>, dt_s: f64) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        let look = |track: &Track| features?.get(track.detection?);
        for person in &mut self.people {
            person.begin(tracks, dt_s);
        }
        for person in &mut self.people {
            person.stay(tracks, look, self.config.adapts);
        }
        self.search(tracks, look);
        for person in &mut self.people {
            person.judge(self.config.lost_s);
        }
    }

    /// Everyone who is not in view: the pair of person and track that look most alike first.
    fn search<'a>(&mut self, tracks: &[Track], look: impl Fn(&Track) -> Option<&'a [f32]>) {
        loop {
            let mut best: Option<(f64, usize, usize)> = None;
            for (p, person) in self.people.iter().enumerate() {
                if person.status.unseen_s == 0.0 {
                    continue;
                }
                for (t, track) in tracks.iter().enumerate() {
                    let Some(distance) = self.candidate(person, track, &look) else {
                        continue;
                    };
                    let share = distance / person.model.threshold();
                    if share < 1.0 && best.is_none_or(|(least, ..)| share < least) {
                        best = Some((share, p, t));
                    }
                }
            }
            let Some((share, p, t)) = best else { return };
            let person = &mut self.people[p];
            let distance = share * person.model.threshold();
            person.since_found_s = 0.0;
            person.appear(
                &tracks[t],
                Some(distance),
                look(&tracks[t]),
                self.config.adapts,
            );
        }
    }

    /// How far a track is from a person, if it may be theirs at all.
    fn candidate<'a>(
        &self,
        person: &Person,
        track: &Track,
        look: impl Fn(&Track) -> Option<&'a [f32]>,
    ) -> Option<f64> {
        let taken =
            |other: &Person| other.status.unseen_s == 0.0 && other.status.track == Some(track.id);
        let open = track.is_confirmed()
            && track.is_seen()
            && person.blacklist.binary_search(&track.id).is_err()
            && !self.people.iter().any(taken);
        open.then(|| look(track).map(|feature| person.model.distance(feature)))?
    }
}

impl Person {
    /// A new frame: nobody is in view yet, and tracks that have ended are forgotten.
    fn begin(&mut self, tracks: &[Track], dt_s: f64) {
        self.blacklist
            .retain(|id| tracks.iter().any(|track| track.id == *id));
        self.since_found_s += dt_s;
        self.hidden_s += dt_s;
        // A frame takes time even where the clock says none: whoever is in view sets it back.
        self.status.unseen_s += dt_s.max(f64::MIN_POSITIVE);
        self.status.distance = None;
    }

    /// Stays on the track, if it is seen. Everybody else is a distractor then.
    fn stay<'a>(
        &mut self,
        tracks: &[Track],
        look: impl Fn(&Track) -> Option<&'a [f32]>,
        adapts: bool,
    ) {
        let own = tracks
            .iter()
            .find(|track| Some(track.id) == self.status.track);
        let Some(own) = own.filter(|track| track.is_seen()) else {
            return;
        };
        let feature = look(own);
        let distance = feature.map(|feature| self.model.distance(feature));
        let distance = distance.filter(|distance| distance.is_finite());
        // Hidden for a moment, two people may have changed tracks: whoever comes out has to look like
        // the person, or is searched for like everybody else.
        let unlike = |d: f64| d > self.model.threshold();
        if self.hidden_s > HIDDEN_S && distance.is_some_and(unlike) {
            return;
        }
        // A track that jumps to somebody else must not make a distractor of the person.
        let sure = distance.is_some_and(|d| d <= self.model.threshold());
        self.appear(own, distance, feature, adapts);
        if !sure {
            return;
        }
        for other in tracks
            .iter()
            .filter(|track| track.id != own.id && track.is_seen())
        {
            if let Err(place) = self.blacklist.binary_search(&other.id) {
                self.blacklist.insert(place, other.id);
            }
        }
    }

    /// Is in view on this track.
    fn appear(
        &mut self,
        track: &Track,
        distance: Option<f64>,
        feature: Option<&[f32]>,
        adapts: bool,
    ) {
        self.status.track = Some(track.id);
        self.status.unseen_s = 0.0;
        self.status.distance = distance;
        let (Some(distance), Some(feature)) = (distance, feature) else {
            return;
        };
        self.hidden_s = 0.0;
        let share = distance / self.model.threshold();
        self.status.confidence = (1.0 - share / 2.0).max(0.0);
        self.status.condition = match share {
            share if share > UNSURE_THRESHOLDS => Condition::Unsure,
            _ => Condition::Seen,
        };
        if adapts {
            self.model.learn(feature, distance);
        }
    }

    /// The condition in one word, once all is known of a frame.
    fn judge(&mut self, lost_s: f64) {
        let status = &mut self.status;
        if status.unseen_s > 0.0 {
            status.confidence = 0.0;
            let never = status.track.is_none();
            status.condition = match never || status.unseen_s > lost_s {
                true => Condition::Searching,
                false => Condition::Lost,
            };
        } else if status.condition == Condition::Unsure {
            // Said already; a person who is hidden in part keeps what was said last.
        } else if self.since_found_s < FOUND_S {
            status.condition = Condition::Found;
        } else {
            status.condition = Condition::Seen;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoundingBox;
    use crate::track::{Detection, Frame, Tracker, TrackerConfig};

    const DT_S: f64 = 0.1;

    /// A small world: people at places, each with looks of their own.
    struct World {
        tracker: Tracker,
        identifier: Identifier,
    }

    impl World {
        fn new() -> Self {
            Self {
                tracker: Tracker::new(TrackerConfig::default()),
                identifier: Identifier::new(IdentifierConfig::default()),
            }
        }

        /// One frame of people: left edge and looks of each. The tracker goes by motion alone.
        fn show(&mut self, people: &[(f64, [f32; 4])]) {
            let detections: Vec<_> = people
                .iter()
                .map(|(left, _)| Detection {
                    bounding_box: BoundingBox::new(*left, 0.0, 40.0, 100.0),
                    score: 0.97,
                })
                .collect();
            let looks: Vec<f32> = people.iter().flat_map(|(_, looks)| *looks).collect();
            self.tracker.step(&Frame {
                dt_s: DT_S,
                detections: &detections,
                features: None,
            });
            let features = Features {
                dimension: 4,
                values: &looks,
                same_person_distance: 0.5,
            };
            self.identifier
                .step(self.tracker.tracks(), Some(features), DT_S);
        }

        fn track_at(&self, left: f64) -> Option<u64> {
            let near = |track: &&Track| (track.bounding_box().left - left).abs() < 15.0;
            self.tracker
                .tracks()
                .iter()
                .find(near)
                .map(|track| track.id)
        }

        fn status(&self) -> Status {
            *self.identifier.statuses().next().unwrap()
        }
    }

    const RED: [f32; 4] = [0.9, 0.3, 0.3, 0.1];
    const BLUE: [f32; 4] = [0.1, 0.3, 0.9, 0.3];

    /// A person in red is picked beside one in blue.
    fn picked() -> World {
        let mut world = World::new();
        for _ in 0..5 {
            world.show(&[(0.0, RED), (300.0, BLUE)]);
        }
        let track = world.track_at(0.0);
        let model = AppearanceModel::first(&RED).unwrap();
        world.identifier.enrol(model, track);
        for _ in 0..30 {
            world.show(&[(0.0, RED), (300.0, BLUE)]);
        }
        world
    }

    #[test]
    fn a_person_who_leaves_and_comes_back_is_found_on_a_new_track() {
        let mut world = picked();
        assert_eq!(world.status().condition, Condition::Seen);
        let before = world.status().track;
        world.show(&[(300.0, BLUE)]);
        assert_eq!(world.status().condition, Condition::Lost);
        for _ in 0..40 {
            world.show(&[(300.0, BLUE)]);
        }
        assert_eq!(world.status().condition, Condition::Searching);
        assert_eq!(world.status().confidence, 0.0);
        for _ in 0..4 {
            world.show(&[(300.0, BLUE), (600.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Found);
        assert_eq!(world.status().track, world.track_at(600.0));
        assert_ne!(world.status().track, before);
        for _ in 0..15 {
            world.show(&[(300.0, BLUE), (600.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Seen);
    }

    #[test]
    fn a_distractor_in_the_same_clothes_is_not_followed_while_their_track_lasts() {
        let mut world = World::new();
        for _ in 0..5 {
            world.show(&[(0.0, RED), (300.0, RED)]);
        }
        let track = world.track_at(0.0);
        world
            .identifier
            .enrol(AppearanceModel::first(&RED).unwrap(), track);
        for _ in 0..10 {
            world.show(&[(0.0, RED), (300.0, RED)]);
        }
        for _ in 0..50 {
            world.show(&[(300.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Searching);
    }

    #[test]
    fn looks_that_change_slowly_are_learnt() {
        let mut world = picked();
        for k in 0..400 {
            let share = k as f32 / 399.0;
            let looks =
                std::array::from_fn(|i| RED[i] * (1.0 - share) + [0.1, 0.9, 0.1, 0.3][i] * share);
            world.show(&[(0.0, looks), (300.0, BLUE)]);
        }
        let model = world.identifier.model(PersonId(1)).unwrap();
        assert!(model.distance(&[0.1, 0.9, 0.1, 0.3]) < model.threshold());
        assert!(model.distance(&BLUE) > model.threshold());
    }

    #[test]
    fn two_people_are_known_at_once_and_one_is_forgotten() {
        let mut world = picked();
        let blue = world.track_at(300.0);
        let second = world
            .identifier
            .enrol(AppearanceModel::first(&BLUE).unwrap(), blue);
        // Both leave, and come back on other sides.
        for _ in 0..40 {
            world.show(&[]);
        }
        for _ in 0..5 {
            world.show(&[(500.0, RED), (100.0, BLUE)]);
        }
        let tracks: Vec<_> = world.identifier.statuses().map(|s| s.track).collect();
        assert_eq!(tracks, [world.track_at(500.0), world.track_at(100.0)]);
        assert!(world.identifier.forget(second) && !world.identifier.forget(second));
        assert_eq!(world.identifier.statuses().count(), 1);
    }

    #[test]
    fn whoever_comes_out_on_the_person_s_track_and_looks_like_somebody_else_is_not_followed() {
        let mut world = picked();
        for _ in 0..5 {
            world.show(&[(300.0, BLUE)]);
        }
        // Half a second later somebody in blue stands where the person was.
        world.show(&[(0.0, BLUE), (300.0, BLUE)]);
        assert_eq!(world.status().condition, Condition::Lost);
        // The person comes out elsewhere.
        for _ in 0..4 {
            world.show(&[(0.0, BLUE), (300.0, BLUE), (600.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Found);
        assert_eq!(world.status().track, world.track_at(600.0));
    }

    #[test]
    fn a_track_that_jumps_to_somebody_else_is_said_to_be_unsure() {
        let mut world = picked();
        world.show(&[(0.0, BLUE), (300.0, BLUE)]);
        assert_eq!(world.status().condition, Condition::Unsure);
        assert!(world.status().confidence < 0.5);
    }
}
