//! Times of many steps, as reports have them.

use hachi_runtime::Summary;
use serde::Serialize;

/// A summary of many times, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct LatencySummary {
    /// Mean.
    #[serde(rename = "mean")]
    pub mean_ms: f64,
    /// Half of them were no longer.
    #[serde(rename = "p50")]
    pub p50_ms: f64,
    /// 99 of 100 were no longer.
    #[serde(rename = "p99")]
    pub p99_ms: f64,
    /// The longest.
    #[serde(rename = "max")]
    pub max_ms: f64,
}

impl From<Summary> for LatencySummary {
    fn from(times: Summary) -> Self {
        Self {
            mean_ms: times.mean_ms,
            p50_ms: times.p50_ms,
            p99_ms: times.p99_ms,
            max_ms: times.max_ms,
        }
    }
}
