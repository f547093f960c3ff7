//! One person among tracks, frame by frame: whether they are still on theirs, and whose it may be else.
//!
//! In: tracks, their looks, the time since the last frame. Out: the person's [`Status`] and what they
//! look like by now. Elsewhere: who else was seen beside them ([`others`](super::others)), whom a track
//! goes to that several people may be on ([`carpe`](super::carpe)).

use super::AppearanceModel;
use super::carpe::{Condition, Status};
use super::others::{Mean, Others, is_as_large, is_cut_off, touch};
use crate::track::Track;

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

/// One enrolled person, and everything that is known of where they are.
pub(super) struct Person {
    pub model: AppearanceModel,
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
    pub status: Status,
}

impl Person {
    pub fn new(model: AppearanceModel, status: Status) -> Self {
        Self {
            model,
            others: Others::new(),
            doubt: None,
            doubles: Vec::with_capacity(USUAL_DOUBLES),
            since_found_s: f64::INFINITY,
            hidden_s: 0.0,
            status,
        }
    }

    /// A new frame: nobody is in view yet, and tracks that have ended are forgotten.
    pub fn begin<'a>(
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
    pub fn stay<'a>(
        &mut self,
        tracks: &[Track],
        look: impl Fn(&Track) -> Option<&'a [f32]> + Copy,
        adapts: bool,
        dt_s: f64,
        columns: Option<usize>,
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
        let edge = columns.is_some_and(|columns| is_cut_off(own, columns));
        if !own.is_seen() || hidden || self.is_handed_on(own, edge, share, others(), look) {
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
    /// may have been taken for each other, at the picture's `edge` too, where one leaves and another
    /// enters, until enough of them vouch for the person.
    fn is_handed_on<'a, 'b>(
        &mut self,
        own: &Track,
        edge: bool,
        share: Option<f64>,
        mut others: impl Iterator<Item = &'b Track> + Clone,
        look: impl Fn(&Track) -> Option<&'a [f32]>,
    ) -> bool {
        let alongside = |other: &Track| {
            self.others.was_apart(other.id) && touch(own, other) && is_as_large(own, other)
        };
        let touched = others.clone().any(alongside);
        let replaced = edge && share.is_some_and(|share| share > 1.0);
        if touched || replaced || self.hidden_s > HIDDEN_S {
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
    pub fn candidate(&self, track: &Track, feature: Option<&[f32]>) -> Option<f64> {
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
    pub fn find(&mut self, track: &Track, feature: Option<&[f32]>) {
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
    pub fn judge(&mut self, lost_s: f64) {
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
