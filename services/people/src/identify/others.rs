//! Everyone else in view: who can't be a person because they were seen beside them, and who may be.
//!
//! In: the tracks of each frame and how far they are from looking like the person. Out: whether a track
//! is somebody else's (the blacklist), and how far it was from the person lately.
//!
//! A track that lies over the person's own may be a part of the person, found once more: it takes a
//! while apart to be somebody else. And a tracker hands a track on to somebody else now and then: one
//! that never looked like the person and begins to is not who it was.

use crate::BoundingBox;
use crate::track::Track;

/// Seen apart from the person for so long, a track is somebody else's, seconds.
const APART_S: f64 = 0.5;
/// Of the smaller box; two that share more touch each other.
const TOUCHING: f64 = 0.2;
/// Boxes whose heights differ by a larger factor are not taken for each other.
const AS_LARGE: f64 = 1.5;
/// A box that comes so near to the picture's edge ends there, share of its width.
const EDGE: f64 = 0.01;
/// Somebody whose mean distance is more thresholds than this does not look like the person.
const UNLIKE: f64 = 1.3;
/// Looks beside the person that are averaged: three seconds.
const BESIDE_LOOKS: u32 = 30;
/// Latest looks that are averaged.
const LATEST_LOOKS: u32 = 5;
/// Room for so many is made at once.
const USUAL_TRACKS: usize = 128;

/// A mean that forgets what is older than so many values.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mean {
    pub value: f64,
    pub count: u32,
}

impl Mean {
    pub fn add(&mut self, value: f64, most: u32) {
        self.count = (self.count + 1).min(most);
        self.value += (value - self.value) / f64::from(self.count);
    }
}

#[derive(Debug, Clone, Copy)]
struct Other {
    track: u64,
    apart_s: f64,
    /// Distance in thresholds, while beside the person.
    beside: Mean,
    /// Statistical distance.
    latest: Mean,
}

/// Everyone but the person, until their tracks end.
#[derive(Debug, Clone)]
pub(super) struct Others(Vec<Other>);

impl Others {
    pub fn new() -> Self {
        Self(Vec::with_capacity(USUAL_TRACKS))
    }

    /// Forgets tracks that have ended.
    pub fn retain(&mut self, tracks: &[Track]) {
        self.0
            .retain(|d| tracks.iter().any(|track| track.id == d.track));
    }

    fn get(&self, track: u64) -> Option<&Other> {
        let place = self.0.binary_search_by_key(&track, |other| other.track);
        place.ok().map(|place| &self.0[place])
    }

    fn of(&mut self, track: u64) -> &mut Other {
        let place = self.0.binary_search_by_key(&track, |other| other.track);
        let place = place.unwrap_or_else(|place| {
            let new = Other {
                track,
                apart_s: 0.0,
                beside: Mean::default(),
                latest: Mean::default(),
            };
            self.0.insert(place, new);
            place
        });
        &mut self.0[place]
    }

    /// A track looks so far from the person, statistical distance.
    pub fn look(&mut self, track: u64, distance: f64) {
        self.of(track).latest.add(distance, LATEST_LOOKS);
    }

    /// The mean of its latest looks.
    pub fn latest(&self, track: u64) -> Mean {
        self.get(track)
            .map_or(Mean::default(), |other| other.latest)
    }

    /// In a frame of so many seconds another track surely shows the person, and this one looks so far
    /// from them, in thresholds.
    pub fn beside(&mut self, own: &Track, other: &Track, share: Option<f64>, dt_s: f64) {
        if touch(own, other) {
            return;
        }
        let other = self.of(other.id);
        other.apart_s += dt_s;
        if let Some(share) = share {
            other.beside.add(share, BESIDE_LOOKS);
        }
    }

    /// Whether a track was apart from the person for long enough to be somebody else's.
    pub fn was_apart(&self, track: u64) -> bool {
        self.get(track)
            .is_some_and(|other| other.apart_s >= APART_S)
    }

    /// Whether a track is surely somebody else's who was hard to tell from the person lately: their
    /// looks are nearer than this statistical distance.
    pub fn is_double(&self, track: u64, threshold: f64) -> bool {
        self.get(track).is_some_and(|other| {
            let near = other.latest.count > 0 && other.latest.value < threshold;
            other.apart_s >= APART_S && near
        })
    }

    /// Whether a track that looks so far from the person now, in thresholds, is somebody else's.
    pub fn is_somebody_else(&self, track: u64, share: f64) -> bool {
        self.get(track).is_some_and(|other| {
            let unlike = other.beside.count > 0 && other.beside.value > UNLIKE;
            other.apart_s >= APART_S && !(unlike && share < 1.0)
        })
    }
}

/// Whether two tracks' boxes lie over each other.
pub(super) fn touch(a: &Track, b: &Track) -> bool {
    shared(&a.bounding_box(), &b.bounding_box()) > TOUCHING
}

/// Whether two tracks that touch are about as far away, so that a tracker may take the one for the other.
pub(super) fn is_as_large(a: &Track, b: &Track) -> bool {
    let heights = a.bounding_box().height / b.bounding_box().height;
    (1.0 / AS_LARGE..AS_LARGE).contains(&heights)
}

/// Whether a track's box ends where the picture does, on the left or on the right.
pub(super) fn is_cut_off(track: &Track, columns: usize) -> bool {
    let (found, columns) = (track.bounding_box(), columns as f64);
    let margin = EDGE * columns;
    found.left < margin || found.right() > columns - margin
}

/// What two boxes share, of the smaller one.
fn shared(a: &BoundingBox, b: &BoundingBox) -> f64 {
    let wide = a.right().min(b.right()) - a.left.max(b.left);
    let high = a.bottom().min(b.bottom()) - a.top.max(b.top);
    let least = a.area().min(b.area());
    if wide <= 0.0 || high <= 0.0 || least <= 0.0 {
        return 0.0;
    }
    wide * high / least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_boxes_share_is_of_the_smaller_one() {
        let large = BoundingBox::new(0.0, 0.0, 40.0, 100.0);
        // 20 of 40 columns, all of its rows.
        let part = BoundingBox::new(20.0, 50.0, 40.0, 50.0);
        assert_eq!(shared(&large, &part), 0.5);
        assert_eq!(shared(&part, &large), 0.5);
        assert_eq!(shared(&large, &BoundingBox::new(40.0, 0.0, 9.0, 9.0)), 0.0);
    }

    #[test]
    fn a_mean_forgets_what_is_old() {
        let mut mean = Mean::default();
        mean.add(1.0, 2);
        mean.add(3.0, 2);
        assert_eq!((mean.value, mean.count), (2.0, 2));
        // Of two values each new one weighs half.
        mean.add(6.0, 2);
        assert_eq!((mean.value, mean.count), (4.0, 2));
    }
}
