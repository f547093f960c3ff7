//! Robust kernels: how much an error that is too large to be noise still counts.

/// What an error costs. With `s = r' * information * r`, a factor adds `0.5 * cost(s)` to the
/// graph's error and pulls with `weight(s) = d cost / d s`.
///
/// All are `s` for small errors. Scales are in standard deviations, except `phi`, which is a squared
/// one. Huber, Cauchy and Geman-McClure as in Zhang, *Parameter estimation techniques* (1997);
/// dynamic covariance scaling after Agarwal et al., ICRA 2013.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Kernel {
    /// The square: no kernel.
    #[default]
    Quadratic,
    /// Linear from `delta` on: outliers pull, but no harder than at `delta`.
    Huber {
        /// Where linear begins.
        delta: f64,
    },
    /// Logarithmic: outliers pull less the further away they are.
    Cauchy {
        /// Where the weight is a half.
        scale: f64,
    },
    /// Bounded: an outlier costs `scale^2` at most.
    GemanMcClure {
        /// Where the weight is a quarter.
        scale: f64,
    },
    /// Dynamic covariance scaling: exactly quadratic up to `phi`, then weight
    /// `(2 phi / (phi + s))^2`, as switchable constraints with the switch solved for. For loop
    /// closures: good ones lose nothing, wrong ones let go.
    DynamicCovarianceScaling {
        /// The largest `s` that counts in full.
        phi: f64,
    },
}

impl Kernel {
    /// What an error counts, from `s >= 0`.
    pub fn cost(self, s: f64) -> f64 {
        match self {
            Self::Quadratic => s,
            Self::Huber { delta } if s > delta * delta => delta * (2.0 * s.sqrt() - delta),
            Self::Huber { .. } => s,
            Self::Cauchy { scale } => scale * scale * (s / (scale * scale)).ln_1p(),
            Self::GemanMcClure { scale } => s / (1.0 + s / (scale * scale)),
            // The integral of the weight.
            Self::DynamicCovarianceScaling { phi } if s > phi => {
                phi * (3.0 - 4.0 * phi / (phi + s))
            }
            Self::DynamicCovarianceScaling { .. } => s,
        }
    }

    /// How hard it pulls, 0 to 1, from `s >= 0`.
    #[inline]
    pub fn weight(self, s: f64) -> f64 {
        match self {
            Self::Quadratic => 1.0,
            Self::Huber { delta } if s > delta * delta => delta / s.sqrt(),
            Self::Huber { .. } => 1.0,
            Self::Cauchy { scale } => 1.0 / (1.0 + s / (scale * scale)),
            Self::GemanMcClure { scale } => (1.0 + s / (scale * scale)).powi(-2),
            Self::DynamicCovarianceScaling { phi } if s > phi => (2.0 * phi / (phi + s)).powi(2),
            Self::DynamicCovarianceScaling { .. } => 1.0,
        }
    }

    /// Whether its parameter is a positive number.
    pub fn is_valid(self) -> bool {
        match self {
            Self::Quadratic => true,
            Self::Huber { delta: v }
            | Self::Cauchy { scale: v }
            | Self::GemanMcClure { scale: v }
            | Self::DynamicCovarianceScaling { phi: v } => v.is_finite() && v > 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNELS: [Kernel; 5] = [
        Kernel::Quadratic,
        Kernel::Huber { delta: 1.5 },
        Kernel::Cauchy { scale: 2.0 },
        Kernel::GemanMcClure { scale: 2.0 },
        Kernel::DynamicCovarianceScaling { phi: 3.0 },
    ];

    #[test]
    fn the_weight_is_the_derivative_of_the_cost() {
        for kernel in KERNELS {
            for s in [0.01, 0.5, 2.0, 2.5, 4.0, 50.0, 1e4] {
                let h = 1e-5 * s;
                let slope = (kernel.cost(s + h) - kernel.cost(s - h)) / (2.0 * h);
                let weight = kernel.weight(s);
                assert!(
                    (slope - weight).abs() < 1e-6,
                    "{kernel:?} {s} {slope} {weight}"
                );
            }
        }
    }

    #[test]
    fn known_values() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        // |r| = 3 with delta 1.5: 2 * 1.5 * 3 - 1.5^2.
        close(Kernel::Huber { delta: 1.5 }.cost(9.0), 6.75);
        close(Kernel::Cauchy { scale: 2.0 }.weight(4.0), 0.5);
        close(Kernel::GemanMcClure { scale: 2.0 }.weight(4.0), 0.25);
        close(Kernel::GemanMcClure { scale: 2.0 }.cost(1e30), 4.0);
        let dcs = Kernel::DynamicCovarianceScaling { phi: 3.0 };
        close(dcs.cost(3.0), 3.0);
        // (2 * 3 / (3 + 9))^2.
        close(dcs.weight(9.0), 0.25);
    }

    #[test]
    fn a_scale_that_is_no_positive_number_is_not_valid() {
        assert!(KERNELS.iter().all(|k| k.is_valid()));
        for v in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(!Kernel::Huber { delta: v }.is_valid());
            assert!(!Kernel::DynamicCovarianceScaling { phi: v }.is_valid());
        }
    }
}
