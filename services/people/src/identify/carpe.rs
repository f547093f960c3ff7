//! CARPE-ID: the user picks a track, and from then on the person is known, whatever becomes of it.
//!
//! In: the tracks and features of each frame. Out: a [`Status`] for each person. A person is where
//! their track is; when it is gone, whoever of the other tracks looks like them, nearest first. All
//! the while what they look like is learnt.
//!
//! As the publication's Algorithm 1, with what it leaves open: the distance is computed for a person
//! matched by track too; in frames where a person's track looks like them, everybody else apart from
//! them is a distractor and stays one until their track ends (the blacklist).
//!
//! And with what trackers do to it. They hand a track on where people cross: whoever comes out of cover,
//! or from beside somebody, or is cut off by the picture's edge, has to look like the person, and nothing
//! is learnt before they do. Where
//! looks can't tell the two apart, nobody is followed until the user points at somebody again, or the
//! other one has been gone for five minutes. A single look is often wrong: it takes the mean of some to
//! find the person, and the more, the nearer it has to be.

use super::AppearanceModel;
use super::person::Person;
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
    /// On their track, which does not look like them any more, or which somebody has who looks the same.
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
        let status = Status {
            person,
            condition,
            track,
            confidence: 0.0,
            distance: None,
            unseen_s: 0.0,
        };
        self.people.push(Person::new(model, status));
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

    /// Takes in the tracks of one frame, the features of its detections, and how wide the picture is,
    /// where there is one.
    pub fn step(
        &mut self,
        tracks: &[Track],
        features: Option<Features<'_>>,
        columns: Option<usize>,
        dt_s: f64,
    ) {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        let look = |track: &Track| features?.get(track.detection?);
        for person in &mut self.people {
            person.begin(tracks, look, dt_s);
        }
        for person in &mut self.people {
            person.stay(tracks, look, self.config.adapts, dt_s, columns);
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
                    let taken = |other: &Person| {
                        other.status.unseen_s == 0.0 && other.status.track == Some(track.id)
                    };
                    if self.people.iter().any(taken) {
                        continue;
                    }
                    let share = person.candidate(track, look(track));
                    if let Some(share) = share
                        && best.is_none_or(|(least, ..)| share < least)
                    {
                        best = Some((share, p, t));
                    }
                }
            }
            let Some((_, p, t)) = best else { return };
            self.people[p].find(&tracks[t], look(&tracks[t]));
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
        columns: Option<usize>,
    }

    impl World {
        fn new() -> Self {
            Self {
                tracker: Tracker::new(TrackerConfig::default()),
                identifier: Identifier::new(IdentifierConfig::default()),
                columns: None,
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
                .step(self.tracker.tracks(), Some(features), self.columns, DT_S);
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

    #[test]
    fn whoever_enters_where_the_person_leaves_the_picture_is_not_followed() {
        let mut world = World::new();
        world.columns = Some(700);
        for _ in 0..5 {
            world.show(&[(450.0, RED)]);
        }
        let track = world.track_at(450.0);
        world
            .identifier
            .enrol(AppearanceModel::first(&RED).unwrap(), track);
        for k in 0..22 {
            world.show(&[(450.0 + 10.0 * f64::from(k), RED)]);
        }
        assert_eq!(world.status().condition, Condition::Seen);
        // At the right edge; the next one in is on the person's track.
        for k in 0..22 {
            world.show(&[(660.0 - 10.0 * f64::from(k), BLUE)]);
            assert_ne!(world.status().unseen_s, 0.0, "{k}");
        }
        assert_eq!(world.track_at(450.0), track);
        let model = world.identifier.model(PersonId(1)).unwrap();
        assert!(model.distance(&BLUE) > model.threshold());
    }

    #[test]
    fn a_part_of_the_person_on_a_track_of_its_own_is_no_distractor() {
        let mut world = picked();
        // Legs and all are found; then the whole is not any more, for longer than its track lasts.
        for _ in 0..20 {
            world.show(&[(0.0, RED), (300.0, BLUE), (18.0, RED)]);
        }
        let part = world.track_at(18.0);
        assert_ne!(part, world.track_at(0.0));
        for _ in 0..30 {
            world.show(&[(300.0, BLUE), (18.0, RED)]);
        }
        assert_eq!(world.status().track, part);
        assert_eq!(world.status().condition, Condition::Seen);
    }

    #[test]
    fn a_track_that_never_looked_like_the_person_and_begins_to_was_handed_on() {
        let mut world = picked();
        let blue = world.track_at(300.0);
        // The person goes; later the other track shows them.
        for _ in 0..30 {
            world.show(&[(300.0, BLUE)]);
        }
        assert_eq!(world.status().condition, Condition::Searching);
        for _ in 0..6 {
            world.show(&[(300.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Found);
        assert_eq!(world.status().track, blue);
    }

    #[test]
    fn nobody_is_followed_where_looks_cannot_tell_two_apart_who_crossed() {
        let mut world = World::new();
        for _ in 0..5 {
            world.show(&[(0.0, RED), (300.0, RED)]);
        }
        let (own, twin) = (world.track_at(0.0), world.track_at(300.0));
        world
            .identifier
            .enrol(AppearanceModel::first(&RED).unwrap(), own);
        for k in 0..26 {
            world.show(&[(f64::from(k) * 10.0, RED), (300.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Seen);
        // One hides the other for a moment.
        for _ in 0..5 {
            world.show(&[(300.0, RED)]);
        }
        for k in 0..20 {
            world.show(&[(280.0 - 10.0 * f64::from(k), RED), (300.0, RED)]);
            assert_ne!(world.status().condition, Condition::Seen);
            assert_ne!(world.status().condition, Condition::Found);
        }
        assert!([own, twin].contains(&world.track_at(300.0)));
        // Both go; whoever comes back looks the same.
        for _ in 0..40 {
            world.show(&[]);
        }
        for _ in 0..10 {
            world.show(&[(100.0, RED)]);
        }
        assert_eq!(world.status().condition, Condition::Searching);
    }

    #[test]
    fn somebody_who_passes_close_by_is_not_learnt() {
        let mut world = picked();
        let before = world.identifier.model(PersonId(1)).unwrap().clone();
        // Beside each other, the other one half before the person.
        for k in 0..26 {
            world.show(&[(0.0, RED), (300.0 - 11.0 * f64::from(k), BLUE)]);
        }
        let away = world.identifier.model(PersonId(1)).unwrap().clone();
        for _ in 0..20 {
            let mixed = std::array::from_fn(|i| 0.6 * RED[i] + 0.4 * BLUE[i]);
            world.show(&[(0.0, mixed), (25.0, BLUE)]);
        }
        let model = world.identifier.model(PersonId(1)).unwrap();
        assert_eq!(*model, away);
        assert_ne!(before, away);
    }
}
