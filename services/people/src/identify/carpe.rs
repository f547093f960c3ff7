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
//! or from beside somebody, has to look like the person, and nothing is learnt before they do. Where
//! looks can't tell the two apart, nobody is followed until the user points at somebody again, or the
//! other one has been gone for five minutes. A single look is often wrong: it takes the mean of some to
//! find the person, and the more, the nearer it has to be.

use super::AppearanceModel;
use super::others::{Mean, Others, is_as_large, touch};
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

/// A person is said to be `FOUND` for so long, seconds.
const FOUND_S: f64 = 1.0;
/// A track whose distance is so many thresholds may have become somebody else's.
const UNSURE_THRESHOLDS: f64 = 2.0;
/// A last look with less confidence was unlike: beyond the threshold.
const UNLIKE_CONFIDENCE: f64 = 0.5;
/// A track whose looks were hidden for longer may have become somebody else's meanwhile, seconds.
const HIDDEN_S: f64 = 0.3;
/// One without looks for longer is not followed, seconds.
const MOST_HIDDEN_S: f64 = 2.0;
/// So many looks, in the mean near enough, say that a track may be the person's,
const PROMISING: u32 = 3;
/// and so many that it is, when that was in doubt.
const VOUCHING: u32 = 10;
/// Somebody who looks so much more like the person than the one on a track in doubt is the person.
const BETTER: f64 = 0.75;
/// Somebody who looks the same is taken to be about for so long, seconds.
const ABOUT_S: f64 = 300.0;
/// Room for so many is made at once.
const USUAL_DOUBLES: usize = 16;

struct Person {
    model: AppearanceModel,
    others: Others,
    /// Something hid the person or touched them: looks since then. Until they vouch for the person
    /// nothing is learnt.
    doubt: Option<Mean>,
    /// Tracks that may be the person's instead of their own: looks can't tell them apart. With each how
    /// long ago it ended, seconds.
    doubles: Vec<(u64, f64)>,
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
            others: Others::new(),
            doubt: None,
            doubles: Vec::with_capacity(USUAL_DOUBLES),
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
            person.begin(tracks, look, dt_s);
        }
        for person in &mut self.people {
            person.stay(tracks, look, self.config.adapts, dt_s);
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

impl Person {
    /// A new frame: nobody is in view yet, and tracks that have ended are forgotten.
    fn begin<'a>(
        &mut self,
        tracks: &[Track],
        look: impl Fn(&Track) -> Option<&'a [f32]>,
        dt_s: f64,
    ) {
        self.others.retain(tracks);
        for track in tracks.iter().filter(|track| track.is_seen()) {
            if let Some(distance) = look(track).map(|feature| self.model.distance(feature)) {
                self.others.look(track.id, distance);
            }
        }
        // One whose track has ended may come back on another, for as long as people stay about.
        let threshold = self.model.threshold_of(VOUCHING);
        self.doubles.retain_mut(|(double, gone_s)| {
            if tracks.iter().any(|track| track.id == *double) {
                return self.others.latest(*double).value < threshold;
            }
            *gone_s += dt_s;
            *gone_s < ABOUT_S
        });
        self.since_found_s += dt_s;
        self.hidden_s += dt_s;
        // A frame takes time even where the clock says none: whoever is in view sets it back.
        self.status.unseen_s += dt_s.max(f64::MIN_POSITIVE);
        self.status.distance = None;
    }

    /// Distance in thresholds.
    fn share(&self, feature: Option<&[f32]>) -> Option<f64> {
        let distance = self.model.distance(feature?);
        distance
            .is_finite()
            .then(|| distance / self.model.threshold())
    }

    /// Stays on the track, if it is seen and shows them. Everybody else is a distractor then.
    fn stay<'a>(
        &mut self,
        tracks: &[Track],
        look: impl Fn(&Track) -> Option<&'a [f32]> + Copy,
        adapts: bool,
        dt_s: f64,
    ) {
        let own = tracks
            .iter()
            .find(|track| Some(track.id) == self.status.track);
        let Some(own) = own else { return };
        let others = || tracks.iter().filter(|track| track.id != own.id);
        let feature = look(own);
        self.notice_doubles(own, others(), feature.is_some());
        let share = self.share(feature);
        let hidden = share.is_none() && self.hidden_s > MOST_HIDDEN_S;
        if !own.is_seen() || hidden || self.is_handed_on(own, share, others(), look) {
            return;
        }
        let was_unlike = self.status.confidence < UNLIKE_CONFIDENCE;
        let doubtful = self.doubt.is_some() || !self.doubles.is_empty();
        self.appear(own, feature, adapts && !doubtful);
        if !self.doubles.is_empty() || share.is_none() && was_unlike {
            self.status.condition = Condition::Unsure;
        }
        if doubtful || share.is_none_or(|share| share > 1.0) {
            return;
        }
        for other in others().filter(|track| track.is_seen()) {
            let share = self.share(look(other));
            self.others.beside(own, other, share, dt_s);
        }
    }

    /// Whether the track shows somebody else by now, as far as looks say. They are asked where the two
    /// may have been taken for each other, until enough of them vouch for the person.
    fn is_handed_on<'a, 'b>(
        &mut self,
        own: &Track,
        share: Option<f64>,
        mut others: impl Iterator<Item = &'b Track> + Clone,
        look: impl Fn(&Track) -> Option<&'a [f32]>,
    ) -> bool {
        let alongside = |other: &Track| {
            self.others.was_apart(other.id) && touch(own, other) && is_as_large(own, other)
        };
        let touched = others.clone().any(alongside);
        if touched || self.hidden_s > HIDDEN_S {
            self.doubt.get_or_insert_default();
        }
        let (Some(mut doubt), Some(share)) = (self.doubt, share) else {
            return false;
        };
        doubt.add(share, VOUCHING);
        self.doubt = Some(doubt);
        let latest = self.others.latest(own.id).value / self.model.threshold();
        let looks_better = |other: &Track| {
            let other = self.candidate(other, look(other));
            other.is_some_and(|other| other < BETTER * latest)
        };
        if doubt.value > 1.0 || others.any(looks_better) {
            return true;
        }
        if doubt.count >= VOUCHING && !touched {
            self.doubt = None;
        }
        false
    }

    /// Somebody who looks like the person touches their track while one of the two is not to be seen:
    /// they may have changed tracks, and nobody can tell, until somebody turns out to look otherwise.
    fn notice_doubles<'a>(
        &mut self,
        own: &Track,
        others: impl Iterator<Item = &'a Track>,
        is_looked_at: bool,
    ) {
        let threshold = self.model.threshold_of(VOUCHING);
        for other in others {
            let hidden = !is_looked_at || !other.is_seen();
            let double = other.is_confirmed()
                && hidden
                && touch(own, other)
                && self.others.is_double(other.id, threshold);
            if double && !self.doubles.iter().any(|(id, _)| *id == other.id) {
                self.doubles.push((other.id, 0.0));
            }
        }
    }

    /// How far a track's latest looks are from the person, in thresholds, if it may be theirs. Looks are
    /// evidence enough: the tracker need not believe in it yet.
    fn candidate(&self, track: &Track, feature: Option<&[f32]>) -> Option<f64> {
        let share = self.share(feature).filter(|share| *share < 1.0)?;
        let open = self.doubles.is_empty()
            && track.is_seen()
            && !self.others.is_somebody_else(track.id, share);
        let latest = self.others.latest(track.id);
        let near =
            latest.count >= PROMISING && latest.value < self.model.threshold_of(latest.count);
        (open && near).then(|| latest.value / self.model.threshold())
    }

    /// Is found on another track.
    fn find(&mut self, track: &Track, feature: Option<&[f32]>) {
        self.since_found_s = 0.0;
        self.doubt = Some(Mean::default());
        self.appear(track, feature, false);
    }

    /// Is in view on this track.
    fn appear(&mut self, track: &Track, feature: Option<&[f32]>, learns: bool) {
        self.status.track = Some(track.id);
        self.status.unseen_s = 0.0;
        let distance = feature.map(|feature| self.model.distance(feature));
        self.status.distance = distance.filter(|distance| distance.is_finite());
        let (Some(distance), Some(feature)) = (self.status.distance, feature) else {
            return;
        };
        self.hidden_s = 0.0;
        let share = distance / self.model.threshold();
        self.status.confidence = (1.0 - share / 2.0).max(0.0);
        self.status.condition = match share {
            share if share > UNSURE_THRESHOLDS => Condition::Unsure,
            _ => Condition::Seen,
        };
        if learns {
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
