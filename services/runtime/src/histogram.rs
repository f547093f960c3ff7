//! Times in buckets: of fixed size, written by one task while others read it, no lock, no
//! allocation.
//!
//! Buckets widen with the time, as in an HDR histogram: 128 to each doubling, so that a percentile
//! is off by at most 0.4 %. Mean and maximum are exact. The same times give the same answer in any
//! order, whatever their number.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Buckets for each doubling, as a power of two.
const SPLIT_BITS: u32 = 7;
/// Times from here on share the last bucket: 2^41 ns, 37 minutes.
const TOP_BIT: u32 = 41;
const SPLIT: usize = 1 << SPLIT_BITS;
/// One bucket a nanosecond below 2^7, then `SPLIT` for each doubling up to 2^41.
const BUCKETS: usize = SPLIT * (TOP_BIT - SPLIT_BITS + 1) as usize;

/// Counts of times. 35 kB.
#[derive(Debug)]
pub struct Histogram {
    counts: Box<[AtomicU64]>,
    runs: AtomicU64,
    sum_ns: AtomicU64,
    max_ns: AtomicU64,
}

/// A summary of many times, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// How many.
    pub runs: u64,
    /// Mean.
    pub mean_ms: f64,
    /// Half of them were no longer.
    pub p50_ms: f64,
    /// 99 of 100 were no longer.
    pub p99_ms: f64,
    /// 999 of 1000 were no longer.
    pub p999_ms: f64,
    /// The longest.
    pub max_ms: f64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self::new()
    }
}

impl Histogram {
    /// No times yet. Allocates; recording does not.
    pub fn new() -> Self {
        Self {
            counts: (0..BUCKETS).map(|_| AtomicU64::new(0)).collect(),
            runs: AtomicU64::new(0),
            sum_ns: AtomicU64::new(0),
            max_ns: AtomicU64::new(0),
        }
    }

    /// Adds a time.
    pub fn record(&self, time: Duration) {
        self.record_ns(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    /// Adds a time of so many nanoseconds; of less than none as none.
    pub fn record_signed_ns(&self, nanos: i64) {
        self.record_ns(u64::try_from(nanos).unwrap_or(0));
    }

    fn record_ns(&self, nanos: u64) {
        // `bucket` is below BUCKETS for every time. The sum holds 584 years.
        self.counts[bucket(nanos)].fetch_add(1, Ordering::Relaxed);
        self.sum_ns.fetch_add(nanos, Ordering::Relaxed);
        self.max_ns.fetch_max(nanos, Ordering::Relaxed);
        self.runs.fetch_add(1, Ordering::Relaxed);
    }

    /// How many times were added.
    pub fn runs(&self) -> u64 {
        self.runs.load(Ordering::Relaxed)
    }

    /// All times together, seconds.
    pub fn sum_s(&self) -> f64 {
        self.sum_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }

    /// The time that `share` (0 to 1) of all times do not exceed, nanoseconds.
    pub fn percentile_ns(&self, share: f64) -> f64 {
        let max_ns = self.max_ns.load(Ordering::Relaxed) as f64;
        let wanted = ((share * self.runs() as f64).ceil() as u64).max(1);
        let mut seen = 0;
        for (index, count) in self.counts.iter().enumerate() {
            seen += count.load(Ordering::Relaxed);
            if seen >= wanted {
                return middle_ns(index).min(max_ns);
            }
        }
        max_ns
    }

    /// What they come down to; zeros if there are none.
    pub fn summary(&self) -> Summary {
        let runs = self.runs();
        if runs == 0 {
            return Summary::default();
        }
        let milliseconds = |nanos: f64| nanos * 1e-6;
        Summary {
            runs,
            mean_ms: 1e3 * self.sum_s() / runs as f64,
            p50_ms: milliseconds(self.percentile_ns(0.5)),
            p99_ms: milliseconds(self.percentile_ns(0.99)),
            p999_ms: milliseconds(self.percentile_ns(0.999)),
            max_ms: milliseconds(self.max_ns.load(Ordering::Relaxed) as f64),
        }
    }
}

/// The bucket of a time.
fn bucket(nanos: u64) -> usize {
    let nanos = nanos.min((1 << TOP_BIT) - 1);
    let doublings = (u64::BITS - nanos.leading_zeros()).saturating_sub(SPLIT_BITS + 1);
    doublings as usize * SPLIT + (nanos >> doublings) as usize
}

/// The middle of a bucket, nanoseconds.
fn middle_ns(index: usize) -> f64 {
    // Above the first doubling the top bit of a time is always set, so each has SPLIT buckets
    // that begin at SPLIT: indices 2 * SPLIT and on belong to the second doubling.
    let doublings = (index / SPLIT).saturating_sub(1);
    let low = ((index - doublings * SPLIT) as u64) << doublings;
    low as f64 + ((1u64 << doublings) - 1) as f64 / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_has_a_bucket_whose_middle_is_near() {
        let mut nanos = 1u64;
        while nanos < 1 << 40 {
            for time in [nanos - 1, nanos, nanos + nanos / 3] {
                let middle = middle_ns(bucket(time));
                assert!(
                    (middle - time as f64).abs() <= 0.004 * time as f64,
                    "{time} {middle}"
                );
            }
            nanos *= 2;
        }
        assert!(bucket(u64::MAX) < BUCKETS);
    }

    #[test]
    fn percentiles_of_one_to_a_thousand_milliseconds() {
        let histogram = Histogram::new();
        for millis in (1..=1000).rev() {
            histogram.record(Duration::from_millis(millis));
        }
        let summary = histogram.summary();
        assert_eq!(summary.runs, 1000);
        assert!((summary.mean_ms - 500.5).abs() < 1e-9);
        assert!((summary.p50_ms - 500.0).abs() < 2.0, "{summary:?}");
        assert!((summary.p99_ms - 990.0).abs() < 4.0, "{summary:?}");
        assert!((summary.p999_ms - 999.0).abs() < 4.0, "{summary:?}");
        assert_eq!(summary.max_ms, 1000.0);
    }

    #[test]
    fn one_time_is_its_own_summary_and_none_is_zeros() {
        let histogram = Histogram::new();
        assert_eq!(histogram.summary(), Summary::default());
        histogram.record(Duration::from_nanos(12_345_678));
        let summary = histogram.summary();
        assert!((summary.p50_ms - 12.345_678).abs() < 0.05);
        assert_eq!(summary.max_ms, 12.345_678);
        assert!(summary.p99_ms <= summary.max_ms);
    }
}
