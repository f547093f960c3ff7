//! What the filters of a robot are set to.

use alloc::vec::Vec;

use crate::crop::BodyBox;
use crate::intensity::{IntensityMode, RejectRange};

/// Settings of [`crate::Filters`]. The defaults work for a 16-beam LiDAR on a walking robot.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct FilterConfig {
    /// The robot's own body, in the base frame. Empty unless the platform gives it.
    pub body: Vec<BodyBox>,
    /// Returns nearer than this go, metres.
    pub near_m: f32,
    /// Returns farther than this go, metres.
    pub far_m: f32,
    /// Whether points that stand alone go. Off by default: alignment's robust kernel passes them
    /// over, and on the recordings of BENCHMARKS.md the errors are the same without it.
    pub outliers: bool,
    /// How many standard deviations above the mean a point's spacing may be.
    pub outlier_sigmas: f32,
    /// Which intensity filter runs.
    pub intensity: IntensityMode,
    /// Intensities that are not trusted. A pane's own returns are told by it too.
    pub reject: RejectRange,
    /// Whether the reject range is learnt from the scans, band by band of distance, instead.
    pub adaptive_reject: bool,
    /// Points lower than this above the footprint plane are ground, metres.
    pub ground_margin_m: f32,
    /// With [`IntensityMode::Normal`]: ground has `|cos| > 1 - normal_epsilon` between its normal
    /// and the footprint's z axis.
    pub normal_epsilon: f32,
    /// Whether mirror ghosts go.
    pub ghosts: bool,
    /// Whether the ceiling goes. For place recognition only: alignment needs it.
    pub ceiling: bool,
}

/// Crop from 0.3 m, where a VLP-16's returns begin to be unreliable, to 120 m, the farthest any
/// supported LiDAR reaches; outliers left to the alignment, else 3 sigma; the naive filter with the settled range and margin; `|cos|`
/// above 0.95, 18 degrees, which passes a ramp.
impl Default for FilterConfig {
    fn default() -> Self {
        Self {
            body: Vec::new(),
            near_m: 0.3,
            far_m: 120.0,
            outliers: false,
            outlier_sigmas: 3.0,
            intensity: IntensityMode::Naive,
            reject: RejectRange::default(),
            adaptive_reject: false,
            ground_margin_m: 0.05,
            normal_epsilon: 0.05,
            ghosts: true,
            ceiling: false,
        }
    }
}

/// A setting that no filter can work with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterConfigError {
    /// Near and far are the wrong way round, negative or not finite, or far beyond 10 km.
    #[error("near_m = {near_m}, far_m = {far_m}: need 0 <= near_m < far_m <= 10000")]
    Range {
        /// As given.
        near_m: f32,
        /// As given.
        far_m: f32,
    },
    /// A body box whose corners are the wrong way round or not finite.
    #[error("body box {index}: min_m {min_m:?} is not below max_m {max_m:?}")]
    Body {
        /// Which box, from 0.
        index: usize,
        /// As given.
        min_m: [f32; 3],
        /// As given.
        max_m: [f32; 3],
    },
    /// Low is above high, or one is NaN.
    #[error("reject.low = {low} is not below or equal to reject.high = {high}")]
    Reject {
        /// As given.
        low: f32,
        /// As given.
        high: f32,
    },
    /// A setting that has to be positive and finite is not.
    #[error("{key} = {value}: must be finite and above 0")]
    NotPositive {
        /// Its key.
        key: &'static str,
        /// As given.
        value: f32,
    },
    /// A setting that has to be finite is not.
    #[error("{key} = {value}: must be finite")]
    NotFinite {
        /// Its key.
        key: &'static str,
        /// As given.
        value: f32,
    },
}

impl FilterConfig {
    /// The first setting that can't work, if any.
    pub fn check(&self) -> Result<(), FilterConfigError> {
        let (near_m, far_m) = (self.near_m, self.far_m);
        if !(near_m >= 0.0 && near_m < far_m && far_m <= 10_000.0) {
            return Err(FilterConfigError::Range { near_m, far_m });
        }
        for (index, body) in self.body.iter().enumerate() {
            let (min_m, max_m) = (body.min_m, body.max_m);
            if !(0..3).all(|a| min_m[a] < max_m[a] && (max_m[a] - min_m[a]).is_finite()) {
                return Err(FilterConfigError::Body {
                    index,
                    min_m,
                    max_m,
                });
            }
        }
        let RejectRange { low, high } = self.reject;
        if low.is_nan() || high.is_nan() || low > high {
            return Err(FilterConfigError::Reject { low, high });
        }
        for (key, value) in [
            ("outlier_sigmas", self.outlier_sigmas),
            ("normal_epsilon", self.normal_epsilon),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FilterConfigError::NotPositive { key, value });
            }
        }
        if !self.ground_margin_m.is_finite() {
            return Err(FilterConfigError::NotFinite {
                key: "ground_margin_m",
                value: self.ground_margin_m,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn the_defaults_work_and_each_wrong_setting_is_named() {
        assert_eq!(FilterConfig::default().check(), Ok(()));
        let wrong = |change: fn(&mut FilterConfig)| {
            let mut config = FilterConfig::default();
            change(&mut config);
            config.check().expect_err("wrong on purpose").to_string()
        };
        use alloc::string::ToString;
        assert!(wrong(|c| c.near_m = f32::NAN).starts_with("near_m = NaN"));
        assert!(wrong(|c| c.far_m = f32::INFINITY).contains("far_m = inf"));
        assert!(wrong(|c| c.reject.low = 16.0).starts_with("reject.low = 16"));
        assert!(wrong(|c| c.outlier_sigmas = 0.0).starts_with("outlier_sigmas = 0"));
        assert!(wrong(|c| c.ground_margin_m = f32::NAN).starts_with("ground_margin_m"));
        let flat = BodyBox {
            min_m: [0.0; 3],
            max_m: [1.0, 1.0, 0.0],
        };
        let config = FilterConfig {
            body: vec![flat],
            ..FilterConfig::default()
        };
        assert!(config.check().is_err());
    }
}
