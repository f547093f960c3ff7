//! One track: a person as long as it is followed.

use super::filter::BoxFilter;
use crate::BoundingBox;

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

    /// How it moves in the image, pixels a second.
    pub fn velocity(&self) -> [f64; 2] {
        self.filter.velocity()
    }

    /// Whether it is seen in this frame.
    pub fn is_seen(&self) -> bool {
        self.detection.is_some()
    }

    /// Whether it is believed.
    pub fn is_confirmed(&self) -> bool {
        self.state == TrackState::Confirmed
    }

    /// One minus the cosine of the angle between its appearance and a feature of unit length.
    pub(super) fn appearance_distance(&self, feature: &[f32]) -> Option<f64> {
        let comparable = !self.feature.is_empty() && self.feature.len() == feature.len();
        comparable.then(|| {
            let dot: f32 = self.feature.iter().zip(feature).map(|(a, b)| a * b).sum();
            f64::from(1.0 - dot)
        })
    }

    pub(super) fn learn(&mut self, feature: &[f32]) {
        if self.feature.len() != feature.len() {
            self.feature.clear();
            self.feature.extend_from_slice(feature);
        } else {
            for (mean, new) in self.feature.iter_mut().zip(feature) {
                *mean = FEATURE_KEPT * *mean + (1.0 - FEATURE_KEPT) * new;
            }
        }
        let length = self.feature.iter().map(|v| v * v).sum::<f32>().sqrt();
        if length > 0.0 {
            self.feature.iter_mut().for_each(|v| *v /= length);
        }
    }
}
