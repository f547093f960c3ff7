//! One track: a person as long as it is followed.

use super::filter::BoxFilter;
use crate::BoundingBox;
use crate::gallery::cosine_distance;

/// Whether a track is believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackState {
    /// Seen too seldom to be more than a detector's mistake.
    Tentative,
    /// A person.
    Confirmed,
}

/// A person followed from frame to frame.
#[derive(Debug, Clone)]
pub struct Track {
    /// Its number: counted from 1, never given twice.
    pub id: u64,
    /// Whether it is believed.
    pub state: TrackState,
    /// Frames in which it was seen.
    pub hits: u32,
    /// Time since it was last seen: 0 if in this frame, seconds.
    pub unseen_s: f64,
    /// Score of the detection it was last seen in.
    pub score: f64,
    /// Which detection of this frame it is, if it is seen.
    pub detection: Option<usize>,
    /// Log odds of being a person and no mistake of the detector's.
    pub(super) evidence: f64,
    pub(super) filter: BoxFilter,
    pub(super) last_seen: BoundingBox,
    /// Mean direction of its features; empty if there are none.
    pub(super) feature: Vec<f32>,
}

/// How much of the mean feature one more frame leaves (as in StrongSORT, Du et al. 2023).
const FEATURE_KEPT: f32 = 0.9;

impl Track {
    /// Where it is now: predicted if it is not seen.
    pub fn bounding_box(&self) -> BoundingBox {
        self.filter.bounding_box()
    }

    /// Whether it is seen in this frame.
    pub fn is_seen(&self) -> bool {
        self.detection.is_some()
    }

    /// Whether it is believed.
    pub fn is_confirmed(&self) -> bool {
        self.state == TrackState::Confirmed
    }

    /// One minus the cosine of the angle between its appearance and a feature.
    pub(super) fn appearance_distance(&self, feature: &[f32]) -> Option<f64> {
        let comparable = !self.feature.is_empty() && self.feature.len() == feature.len();
        comparable.then(|| cosine_distance(&self.feature, feature))
    }

    /// Turns its appearance towards a feature, whose direction alone counts.
    pub(super) fn learn(&mut self, feature: &[f32]) {
        if self.feature.len() != feature.len() {
            self.feature.clear();
            self.feature.resize(feature.len(), 0.0);
        }
        let share = f64::from(1.0 - FEATURE_KEPT) / length(feature);
        for (mean, new) in self.feature.iter_mut().zip(feature) {
            *mean = FEATURE_KEPT * *mean + (share * f64::from(*new)) as f32;
        }
        let length = length(&self.feature) as f32;
        if length > 0.0 {
            self.feature.iter_mut().for_each(|v| *v /= length);
        }
    }
}

fn length(feature: &[f32]) -> f64 {
    let squares = feature.iter().map(|v| f64::from(*v).powi(2));
    squares.sum::<f64>().sqrt()
}
