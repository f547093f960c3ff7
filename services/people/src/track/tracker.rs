//! The tracker: [`Tracker::step`] reads from top to bottom.

use super::filter::BoxFilter;
use super::single::{Track, TrackState};
use crate::BoundingBox;
use crate::assignment::{Assignment, CostMatrix};
use crate::gallery::is_feature;

/// What a detector found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Where, pixels.
    pub bounding_box: BoundingBox,
    /// How sure, 0 to 1.
    pub score: f64,
}

/// Features of the detections of one frame, in their order.
#[derive(Debug, Clone, Copy)]
pub struct Features<'a> {
    /// Numbers in each feature.
    pub dimension: usize,
    /// One feature after the other.
    pub values: &'a [f32],
    /// Two features are of one person up to this distance (1 - cosine): a property of the network.
    pub same_person_distance: f64,
}

impl<'a> Features<'a> {
    /// The feature of a detection; `None` if there is none.
    pub fn get(&self, detection: usize) -> Option<&'a [f32]> {
        let begin = detection.checked_mul(self.dimension)?;
        let feature = self.values.get(begin..begin.checked_add(self.dimension)?)?;
        is_feature(feature).then_some(feature)
    }
}

/// What the tracker is told of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Time since the last frame, seconds.
    pub dt_s: f64,
    /// What was found. Boxes that are not sound are not used.
    pub detections: &'a [Detection],
    /// What they look like.
    pub features: Option<Features<'a>>,
}

/// How people are tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct TrackerConfig {
    /// The score at which a detection is as likely a person as not: a property of the detector.
    /// One with less goes on with a person who is seen, and brings nobody.
    pub even_score: f64,
    /// A track that is not seen for longer is over, seconds.
    pub max_unseen_s: f64,
}

impl Default for TrackerConfig {
    fn default() -> Self {
        Self {
            even_score: 0.75,
            max_unseen_s: 2.0,
        }
    }
}

/// Detections with less of [`TrackerConfig::even_score`] than this share are not looked at.
pub const LEAST_SHARE: f64 = 0.2;
/// A track is believed once it was seen in so many frames, as SORT has it,
const BELIEVED_HITS: u32 = 3;
/// and once the evidence (log odds) says fifty to one.
const BELIEVED_EVIDENCE: f64 = 3.9;
/// What a frame without it says about a person whom few have seen yet: detectors miss one in four.
const MISSED_EVIDENCE: f64 = -1.4;
/// Scores nearer to certain than this are not believed to be.
const MOST_CERTAIN: f64 = 0.99;
/// Boxes that overlap less are of two people. As SORT has it.
const MIN_OVERLAP: f64 = 0.3;
/// The same for unsure detections, as ByteTrack has it.
const MIN_LOW_OVERLAP: f64 = 0.5;
/// Unsure detections go on with tracks seen at most so long ago, seconds.
const LOW_UNSEEN_S: f64 = 0.2;
/// A new box that overlaps a tracked one so far is that person once more.
const SAME_BOX: f64 = 0.7;
/// Squared Mahalanobis distance that one in a thousand of the same person's middles exceeds.
const FAR: f64 = 13.8;
/// By what factor a person's height in the image may change between two sightings that do not
/// overlap.
const HEIGHT_CHANGE: f64 = 1.5;
/// What appearance has to say beside motion.
const APPEARANCE_WEIGHT: f64 = 0.5;
/// No track lives through a longer step; longer ones are clock jumps, seconds.
const MAX_STEP_S: f64 = 60.0;
/// Room for so many people is made at once; for more when they come.
const USUAL_TRACKS: usize = 128;
/// More people in one view than a camera can show.
pub const MAX_TRACKS: usize = 1000;

/// Follows people from frame to frame.
#[derive(Debug, Clone, Default)]
pub struct Tracker {
    config: TrackerConfig,
    tracks: Vec<Track>,
    last_id: u64,
    // Buffers of a step, kept so that nothing is allocated once warm.
    open_tracks: Vec<usize>,
    open_detections: Vec<usize>,
    high: Vec<usize>,
    low: Vec<usize>,
    newcomers: Vec<usize>,
    costs: CostMatrix,
    solver: Assignment,
    spare_features: Vec<Vec<f32>>,
}

/// Which tracks may be paired in a stage, and what a pair costs; 1 or more: not a pair.
struct Stage {
    takes: fn(&Track) -> bool,
    cost: fn(&Track, &Detection, Option<f64>) -> f64,
}

impl Tracker {
    /// A tracker that has seen nobody.
    pub fn new(config: TrackerConfig) -> Self {
        Self {
            config,
            tracks: Vec::with_capacity(USUAL_TRACKS),
            spare_features: Vec::with_capacity(USUAL_TRACKS),
            ..Self::default()
        }
    }

    /// Everyone who is followed: seen now or not, believed or not.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Takes in one frame. The same frames give the same tracks.
    pub fn step(&mut self, frame: &Frame<'_>) {
        self.predict(frame);
        self.sort_detections(frame.detections);

        self.open_detections.clone_from(&self.high);
        self.pair(frame, &BELIEVED);
        self.pair(frame, &TENTATIVE);
        self.newcomers.clone_from(&self.open_detections);
        self.open_detections.clone_from(&self.low);
        self.pair(frame, &UNSURE);

        self.bury();
        self.give_birth(frame);
    }

    fn predict(&mut self, frame: &Frame<'_>) {
        // A clock that jumps back or stands still is no motion.
        let dt_s = match frame.dt_s {
            dt if dt.is_finite() => dt.clamp(0.0, MAX_STEP_S),
            _ => 0.0,
        };
        for track in &mut self.tracks {
            track.detection = None;
            track.unseen_s += dt_s;
            track.filter.predict(dt_s);
        }
    }

    /// Sure ones and unsure ones, by their places.
    fn sort_detections(&mut self, detections: &[Detection]) {
        self.high.clear();
        self.low.clear();
        for (index, detection) in detections.iter().enumerate().take(MAX_TRACKS) {
            if !detection.bounding_box.is_sound() {
                continue;
            }
            if detection.score >= self.config.even_score {
                self.high.push(index);
            } else if detection.score >= LEAST_SHARE * self.config.even_score {
                self.low.push(index);
            }
        }
    }

    /// Pairs tracks that a stage takes with the open detections.
    fn pair(&mut self, frame: &Frame<'_>, stage: &Stage) {
        let unpaired = |track: &Track| track.detection.is_none() && (stage.takes)(track);
        self.open_tracks.clear();
        self.open_tracks
            .extend((0..self.tracks.len()).filter(|&t| unpaired(&self.tracks[t])));
        let (rows, columns) = (self.open_tracks.len(), self.open_detections.len());
        self.costs.reset(rows, columns, f64::INFINITY);
        for (row, &t) in self.open_tracks.iter().enumerate() {
            for (column, &d) in self.open_detections.iter().enumerate() {
                let (track, detection) = (&self.tracks[t], &frame.detections[d]);
                let look = frame.features.and_then(|features| {
                    let distance = track.appearance_distance(features.get(d)?)?;
                    Some(distance / features.same_person_distance)
                });
                self.costs
                    .set(row, column, (stage.cost)(track, detection, look));
            }
        }
        let pairs = self.solver.solve(&self.costs, 1.0);
        for &(row, column) in pairs {
            let d = self.open_detections[column];
            let track = &mut self.tracks[self.open_tracks[row]];
            seen(track, d, frame, self.config.even_score);
        }
        let tracks = &self.tracks;
        self.open_detections
            .retain(|&d| tracks.iter().all(|track| track.detection != Some(d)));
    }

    /// Ends tracks that were not seen for too long, and mistakes at once.
    fn bury(&mut self) {
        let config = self.config;
        let spare = &mut self.spare_features;
        self.tracks.retain_mut(|track| {
            let stays = match track.state {
                TrackState::Confirmed => track.unseen_s <= config.max_unseen_s,
                TrackState::Tentative if track.is_seen() => true,
                TrackState::Tentative => {
                    track.evidence += MISSED_EVIDENCE;
                    track.evidence > 0.0
                }
            };
            let sound = track.bounding_box().is_sound();
            let over = !(stays && sound);
            if over && !track.feature.is_empty() {
                spare.push(std::mem::take(&mut track.feature));
            }
            !over
        });
    }

    /// Sure detections that are nobody's become somebody.
    fn give_birth(&mut self, frame: &Frame<'_>) {
        for &d in &self.newcomers {
            let detection = &frame.detections[d];
            let again = |track: &Track| {
                track.is_seen() && track.last_seen.iou(&detection.bounding_box) > SAME_BOX
            };
            if self.tracks.len() >= MAX_TRACKS || self.tracks.iter().any(again) {
                continue;
            }
            self.last_id += 1;
            let mut feature = self.spare_features.pop().unwrap_or_default();
            feature.clear();
            let mut track = Track {
                id: self.last_id,
                state: TrackState::Tentative,
                hits: 0,
                evidence: 0.0,
                unseen_s: 0.0,
                score: 0.0,
                detection: None,
                filter: BoxFilter::new(&detection.bounding_box),
                last_seen: detection.bounding_box,
                feature,
            };
            seen(&mut track, d, frame, self.config.even_score);
            self.tracks.push(track);
        }
    }
}

/// A track is seen as detection `d`.
fn seen(track: &mut Track, d: usize, frame: &Frame<'_>, even_score: f64) {
    let detection = &frame.detections[d];
    if track.hits > 0 {
        track.filter.update(&detection.bounding_box);
    }
    track.last_seen = detection.bounding_box;
    track.unseen_s = 0.0;
    track.score = detection.score;
    track.detection = Some(d);
    track.hits = track.hits.saturating_add(1);
    track.evidence += log_odds(detection.score) - log_odds(even_score);
    if track.hits >= BELIEVED_HITS && track.evidence >= BELIEVED_EVIDENCE {
        track.state = TrackState::Confirmed;
    }
    if let Some(feature) = frame.features.and_then(|features| features.get(d)) {
        track.learn(feature);
    }
}

fn log_odds(score: f64) -> f64 {
    let share = score.clamp(1.0 - MOST_CERTAIN, MOST_CERTAIN);
    (share / (1.0 - share)).ln()
}

/// A person who is known, by motion and looks.
const BELIEVED: Stage = Stage {
    takes: Track::is_confirmed,
    cost: known_cost,
};

/// Whoever is not known yet takes what the known leave.
const TENTATIVE: Stage = Stage {
    takes: |track| !track.is_confirmed(),
    cost: known_cost,
};

/// Someone who is being hidden, or blurred: looks say nothing then.
const UNSURE: Stage = Stage {
    takes: |track| track.is_confirmed() && track.unseen_s <= LOW_UNSEEN_S,
    cost: |track, detection, _| overlap_cost(&track.bounding_box(), detection, MIN_LOW_OVERLAP),
};

fn overlap_cost(track: &BoundingBox, detection: &Detection, least: f64) -> f64 {
    match track.iou(&detection.bounding_box) {
        overlap if overlap >= least => 1.0 - overlap,
        _ => 1.0,
    }
}

/// Boxes are grown by how unsure the prediction is, so that they still meet after a gap.
fn predicted_cost(track: &Track, detection: &Detection) -> f64 {
    let unsure = track.filter.deviation();
    let grown = Detection {
        bounding_box: detection.bounding_box.grown(unsure),
        ..*detection
    };
    overlap_cost(&track.bounding_box().grown(unsure), &grown, MIN_OVERLAP)
}

/// The cost of motion and looks; `look` is 1 where two people begin.
fn known_cost(track: &Track, detection: &Detection, look: Option<f64>) -> f64 {
    let motion = predicted_cost(track, detection);
    let Some(look) = look else {
        return motion;
    };
    let heights = track.bounding_box().height / detection.bounding_box.height;
    let reachable = track.filter.middle_distance(&detection.bounding_box) <= FAR
        && (1.0 / HEIGHT_CHANGE..HEIGHT_CHANGE).contains(&heights);
    if motion >= 1.0 && !(look < 1.0 && reachable) {
        return 1.0;
    }
    // Less than 1 whatever the parts: whether it is a pair has been decided.
    0.999 * ((1.0 - APPEARANCE_WEIGHT) * motion + APPEARANCE_WEIGHT * look.clamp(0.0, 1.0))
}
