//! The user points at somebody, who becomes the robot's person.
//!
//! In: a track's number or a place in the picture, and a frame's tracks and looks. Out: who is meant: a
//! person who is known already, or somebody new. Elsewhere: how they are known from then on
//! ([`identify`](crate::identify)).
//!
//! Somebody known is meant where they are thought to be on that track, sure or not, and where they are
//! looked for and it looks like them: so a user who points again says which of two is theirs when looks
//! alone can't (`UNSURE`). What they look like stays as it was learnt, and all doubt is gone.

use crate::identify::{AppearanceModel, Condition, Identifier, PersonId, Status};
use crate::track::{Features, Track};

/// What the user points at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pointed {
    /// A track's number.
    Track(u64),
    /// A place in the picture, pixels.
    Place([f64; 2]),
}

/// Who can be meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meant {
    /// Somebody new, whoever is known.
    Stranger,
    /// Whoever is known and may be there, else somebody new.
    Anybody,
}

/// Whom the user pointed at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Picked {
    /// Their number from now on.
    pub person: PersonId,
    /// Their track.
    pub track: u64,
    /// The number they were known under before.
    pub was: Option<PersonId>,
}

/// Why nobody was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotPicked {
    /// The track has ended, or never was.
    #[error("there is no such track any more")]
    NoSuchTrack,
    /// Nobody is believed to be at that place.
    #[error("nobody is there")]
    NobodyThere,
    /// The track was not seen well enough to know what the person looks like.
    #[error("the track is not seen well enough to know it again")]
    NotSeen,
}

/// Whom the user means; `None` if that can't be said in this frame.
pub(crate) fn resolve(
    pointed: Pointed,
    meant: Meant,
    tracks: &[Track],
    features: Option<Features<'_>>,
    identifier: &mut Identifier,
) -> Option<Result<Picked, NotPicked>> {
    let track = match pointed {
        Pointed::Place(at) => track_at(tracks, at)?,
        Pointed::Track(id) => match tracks.iter().find(|track| track.id == id) {
            Some(track) => track,
            None => return Some(Err(NotPicked::NoSuchTrack)),
        },
    };
    let feature = features?.get(track.detection?)?;
    let known = match meant {
        Meant::Stranger => None,
        Meant::Anybody => known(track, feature, identifier),
    };
    let was = known.map(|status| status.person);
    let sure = |status: &Status| is_on(status, track) && status.condition != Condition::Unsure;
    if let Some(status) = known.filter(sure) {
        return Some(Ok(Picked {
            person: status.person,
            track: track.id,
            was,
        }));
    }
    let model = match was {
        Some(person) => identifier.model(person)?.clone(),
        None => AppearanceModel::first(feature)?,
    };
    if let Some(person) = was {
        identifier.forget(person);
    }
    Some(Ok(Picked {
        person: identifier.enrol(model, Some(track.id)),
        track: track.id,
        was,
    }))
}

/// Whether a person is thought to be on a track in this frame.
fn is_on(status: &Status, track: &Track) -> bool {
    status.unseen_s == 0.0 && status.track == Some(track.id)
}

/// Who of those who are known is meant by a track: who is on it, else who is looked for and looks most
/// like it.
fn known(track: &Track, feature: &[f32], identifier: &Identifier) -> Option<Status> {
    let statuses = || identifier.statuses().copied();
    if let Some(status) = statuses().find(|status| is_on(status, track)) {
        return Some(status);
    }
    let share = |status: &Status| {
        let model = identifier.model(status.person)?;
        Some(model.distance(feature) / model.threshold())
    };
    let looked_for = |status: &Status| {
        status.unseen_s > 0.0 || status.track.is_none() || status.condition == Condition::Unsure
    };
    statuses()
        .filter(looked_for)
        .filter_map(|status| Some((share(&status)?, status)))
        .filter(|(share, _)| *share < 1.0)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, status)| status)
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
