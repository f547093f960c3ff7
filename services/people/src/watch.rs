//! From what was seen in a frame to who is where: tracks, and the people who are known among them.
//!
//! In: an [`Observation`] and the time since the last one; the place in the picture that the
//! user points at. Out: tracks, and for each enrolled person where they are. [`Watch::step`] is the
//! pipeline behind [`Observer::observe`](crate::observe::Observer::observe): both together take a
//! camera's frame to what is known. Robots, recordings and simulated scenes go through the same two.

use crate::identify::{AppearanceModel, Condition, Identifier, IdentifierConfig, PersonId, Status};
use crate::observe::Observation;
use crate::pointing::{Meant, NotPicked, Picked, Pointed, resolve, track_at};
use crate::track::{Features, Frame, Track, Tracker, TrackerConfig};

/// Whom the user pointed at may be hidden for so long, seconds.
const PATIENCE_S: f64 = 1.0;

/// Somebody the user pointed at and nobody found yet.
#[derive(Debug, Clone, Copy)]
struct Pick {
    at: Pointed,
    meant: Meant,
    waited_s: f64,
}

/// Follows everyone and knows some of them.
pub struct Watch {
    tracker: Tracker,
    identifier: Identifier,
    pick: Option<Pick>,
    answer: Option<Result<Picked, NotPicked>>,
}

impl Watch {
    /// One that has seen nobody, for a detector of this even score.
    pub fn new(even_score: f64, identifier: IdentifierConfig) -> Self {
        let tracker = TrackerConfig {
            even_score,
            ..TrackerConfig::default()
        };
        Self {
            tracker: Tracker::new(tracker),
            identifier: Identifier::new(identifier),
            pick: None,
            answer: None,
        }
    }

    /// The user points at a place in the picture, pixels: whoever is there is enrolled with the next
    /// frame that shows them.
    pub fn pick(&mut self, at: [f64; 2]) {
        self.point(Pointed::Place(at), Meant::Stranger);
    }

    /// The user points at somebody. Frames of the next second say whom, if anybody can be meant:
    /// [`take_answer`](Self::take_answer).
    pub fn point(&mut self, at: Pointed, meant: Meant) {
        self.answer = None;
        self.pick = Some(Pick {
            at,
            meant,
            waited_s: 0.0,
        });
    }

    /// The user points at nobody any more.
    pub fn stop_pointing(&mut self) {
        self.pick = None;
    }

    /// What became of it when the user last pointed at somebody, once that is known; told once.
    pub fn take_answer(&mut self) -> Option<Result<Picked, NotPicked>> {
        self.answer.take()
    }

    /// Takes in what was seen in a frame, so many seconds after the last one. Whoever was enrolled by
    /// a pick is named.
    pub fn step(&mut self, observed: &Observation<'_>, dt_s: f64) -> Option<PersonId> {
        self.tracker.step(&Frame {
            dt_s,
            detections: observed.detections,
            features: observed.features,
        });
        let picked = self.enrol_the_picked(observed.features, dt_s);
        self.identifier
            .step(self.tracker.tracks(), observed.features, dt_s);
        picked
    }

    fn enrol_the_picked(&mut self, features: Option<Features<'_>>, dt_s: f64) -> Option<PersonId> {
        let pick = self.pick.as_mut()?;
        let (at, tracks) = (pick.at, self.tracker.tracks());
        let answer = resolve(at, pick.meant, tracks, features, &mut self.identifier);
        let answer = answer.or_else(|| {
            pick.waited_s += dt_s;
            (pick.waited_s > PATIENCE_S).then_some(Err(match at {
                Pointed::Place(at) if track_at(tracks, at).is_none() => NotPicked::NobodyThere,
                _ => NotPicked::NotSeen,
            }))
        })?;
        self.pick = None;
        self.answer = Some(answer);
        answer.ok().map(|picked| picked.person)
    }

    /// Everyone who is followed.
    pub fn tracks(&self) -> &[Track] {
        self.tracker.tracks()
    }

    /// Where enrolled people are.
    pub fn statuses(&self) -> impl Iterator<Item = &Status> {
        self.identifier.statuses()
    }

    /// Where a robot that follows this person goes now: nowhere while they are out of view, or while it
    /// is unsure that it is them.
    pub fn followed(&self, person: PersonId) -> Option<&Track> {
        let status = self.statuses().find(|status| status.person == person)?;
        let sure = matches!(status.condition, Condition::Seen | Condition::Found);
        let track = self.tracks().iter().find(|t| Some(t.id) == status.track);
        track.filter(|track| sure && track.is_seen())
    }

    /// What an enrolled person looks like by now.
    pub fn model(&self, person: PersonId) -> Option<&AppearanceModel> {
        self.identifier.model(person)
    }

    /// Who is enrolled, to be changed.
    pub fn identifier(&mut self) -> &mut Identifier {
        &mut self.identifier
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoundingBox;
    use crate::track::Detection;

    fn see(watch: &mut Watch, people: &[(f64, [f32; 2])]) -> Option<PersonId> {
        let detections: Vec<_> = people
            .iter()
            .map(|(left, _)| Detection {
                bounding_box: BoundingBox::new(*left, 0.0, 40.0, 100.0),
                score: 0.95,
            })
            .collect();
        let values: Vec<f32> = people.iter().flat_map(|(_, looks)| *looks).collect();
        let observed = Observation {
            detections: &detections,
            features: Some(Features {
                dimension: 2,
                values: &values,
                same_person_distance: 0.3,
            }),
        };
        watch.step(&observed, 0.1)
    }

    #[test]
    fn whoever_is_pointed_at_is_enrolled_and_known() {
        let mut watch = Watch::new(0.5, IdentifierConfig::default());
        let people = [(0.0, [1.0, 0.0]), (200.0, [0.0, 1.0])];
        for _ in 0..5 {
            assert_eq!(see(&mut watch, &people), None);
        }
        watch.pick([215.0, 30.0]);
        let person = see(&mut watch, &people);
        assert!(person.is_some());
        let status = *watch.statuses().next().unwrap();
        assert_eq!(status.condition, Condition::Seen);
        let track = watch.followed(status.person);
        assert!((track.unwrap().bounding_box().left - 200.0).abs() < 5.0);
    }

    #[test]
    fn a_finger_that_points_at_nobody_is_forgotten() {
        let mut watch = Watch::new(0.5, IdentifierConfig::default());
        let people = [(0.0, [1.0, 0.0])];
        watch.pick([500.0, 30.0]);
        for _ in 0..20 {
            assert_eq!(see(&mut watch, &people), None);
        }
        // Later somebody walks there, whom nobody pointed at.
        for _ in 20..40 {
            let moved = [(0.0, [1.0, 0.0]), (480.0, [0.0, 1.0])];
            assert_eq!(see(&mut watch, &moved), None);
        }
    }

    /// What became of pointing at a track with these people in view.
    fn point(
        watch: &mut Watch,
        track: u64,
        people: &[(f64, [f32; 2])],
    ) -> Result<Picked, NotPicked> {
        watch.point(Pointed::Track(track), Meant::Anybody);
        for _ in 0..20 {
            see(watch, people);
            if let Some(answer) = watch.take_answer() {
                return answer;
            }
        }
        panic!("no answer in two seconds");
    }

    fn status(watch: &Watch) -> Status {
        *watch.statuses().next().unwrap()
    }

    #[test]
    fn a_track_that_ended_is_said_and_one_that_shows_nothing_is_waited_for() {
        let mut watch = Watch::new(0.5, IdentifierConfig::default());
        let people = [(0.0, [1.0, 0.0]), (200.0, [0.0, 1.0])];
        for _ in 0..5 {
            see(&mut watch, &people);
        }
        let missing = point(&mut watch, 77, &people);
        assert_eq!(missing, Err(NotPicked::NoSuchTrack));
        // Its detection is missed, for half a second and for longer.
        let track = watch.tracks()[1].id;
        watch.point(Pointed::Track(track), Meant::Anybody);
        for _ in 0..5 {
            see(&mut watch, &people[..1]);
            assert_eq!(watch.take_answer(), None);
        }
        see(&mut watch, &people);
        let picked = watch.take_answer().unwrap().unwrap();
        assert_eq!((picked.track, picked.was), (track, None));
        let hidden = point(&mut watch, track, &people[..1]);
        assert_eq!(hidden, Err(NotPicked::NotSeen));
        watch.point(Pointed::Place([500.0, 5.0]), Meant::Anybody);
        watch.stop_pointing();
        for _ in 0..20 {
            see(&mut watch, &people);
            assert_eq!(watch.take_answer(), None);
        }
    }

    #[test]
    fn whoever_is_on_a_track_is_meant_by_it() {
        let mut watch = Watch::new(0.5, IdentifierConfig::default());
        let people = [(0.0, [1.0, 0.0]), (200.0, [0.0, 1.0])];
        for _ in 0..5 {
            see(&mut watch, &people);
        }
        let track = watch.tracks()[0].id;
        let first = point(&mut watch, track, &people).unwrap();
        for _ in 0..5 {
            see(&mut watch, &people);
        }
        let again = point(&mut watch, track, &people).unwrap();
        assert_eq!(
            (again.person, again.was),
            (first.person, Some(first.person))
        );
        let track = watch.tracks()[1].id;
        let other = point(&mut watch, track, &people).unwrap();
        assert_eq!(other.was, None);
        assert_eq!(watch.statuses().count(), 2);
    }

    #[test]
    fn pointing_again_says_which_of_two_alike_is_the_person() {
        const RED: [f32; 2] = [1.0, 0.1];
        let mut watch = Watch::new(0.5, IdentifierConfig::default());
        for _ in 0..5 {
            see(&mut watch, &[(0.0, RED), (300.0, RED)]);
        }
        let own = watch.tracks()[0].id;
        let before = point(&mut watch, own, &[(0.0, RED), (300.0, RED)]).unwrap();
        // They meet, one hides the other for a moment, and part again.
        for k in 0..26 {
            see(&mut watch, &[(f64::from(k) * 10.0, RED), (300.0, RED)]);
        }
        for _ in 0..5 {
            see(&mut watch, &[(300.0, RED)]);
        }
        let parted = |k: i32| [(280.0 - 10.0 * f64::from(k), RED), (300.0, RED)];
        for k in 0..20 {
            see(&mut watch, &parted(k));
        }
        assert!(watch.followed(before.person).is_none());
        let there = track_at(watch.tracks(), [110.0, 50.0]).unwrap().id;
        let picked = point(&mut watch, there, &parted(20)).unwrap();
        assert_eq!(picked.was, Some(before.person));
        assert_eq!(watch.statuses().count(), 1);
        for k in 20..30 {
            see(&mut watch, &parted(k));
        }
        assert_eq!(status(&watch).condition, Condition::Seen);
        let followed = watch.followed(picked.person).unwrap();
        assert!(followed.bounding_box().left < 50.0);
    }
}
