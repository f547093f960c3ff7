//! What tracking leaves for the page after each picture: who is in view, whom the robot knows.
//!
//! Numbers alone, in boxes that go round: whoever asks takes the newest one and gives it back.

use hachi_hal::Stamp;
use hachi_people::BoundingBox;
use hachi_people::identify::Condition;
use hachi_people::watch::Watch;
use hachi_store::people::StoredId;

use super::enrolment::Progress;
use super::messages::{Picture, Roomy};
use super::roster::Roster;

/// Room for so many people is made at once.
const USUAL_PEOPLE: usize = 64;

/// Somebody in view.
#[derive(Debug, Clone, Copy)]
pub struct InView {
    /// The track's number.
    pub track: u64,
    /// Where they are in the picture: predicted, where they were not seen in it.
    pub bounding_box: BoundingBox,
    /// Whether they are believed to be a person.
    pub confirmed: bool,
    /// Time since they were seen: 0 if in this picture, seconds.
    pub unseen_s: f64,
}

/// Somebody whom the robot knows.
#[derive(Debug, Clone, Copy)]
pub struct KnownPerson {
    /// Their number.
    pub number: u32,
    /// Their number in the store, if they are in it.
    pub stored: Option<StoredId>,
    /// Whether they are the robot's person.
    pub picked: bool,
    /// What is known of where they are.
    pub condition: Condition,
    /// How sure, 0 to 1.
    pub confidence: f64,
    /// Their track, while they are in view.
    pub track: Option<u64>,
    /// Since when they are not in view, seconds.
    pub unseen_s: f64,
}

/// A picture's time and size.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// The middle of its exposure.
    pub stamp: Stamp,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
}

impl Shown {
    /// Of a picture.
    pub fn of(picture: &Picture) -> Self {
        Self {
            stamp: picture.stamp,
            width: picture.width,
            height: picture.height,
        }
    }
}

/// All of it.
#[derive(Debug, Default)]
pub struct View {
    /// The last picture that was looked at.
    pub picture: Option<Shown>,
    /// Everybody in it, and who was just before.
    pub in_view: Vec<InView>,
    /// Everybody whom the robot knows.
    pub known: Vec<KnownPerson>,
    /// The enrolment that goes on, or the last one.
    pub enrolment: Option<Progress>,
}

impl View {
    /// Takes in what is known now.
    pub fn fill(
        &mut self,
        picture: Option<Shown>,
        watch: &Watch,
        roster: &Roster,
        enrolment: Option<Progress>,
    ) {
        self.picture = picture;
        self.enrolment = enrolment;
        self.in_view.clear();
        self.in_view
            .extend(watch.tracks().iter().map(|track| InView {
                track: track.id,
                bounding_box: track.bounding_box(),
                confirmed: track.is_confirmed(),
                unseen_s: track.unseen_s,
            }));
        self.known.clear();
        let known = roster.people().iter().filter_map(|known| {
            let status = watch.statuses().find(|s| s.person == known.person)?;
            Some(KnownPerson {
                number: known.number,
                stored: known.stored,
                picked: roster.picked() == Some(known.number),
                condition: status.condition,
                confidence: status.confidence,
                track: status.track.filter(|_| status.unseen_s == 0.0),
                unseen_s: status.unseen_s,
            })
        });
        self.known.extend(known);
    }
}

impl Roomy for View {
    fn with_room(_: usize) -> Self {
        Self {
            in_view: Vec::with_capacity(USUAL_PEOPLE),
            known: Vec::with_capacity(USUAL_PEOPLE),
            ..Self::default()
        }
    }
}
