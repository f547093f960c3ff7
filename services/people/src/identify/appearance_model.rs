//! What a person looks like: mean and deviation of each number of their features, and how far from
//! the mean their own features lie.
//!
//! In: features of the person, one after the other or all at once. Out: the statistical distance
//! `d(x) = sqrt(1/D sum(((x_i - mu_i) / sigma_i)^2))` and the threshold `lambda = mu_d + 2 sigma_d`,
//! which is never less than one deviation, for FollowMe's calibrated models either.

mod statistics;

pub use statistics::{MOST_NUMBERS, NotAModel, Statistics};

use crate::gallery::is_feature;

/// Averages forget what is older than so many updates (about ten seconds of a camera).
const MOST_UPDATES: u32 = 100;
/// The least deviation, as a share of a number's usual size in the feature. It keeps the distance
/// finite until the deviation is learnt, and a number that is always nought from deciding alone.
const LEAST_DEVIATION: f32 = 0.5;
/// Distances of the person's own features before any is known: one by definition of the distance,
/// and half of that spread.
const FIRST_DISTANCE: f64 = 1.0;
const FIRST_SPREAD: f64 = 0.5;
/// A feature within one deviation is the person's, however still they stood while it was learnt.
const LEAST_THRESHOLD: f64 = 1.0;
/// How many spreads above the mean distance a feature may still be the person's.
const SPREADS: f64 = 2.0;

/// A person's features, as statistics.
#[derive(Debug, Clone, PartialEq)]
pub struct AppearanceModel {
    mean: Vec<f32>,
    variance: Vec<f32>,
    least_deviation: f32,
    distance_mean: f64,
    distance_variance: f64,
    updates: u32,
}

impl AppearanceModel {
    /// The model of a person seen once. `None` if the feature says nothing.
    pub fn first(feature: &[f32]) -> Option<Self> {
        is_feature(feature).then(|| Self {
            mean: feature.to_vec(),
            variance: vec![0.0; feature.len()],
            least_deviation: least_deviation(feature),
            distance_mean: FIRST_DISTANCE,
            distance_variance: FIRST_SPREAD * FIRST_SPREAD,
            updates: 0,
        })
    }

    /// The model of these features, one after the other, and the threshold of others of the same
    /// person: FollowMe's calibration. `None` if there are too few, or they say nothing.
    pub(super) fn calibrated(modelled: &[&[f32]], held_back: &[&[f32]]) -> Option<Self> {
        let mut model = Self::first(modelled.first()?)?;
        let count = modelled.len() as f32;
        model.mean.fill(0.0);
        for feature in modelled {
            for (m, x) in model.mean.iter_mut().zip(*feature) {
                *m += x / count;
            }
        }
        let mean = model.mean.clone();
        for feature in modelled {
            let parts = feature
                .iter()
                .zip(&mean)
                .map(|(x, m)| (x - m).powi(2) / count);
            model
                .variance
                .iter_mut()
                .zip(parts)
                .for_each(|(v, part)| *v += part);
        }
        model.least_deviation = least_deviation(&mean);
        let distances: Vec<f64> = held_back.iter().map(|x| model.distance(x)).collect();
        let count = distances.len() as f64;
        model.distance_mean = distances.iter().sum::<f64>() / count;
        let off = distances.iter().map(|d| (d - model.distance_mean).powi(2));
        model.distance_variance = off.sum::<f64>() / count;
        model.updates = modelled.len().min(MOST_UPDATES as usize) as u32;
        let sound = model.distance_mean.is_finite() && model.distance_variance.is_finite();
        sound.then_some(model)
    }

    /// Numbers in a feature.
    pub fn length(&self) -> usize {
        self.mean.len()
    }

    /// How often it was updated, up to where older features are forgotten.
    pub fn updates(&self) -> u32 {
        self.updates
    }

    /// The statistical distance of a feature; infinite for one that says nothing.
    pub fn distance(&self, feature: &[f32]) -> f64 {
        if feature.len() != self.mean.len() || !is_feature(feature) {
            return f64::INFINITY;
        }
        let least = self.least_deviation * self.least_deviation;
        let parts = feature.iter().zip(&self.mean).zip(&self.variance);
        let sum: f32 = parts
            .map(|((x, m), v)| (x - m).powi(2) / v.max(least))
            .sum();
        f64::from(sum / feature.len() as f32).sqrt()
    }

    /// A feature nearer than this is the person's.
    pub fn threshold(&self) -> f64 {
        (self.distance_mean + SPREADS * self.distance_variance.sqrt()).max(LEAST_THRESHOLD)
    }

    /// Of several features the mean distance is the person's below this: it spreads less than that of
    /// one. Those of a moment are alike, so that it is never taken to spread by less than half.
    pub fn threshold_of(&self, features: u32) -> f64 {
        let share = f64::from(features.clamp(1, 4)).sqrt().recip();
        let spread = SPREADS * self.distance_variance.sqrt();
        (self.distance_mean + share * spread).max(LEAST_THRESHOLD)
    }

    /// Learns one more feature of the person, at the distance it has.
    ///
    /// The damped average of CARPE-ID. The published factor for features, `min(1, d/2)`, makes the
    /// average follow features that are near, against its stated purpose; here they weigh less:
    /// `N max(1, 2/d)`. Far ones weigh less for the threshold: `N max(1, 2 d/lambda)`.
    pub fn learn(&mut self, feature: &[f32], distance: f64) {
        if !distance.is_finite() || feature.len() != self.mean.len() {
            return;
        }
        let slow = weight(self.updates, 2.0 / distance);
        let alpha = slow as f32;
        for ((x, mean), variance) in feature.iter().zip(&mut self.mean).zip(&mut self.variance) {
            let off = x - *mean;
            *mean += alpha * off;
            *variance += alpha * (off * off - *variance);
        }
        let alpha = weight(self.updates, 2.0 * distance / self.threshold());
        let off = distance - self.distance_mean;
        self.distance_mean += alpha * off;
        self.distance_variance += alpha * (off * off - self.distance_variance);
        self.updates = (self.updates + 1).min(MOST_UPDATES);
    }
}

/// `alpha = min(1, 2 / (N max(1, damping) + 1))`.
fn weight(updates: u32, damping: f64) -> f64 {
    if updates == 0 {
        return 1.0; // 0 times an infinite damping is no number
    }
    (2.0 / (f64::from(updates) * damping.max(1.0) + 1.0)).min(1.0)
}

fn least_deviation(feature: &[f32]) -> f32 {
    let squares: f32 = feature.iter().map(|x| x * x).sum();
    LEAST_DEVIATION * (squares / feature.len() as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_several_features_has_to_be_nearer() {
        let mut model = AppearanceModel::first(&[1.0, 0.0]).unwrap();
        (model.distance_mean, model.distance_variance) = (1.5, 0.25);
        // By hand: 1.5 + 2 * 0.5, and a half of the spread for four and more.
        assert_eq!(model.threshold(), 2.5);
        assert_eq!(model.threshold_of(1), 2.5);
        assert_eq!(model.threshold_of(4), 2.0);
        assert_eq!(model.threshold_of(100), 2.0);
    }

    #[test]
    fn weights_are_those_of_the_damped_average() {
        // By hand: N = 3, damping 1: 2/4; damping 2: 2/7; the first always replaces.
        assert_eq!(weight(0, f64::INFINITY), 1.0);
        assert_eq!(weight(3, 0.2), 0.5);
        assert_eq!(weight(3, 2.0), 2.0 / 7.0);
        assert_eq!(weight(3, f64::INFINITY), 0.0);
    }

    #[test]
    fn near_features_weigh_less_for_the_mean_and_far_ones_for_the_threshold() {
        // Updates by hand. The first leaves distances of 0 +- 1, so that the threshold is 2.
        let known = || {
            let mut model = AppearanceModel::first(&[1.0, 0.0]).unwrap();
            model.learn(&[1.0, 0.0], 0.0);
            model
        };
        // Near: damping 4 for the feature (alpha 0.4), none for the threshold (alpha 1).
        let mut model = known();
        model.learn(&[0.0, 1.0], 0.5);
        assert!((model.threshold() - 1.5).abs() < 1e-6, "{model:?}");
        // Mean (0.6, 0.4), variance 0.4 each: 1 / 0.4 / 2.
        let distance = model.distance(&[1.6, 0.4]);
        assert!((distance - 1.25_f64.sqrt()).abs() < 1e-5, "{distance}");
        // Far: none for the feature (alpha 1), 4 for the threshold (alpha 0.4).
        let mut model = known();
        model.learn(&[0.0, 1.0], 4.0);
        let expected = 1.6 + 2.0 * 7.0_f64.sqrt();
        assert!((model.threshold() - expected).abs() < 1e-6, "{model:?}");
        // Mean (0, 1), variance 1 each: 4 / 1 / 2.
        let distance = model.distance(&[2.0, 1.0]);
        assert!((distance - 2.0_f64.sqrt()).abs() < 1e-5, "{distance}");
    }

    #[test]
    fn a_feature_seen_once_is_near_and_another_is_far() {
        let model = AppearanceModel::first(&[1.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!(model.distance(&[1.0, 0.0, 0.0, 0.0]), 0.0);
        // Deviation 0.5 x 0.5 in each number: sqrt(2 x 16 / 4).
        let other = model.distance(&[0.0, 1.0, 0.0, 0.0]);
        assert!((other - 8.0_f64.sqrt()).abs() < 1e-6, "{other}");
        assert!(other > model.threshold());
    }

    #[test]
    fn what_says_nothing_is_infinitely_far() {
        assert_eq!(AppearanceModel::first(&[0.0, 0.0]), None);
        let model = AppearanceModel::first(&[1.0, 0.0]).unwrap();
        for feature in [&[0.0, 0.0][..], &[f32::NAN, 1.0], &[1.0]] {
            assert_eq!(model.distance(feature), f64::INFINITY);
        }
    }

    #[test]
    fn a_standing_person_s_model_stays_and_its_threshold_stays_above_nought() {
        let feature = [0.6, 0.8, 0.0, 0.0];
        let mut model = AppearanceModel::first(&feature).unwrap();
        for k in 0..500 {
            let wobble = 0.02 * (f64::from(k) * 0.7).sin() as f32;
            let seen = [0.6 + wobble, 0.8 - wobble, wobble, 0.0];
            let distance = model.distance(&seen);
            model.learn(&seen, distance);
        }
        assert_eq!(model.threshold(), LEAST_THRESHOLD);
        assert!(model.distance(&feature) < model.threshold());
        assert!(model.distance(&[0.0, 0.0, 0.6, 0.8]) > model.threshold());
    }
}
