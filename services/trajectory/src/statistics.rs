//! What a list of errors comes down to.

/// Statistics of a list of errors, in the unit of the errors (metres here).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Statistics {
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Middle value; the mean of the two middle ones if `n` is even.
    pub median: f64,
    /// Standard deviation of this population (divided by `n`).
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// How many errors.
    pub n: usize,
}

impl Statistics {
    /// The statistics of `errors`; `None` if there are none.
    pub fn of(errors: &[f64]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let count = n as f64;
        let mean = sorted.iter().sum::<f64>() / count;
        let mean_square = sorted.iter().map(|e| e * e).sum::<f64>() / count;
        let variance = sorted.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / count;
        Some(Self {
            rmse: mean_square.sqrt(),
            mean,
            median: (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0,
            std: variance.sqrt(),
            min: sorted[0],
            max: sorted[n - 1],
            n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_worked_list() {
        // 1, 2, 3, 6: mean 3, mean square 12.5, variance 12.5 - 9 = 3.5.
        let s = Statistics::of(&[6.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!(s.mean, 3.0);
        assert_eq!(s.median, 2.5);
        assert!((s.rmse - 12.5f64.sqrt()).abs() < 1e-15);
        assert!((s.std - 3.5f64.sqrt()).abs() < 1e-15);
        assert_eq!((s.min, s.max, s.n), (1.0, 6.0, 4));
    }

    #[test]
    fn no_errors_have_no_statistics() {
        assert_eq!(Statistics::of(&[]), None);
    }
}
