//! FollowMe: a person stands and turns in front of the robot, which learns what they look like.
//!
//! In: features of the person, until there are enough. Out: an [`AppearanceModel`]: two thirds of
//! the features make the model, one third the threshold. They are dealt in turns, so that both have
//! seen the person from all sides.

use super::AppearanceModel;
use crate::gallery::is_feature;

/// Fewer features leave a threshold to chance.
pub const FEWEST: usize = 9;

/// Why there is no model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The person was seen too seldom.
    #[error("the person was seen {got} times, {needed} are needed")]
    TooFew {
        /// How often.
        got: usize,
        /// How often at least.
        needed: usize,
    },
    /// They cancel out or are too large: no distance can be taken.
    #[error("the features say nothing about the person")]
    Nothing,
}

/// A calibration that goes on.
#[derive(Debug, Clone)]
pub struct Calibration {
    wanted: usize,
    features: Vec<Vec<f32>>,
}

impl Calibration {
    /// A calibration of so many features, at least [`FEWEST`].
    pub fn new(wanted: usize) -> Self {
        Self {
            wanted: wanted.max(FEWEST),
            features: Vec::new(),
        }
    }

    /// Takes one more feature. One that says nothing, or of another length than the first, is left
    /// out.
    pub fn push(&mut self, feature: &[f32]) {
        let length = self.features.first().map_or(feature.len(), Vec::len);
        if is_feature(feature) && feature.len() == length && !self.is_complete() {
            self.features.push(feature.to_vec());
        }
    }

    /// How far it is: features taken, and wanted.
    pub fn progress(&self) -> (usize, usize) {
        (self.features.len(), self.wanted)
    }

    /// Whether there are enough.
    pub fn is_complete(&self) -> bool {
        self.features.len() >= self.wanted
    }

    /// The model of what was taken.
    ///
    /// # Errors
    /// Fewer than [`FEWEST`] features, or none that a distance can be taken from.
    pub fn finish(&self) -> Result<AppearanceModel, CalibrationError> {
        if self.features.len() < FEWEST {
            return Err(CalibrationError::TooFew {
                got: self.features.len(),
                needed: FEWEST,
            });
        }
        let dealt = |held_back: bool| -> Vec<&[f32]> {
            let features = self.features.iter().enumerate();
            let part = features.filter(|(index, _)| (index % 3 == 2) == held_back);
            part.map(|(_, feature)| feature.as_slice()).collect()
        };
        AppearanceModel::calibrated(&dealt(false), &dealt(true)).ok_or(CalibrationError::Nothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_deviation_and_threshold_are_those_of_the_two_parts() {
        let mut calibration = Calibration::new(9);
        // Model: 1, 3, 1, 3, 1, 3 in the second number: mean 2, deviation 1. Held back: 2, 2, 5.
        for second in [1.0, 3.0, 2.0, 1.0, 3.0, 2.0, 1.0, 3.0, 5.0] {
            calibration.push(&[0.0, second]);
        }
        assert_eq!(calibration.progress(), (9, 9));
        let model = calibration.finish().unwrap();
        // The floor of the deviation is half the root mean square of (0, 2): 0.7.
        assert!((model.distance(&[0.0, 5.0]) - (9.0_f64 / 2.0).sqrt()).abs() < 1e-6);
        // Distances held back: 0, 0 and 2.1213: mean 0.7071, deviation 1.
        assert!((model.threshold() - (0.5_f64.sqrt() + 2.0)).abs() < 1e-6);
    }

    #[test]
    fn features_that_cancel_out_or_are_too_large_are_said() {
        for size in [1.0, 1e30] {
            let mut calibration = Calibration::new(9);
            for k in 0..9 {
                let sign = if k % 2 == 0 { size } else { -size };
                calibration.push(&[sign, 0.0]);
            }
            assert_eq!(calibration.finish(), Err(CalibrationError::Nothing));
        }
    }

    #[test]
    fn too_few_features_are_said() {
        let mut calibration = Calibration::new(30);
        for _ in 0..5 {
            calibration.push(&[1.0, 0.0]);
        }
        calibration.push(&[0.0, 0.0]);
        let expected = CalibrationError::TooFew {
            got: 5,
            needed: FEWEST,
        };
        assert_eq!(calibration.finish(), Err(expected));
    }
}
