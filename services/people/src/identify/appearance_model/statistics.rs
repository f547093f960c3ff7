//! A model's numbers, for whoever keeps them from one day to the next.
//!
//! In: a model. Out: its numbers, and a model again from numbers that can be those of one.

use super::{AppearanceModel, MOST_UPDATES};

/// No network's features are longer.
pub const MOST_NUMBERS: usize = 1 << 16;

/// The numbers of an [`AppearanceModel`]: what it needs to go on learning.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Statistics {
    /// Mean of each number of the feature.
    pub mean: Vec<f32>,
    /// Variance of each.
    pub variance: Vec<f32>,
    /// The least deviation that counts.
    pub least_deviation: f32,
    /// Mean of the person's own distances.
    pub distance_mean: f64,
    /// Variance of these.
    pub distance_variance: f64,
    /// How often the model was updated, up to where older features are forgotten.
    pub updates: u32,
}

/// Numbers that no model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotAModel {
    /// A model of nothing, of too much, or with a variance for more or fewer numbers.
    #[error("{mean} means and {variance} variances are no model")]
    Lengths {
        /// How many means.
        mean: usize,
        /// How many variances.
        variance: usize,
    },
    /// A number is not finite, or negative where none can be.
    #[error("its {what} is no number that a model has")]
    Number {
        /// Which.
        what: &'static str,
    },
}

impl Statistics {
    /// Whether these can be the numbers of a model.
    ///
    /// # Errors
    /// [`NotAModel`].
    pub fn check(&self) -> Result<(), NotAModel> {
        let (mean, variance) = (self.mean.len(), self.variance.len());
        if mean != variance || !(1..=MOST_NUMBERS).contains(&mean) {
            return Err(NotAModel::Lengths { mean, variance });
        }
        let from_nought = |x: f64| x.is_finite() && x >= 0.0;
        let variances = self.variance.iter().all(|v| from_nought(f64::from(*v)));
        let numbers = [
            ("mean", self.mean.iter().all(|m| m.is_finite())),
            ("variance", variances),
            (
                "least deviation",
                self.least_deviation.is_finite() && self.least_deviation > 0.0,
            ),
            ("mean distance", from_nought(self.distance_mean)),
            ("variance of distances", from_nought(self.distance_variance)),
            ("number of updates", self.updates <= MOST_UPDATES),
        ];
        match numbers.into_iter().find(|(_, fine)| !fine) {
            Some((what, _)) => Err(NotAModel::Number { what }),
            None => Ok(()),
        }
    }
}

impl AppearanceModel {
    /// Its numbers.
    pub fn statistics(&self) -> Statistics {
        Statistics {
            mean: self.mean.clone(),
            variance: self.variance.clone(),
            least_deviation: self.least_deviation,
            distance_mean: self.distance_mean,
            distance_variance: self.distance_variance,
            updates: self.updates,
        }
    }

    /// The model of these numbers, as it was.
    ///
    /// # Errors
    /// [`NotAModel`].
    pub fn from_statistics(statistics: Statistics) -> Result<Self, NotAModel> {
        statistics.check()?;
        Ok(Self {
            mean: statistics.mean,
            variance: statistics.variance,
            least_deviation: statistics.least_deviation,
            distance_mean: statistics.distance_mean,
            distance_variance: statistics.distance_variance,
            updates: statistics.updates,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learnt() -> AppearanceModel {
        let mut model = AppearanceModel::first(&[0.6, 0.8, 0.0]).unwrap();
        for feature in [[0.5, 0.8, 0.1], [0.7, 0.6, -0.1]] {
            let distance = model.distance(&feature);
            model.learn(&feature, distance);
        }
        model
    }

    #[test]
    fn a_model_comes_back_and_goes_on_as_it_would_have() {
        let mut model = learnt();
        let mut again = AppearanceModel::from_statistics(model.statistics()).unwrap();
        assert_eq!(again, model);
        for model in [&mut model, &mut again] {
            let distance = model.distance(&[0.0, 1.0, 0.2]);
            model.learn(&[0.0, 1.0, 0.2], distance);
        }
        assert_eq!(again, model);
    }

    #[test]
    fn numbers_of_no_model_are_refused_by_name() {
        let refused = |change: fn(&mut Statistics)| {
            let mut statistics = learnt().statistics();
            change(&mut statistics);
            let error = AppearanceModel::from_statistics(statistics).unwrap_err();
            error.to_string()
        };
        assert!(refused(|s| s.mean.clear()).contains("0 means and 3 variances"));
        assert!(refused(|s| s.mean[1] = f32::NAN).contains("its mean is"));
        assert!(refused(|s| s.variance[0] = -1e-9).contains("its variance is"));
        assert!(refused(|s| s.least_deviation = 0.0).contains("least deviation"));
        assert!(refused(|s| s.distance_mean = f64::INFINITY).contains("mean distance"));
        assert!(refused(|s| s.updates = 101).contains("updates"));
    }
}
