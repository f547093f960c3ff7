//! `report.json`: what a run did, for scripts and for people who compare runs.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use hachi_odometry::{Condition, Guess};
use hachi_runtime::{Histogram, Summary};
use hachi_slam::SlamCondition;
use serde::Serialize;

use crate::exit::Failure;
use crate::latency::LatencySummary;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RunState {
    /// It came to the end of its input.
    #[default]
    Finished,
    /// The user stopped it; the files hold what was done until then.
    Interrupted,
    /// The input broke off or could not be read further; the files hold what came before.
    InputFailed,
    /// A file could not be written.
    OutputFailed,
}

/// What a run of a pipeline did.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Report {
    /// Scans processed.
    pub scans: u64,
    /// Points in them.
    pub points: u64,
    /// Time that passed in the input, seconds.
    pub duration_s: f64,
    /// Length of the trajectory, metres.
    pub path_length_m: f64,
    /// How long each stage took, by name.
    pub stages: BTreeMap<String, StageTimes>,
    /// How long one scan took through all stages, milliseconds.
    pub total_per_scan_ms: LatencySummary,
    /// Loops.
    pub loops: LoopCounts,
    /// Submaps that were given up because the map could not be kept for long; absent if none were.
    #[serde(skip_serializing_if = "is_zero")]
    pub submaps_given_up: u64,
    /// What was left out, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// How far the poses can be trusted.
    pub conditions: ConditionCounts,
    /// What the scans were expected by.
    pub guesses: GuessCounts,
    /// How far their places on the map could be trusted, with SLAM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map_conditions: Option<MapConditionCounts>,
    /// Threads that worked.
    pub threads: usize,
    /// The most memory the process held, MiB; absent where the system does not say.
    pub peak_rss_mb: Option<f64>,
    /// How it ended.
    pub state: RunState,
}

/// For serde.
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// How far the scans' poses can be trusted: how many of each condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct ConditionCounts {
    /// As usual.
    pub ok: u64,
    /// Carried or guessed in part.
    pub degraded: u64,
    /// Carried for long.
    pub lost: u64,
    /// Scans left out because their stamp was not later than the one before.
    pub not_later: u64,
}

impl ConditionCounts {
    /// One more scan.
    pub fn count(&mut self, condition: &Condition) {
        match condition {
            Condition::Ok => self.ok += 1,
            Condition::Degraded(_) => self.degraded += 1,
            Condition::Lost(_) => self.lost += 1,
        }
    }
}

/// What the scans were expected by, besides the scans before them: how many by each. Legs or a
/// gyroscope that were given and did not reach the scan's end count as speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct GuessCounts {
    /// The speed of the scans before.
    pub speed: u64,
    /// A gyroscope.
    pub gyroscope: u64,
    /// Legs, wheels or another odometry.
    pub odometry: u64,
}

impl GuessCounts {
    /// One more scan.
    pub fn count(&mut self, guess: Guess) {
        match guess {
            Guess::Speed => self.speed += 1,
            Guess::Gyroscope => self.gyroscope += 1,
            Guess::Odometry => self.odometry += 1,
        }
    }
}

/// How far the places on the map could be trusted when they were found: how many of each condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MapConditionCounts {
    /// As usual.
    pub ok: u64,
    /// Carried or guessed in part.
    pub degraded: u64,
    /// Not on the map.
    pub lost: u64,
    /// Found again, and not yet confirmed.
    pub recovering: u64,
}

impl MapConditionCounts {
    /// One more scan.
    pub fn count(&mut self, condition: &SlamCondition) {
        match condition {
            SlamCondition::Ok => self.ok += 1,
            SlamCondition::Degraded(_) => self.degraded += 1,
            SlamCondition::Lost(_) => self.lost += 1,
            SlamCondition::Recovering(_) => self.recovering += 1,
        }
    }
}

/// How long one stage took, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StageTimes {
    /// How often it ran.
    pub runs: u64,
    /// Mean.
    pub mean_ms: f64,
    /// Half of the runs were no longer.
    pub p50_ms: f64,
    /// 99 of 100 runs were no longer.
    pub p99_ms: f64,
    /// The longest run.
    pub max_ms: f64,
}

/// What became of loop candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LoopCounts {
    /// Places that looked like earlier ones.
    pub candidates: u64,
    /// Those that alignment confirmed.
    pub accepted: u64,
    /// Those it did not.
    pub refused: u64,
}

impl From<hachi_slam::LoopCounts> for LoopCounts {
    fn from(counts: hachi_slam::LoopCounts) -> Self {
        Self {
            candidates: counts.candidates,
            accepted: counts.accepted,
            refused: counts.refused,
        }
    }
}

impl From<Summary> for StageTimes {
    fn from(times: Summary) -> Self {
        Self {
            runs: times.runs,
            mean_ms: times.mean_ms,
            p50_ms: times.p50_ms,
            p99_ms: times.p99_ms,
            max_ms: times.max_ms,
        }
    }
}

impl Report {
    /// Adds `count` of what was left out for `reason`. Zero adds no entry.
    pub fn drop_for(&mut self, reason: &str, count: u64) {
        if count > 0 {
            *self.dropped.entry(reason.to_owned()).or_default() += count;
        }
    }

    /// Writes it to `path`, whole or not at all.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        write_json(path, self)
    }
}

/// Writes any report as indented JSON, whole or not at all.
///
/// # Errors
/// The file can't be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Failure> {
    let mut text = serde_json::to_vec_pretty(value)
        .map_err(|error| Failure::writing(path, &std::io::Error::from(error)))?;
    text.push(b'\n');
    hachi_bridge::write_file(path, &text).map_err(|error| Failure::unwritten(&error))
}

/// Times of the stages of a pipeline and of whole scans.
///
/// Stages are named once, at the start; recording then allocates nothing.
#[derive(Debug)]
pub struct StageRecorder {
    stages: Vec<(&'static str, Histogram)>,
    per_scan: Histogram,
}

impl StageRecorder {
    /// A recorder for stages of these names; a stage is recorded by its index here.
    pub fn new(names: &[&'static str]) -> Self {
        let stage = |name: &&'static str| (*name, Histogram::new());
        Self {
            stages: names.iter().map(stage).collect(),
            per_scan: Histogram::new(),
        }
    }

    /// One run of the stage at `index`; an index without a stage is ignored.
    pub fn stage(&mut self, index: usize, time: Duration) {
        if let Some((_, recorder)) = self.stages.get_mut(index) {
            recorder.record(time);
        }
    }

    /// One scan through all stages.
    pub fn scan(&mut self, time: Duration) {
        self.per_scan.record(time);
    }

    /// Puts the times into a report. Stages that never ran are left out.
    pub fn fill(&self, report: &mut Report) {
        for (name, recorder) in self.stages.iter().filter(|(_, r)| r.runs() > 0) {
            let times = recorder.summary().into();
            report.stages.insert((*name).to_owned(), times);
        }
        report.total_per_scan_ms = self.per_scan.summary().into();
    }
}

/// The most memory this process ever held in RAM, MiB. Linux only; `None` elsewhere.
pub fn peak_rss_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_json_has_the_keys_that_scripts_rely_on() {
        let mut times = StageRecorder::new(&["filter", "register"]);
        times.stage(0, Duration::from_millis(2));
        times.scan(Duration::from_millis(3));
        let mut report = Report::default();
        times.fill(&mut report);
        report.drop_for("range", 4);
        report.drop_for("range", 1);
        report.drop_for("outlier", 0);

        let json = serde_json::to_value(&report).unwrap();
        for key in [
            "scans",
            "points",
            "duration_s",
            "path_length_m",
            "stages",
            "total_per_scan_ms",
            "loops",
            "dropped",
            "threads",
            "peak_rss_mb",
            "state",
        ] {
            assert!(json.get(key).is_some(), "{key}");
        }
        assert_eq!(json["stages"]["filter"]["runs"], 1);
        assert_eq!(json["stages"]["filter"]["max_ms"], 2.0);
        assert!(json["stages"].get("register").is_none());
        for key in ["mean", "p50", "p99", "max"] {
            assert!(json["total_per_scan_ms"][key].is_number(), "{key}");
        }
        assert_eq!(json["dropped"], serde_json::json!({ "range": 5 }));
        assert_eq!(json["state"], "finished");

        assert!(json.get("submaps_given_up").is_none());
        report.submaps_given_up = 44;
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["submaps_given_up"], 44);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_process_holds_some_memory() {
        let peak = peak_rss_mb().unwrap();
        assert!((0.5..100_000.0).contains(&peak), "{peak}");
    }
}
