//! What a run of the pipeline has done so far: counts, conditions, the path.

use hachi_cloud::{Filtered, IntensityUse, RemovalCounts};
use hachi_hal::Pose;
use hachi_odometry::{Condition, Estimate};
use hachi_trajectory::Trajectory;
use tracing::{info, warn};

use crate::report::{ConditionCounts, GuessCounts, Report, peak_rss_mb};

/// The record.
#[derive(Debug)]
pub struct RunRecord {
    /// `map_from_base` of each scan by odometry alone; the map's frame is the base's first pose.
    pub trajectory: Trajectory,
    keeps_path: bool,
    removed: RemovalCounts,
    conditions: ConditionCounts,
    guesses: GuessCounts,
    condition: Condition,
    intensity: Option<IntensityUse>,
    scans: u64,
    points: u64,
}

impl RunRecord {
    /// Nothing done yet. A run without an end keeps no path: memory would grow with it.
    pub fn new(keeps_path: bool) -> Self {
        Self {
            trajectory: Trajectory::new(),
            keeps_path,
            removed: RemovalCounts::of(&[]),
            conditions: ConditionCounts::default(),
            guesses: GuessCounts::default(),
            condition: Condition::Ok,
            intensity: None,
            scans: 0,
            points: 0,
        }
    }

    /// One more scan of so many points.
    pub fn account(&mut self, points: usize, filtered: &Filtered, estimate: &Estimate, pose: Pose) {
        if self.keeps_path && self.trajectory.push(estimate.stamp, pose).is_err() {
            warn!(stamp = %estimate.stamp, "a scan is not later than the one before it");
        }
        self.scans += 1;
        self.points += points as u64;
        self.removed += filtered.counts;
        self.conditions.count(&estimate.condition);
        self.guesses.count(estimate.guess);
        if estimate.condition != self.condition {
            info!(scan = self.scans - 1, "{}", estimate.condition);
            self.condition = estimate.condition;
        }
        if self.intensity != Some(filtered.intensity) {
            match filtered.intensity {
                IntensityUse::NoSignal => warn!(
                    "the scans carry no usable intensities: the intensity filter removes nothing"
                ),
                IntensityUse::NoGround => warn!(
                    "the ground is not found: the intensity filter removes nothing until it is"
                ),
                IntensityUse::Off | IntensityUse::Ran => {}
            }
            self.intensity = Some(filtered.intensity);
        }
    }

    /// A scan that was left out: its stamp is not later than the one before.
    pub fn count_repeated(&mut self) {
        self.conditions.not_later += 1;
    }

    /// Scans so far.
    pub fn scans(&self) -> u64 {
        self.scans
    }

    /// A report with what is known here, for a path on the map.
    pub fn report(&self, trajectory: &Trajectory) -> Report {
        let mut report = Report {
            scans: self.scans,
            points: self.points,
            duration_s: trajectory.duration_s(),
            path_length_m: trajectory.path_length_m(),
            threads: rayon::current_num_threads(),
            peak_rss_mb: peak_rss_mb(),
            conditions: self.conditions,
            guesses: self.guesses,
            ..Report::default()
        };
        for (reason, count) in self.removed.iter() {
            report.drop_for(reason, count);
        }
        report
    }
}
