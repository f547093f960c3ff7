//! `slam`: nodes, loops and a map that stays true.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

use hachi_hal::Stamp;
use hachi_runtime::{Histogram, Progress, Sender, Work};
use hachi_slam::SlamCondition;

use super::crew::Crew;
use super::messages::{BeltEnd, Correction, Placed};
use super::signs::SharedSigns;
use crate::slam_stage::SlamStage;

/// What the task leaves out, step by step.
pub const LADDER: &[&str] = &["every second scan"];

/// The task.
pub struct SlamTask {
    /// SLAM; the session takes it when the task has ended.
    pub stage: Arc<Mutex<SlamStage>>,
    /// From odometry.
    pub scans: BeltEnd<Placed>,
    /// Back to it.
    pub corrections: Sender<Correction>,
    /// What the task leaves for whoever asks.
    pub signs: SharedSigns,
    /// Helpers.
    pub crew: Crew,
    /// The step of the ladder.
    pub level: usize,
    /// Scans so far.
    pub count: u64,
    /// From the beginning of the work on a scan to its end here.
    pub scan_times: Arc<Histogram>,
}

impl Work for SlamTask {
    fn run(&mut self, _: Stamp) -> Progress {
        self.crew.assemble();
        let Some(placed) = self.scans.full.receive() else {
            return Progress::Done;
        };
        self.count += 1;
        let left_out = self.level > 0 && self.count.is_multiple_of(2);
        if let Some(estimate) = placed.estimate.as_ref().filter(|_| !left_out) {
            // Nobody else looks at it while the task runs.
            let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
            let place = stage.step_placed(estimate, placed.odom_from_base, &placed.points);
            let signs = &self.signs;
            signs.condition.set(place.condition.name());
            signs
                .nodes
                .store(stage.slam().map().nodes().len() as u64, Ordering::Relaxed);
            signs
                .loops
                .store(stage.loop_counts().accepted, Ordering::Relaxed);
            signs
                .store_fails
                .store(stage.store_fails(), Ordering::Relaxed);
            let _ = self.corrections.send(Correction {
                map_from_odom: place.map_from_odom,
                trusted: matches!(
                    place.condition,
                    SlamCondition::Ok | SlamCondition::Degraded(_)
                ),
            });
        }
        if let Some(begun) = placed.begun {
            self.scan_times.record(begun.elapsed());
        }
        self.scans.give_back(placed);
        match self.scans.full.is_empty() {
            true => Progress::Done,
            false => Progress::More,
        }
    }

    fn degrade(&mut self, level: usize) {
        self.level = level;
    }
}
