//! From what was seen in a frame to who is where: tracks, and the people who are known among them.
//!
//! In: an [`Observation`] and the time since the last one; the place in the picture that the
//! user points at. Out: tracks, and for each enrolled person where they are. [`Watch::step`] is the
//! pipeline behind [`Observer::observe`](crate::observe::Observer::observe): both together take a
//! camera's frame to what is known. Robots, recordings and simulated scenes go through the same two.

use crate::identify::{AppearanceModel, Condition, Identifier, IdentifierConfig, PersonId, Status};
use crate::observe::Observation;
use crate::track::{Features, Frame, Track, Tracker, TrackerConfig};

/// Whom the user pointed at may be hidden for so long, seconds.
const PATIENCE_S: f64 = 1.0;

/// Somebody the user pointed at and nobody found yet.
#[derive(Debug, Clone, Copy)]
struct Pick {
    at: [f64; 2],
    waited_s: f64,
}

/// Follows everyone and knows some of them.
pub struct Watch {
    tracker: Tracker,
    identifier: Identifier,
    pick: Option<Pick>,
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
        }
    }

    /// The user points at a place in the picture, pixels: whoever is there is enrolled with the next
    /// frame that shows them.
    pub fn pick(&mut self, at: [f64; 2]) {
        self.pick = Some(Pick { at, waited_s: 0.0 });
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
        let at = pick.at;
        let found = track_at(self.tracker.tracks(), at).and_then(|track| {
            let model = AppearanceModel::first(features?.get(track.detection?)?)?;
            Some((track.id, model))
        });
        let Some((track, model)) = found else {
            pick.waited_s += dt_s;
            if pick.waited_s > PATIENCE_S {
                self.pick = None;
            }
            return None;
        };
        self.pick = None;
        Some(self.identifier.enrol(model, Some(track)))
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

/// The believed track in this frame whose box holds a place: where several do, the one whose middle is
/// nearest.
pub fn track_at(tracks: &[Track], [x, y]: [f64; 2]) -> Option<&Track> {
    let off = |track: &&Track| {
        let [mx, my] = track.bounding_box().middle();
        (mx - x).hypot(my - y)
    };
    let holds = |track: &&Track| {
        let b = track.bounding_box();
        (b.left..=b.right()).contains(&x) && (b.top..=b.bottom()).contains(&y)
    };
    let there = tracks
        .iter()
        .filter(|track| track.is_confirmed() && track.is_seen());
    there.filter(holds).min_by(|a, b| off(a).total_cmp(&off(b)))
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
}
