//! `filter`: what stands around, for the gate; then which points odometry works with.

use std::time::Instant;

use hachi_behaviour::{ObstacleFinder, Obstacles};
use hachi_cloud::{Filters, ScanFrames};
use hachi_hal::{Pose, Stamp};
use hachi_runtime::{Progress, Receiver, Sender, Work};

use super::crew::Crew;
use super::messages::{Belt, BeltEnd, Kept, Scan};
use crate::leg_samples::GROUND_STALE_NS;

/// What the task leaves out, step by step.
pub const LADDER: &[&str] = &["every second point", "every second of the rest"];

/// The task.
pub struct Filter {
    /// The filters.
    pub filters: Filters,
    /// What stands around.
    pub finder: ObstacleFinder,
    /// Where the LiDAR sits.
    pub base_from_lidar: Pose,
    /// Where the ground is while the legs do not say: the robot stands as usual.
    pub usual_footprint_from_base: Pose,
    /// Where it is by the legs, last heard.
    pub felt: Option<(Stamp, Pose)>,
    /// By the legs.
    pub ground: Receiver<(Stamp, Pose)>,
    /// From the LiDAR.
    pub scans: BeltEnd<Scan>,
    /// To the gate, and to the patrol.
    pub obstacles: [Sender<Obstacles>; 2],
    /// To odometry.
    pub out: Belt<Kept>,
    /// Helpers.
    pub crew: Crew,
    /// The step of the ladder.
    pub level: usize,
}

impl Work for Filter {
    fn run(&mut self, _: Stamp) -> Progress {
        self.crew.assemble();
        let begun = Some(Instant::now());
        let Some(mut scan) = self.scans.full.receive() else {
            return Progress::Done;
        };
        let end = scan.header.end;
        self.felt = self.ground.newest().or(self.felt);
        let felt = self
            .felt
            .filter(|(stamp, _)| end.nanos_since(*stamp) < GROUND_STALE_NS);
        let felt = felt.map(|(_, footprint_from_base)| footprint_from_base * self.base_from_lidar);
        let usual = self.usual_footprint_from_base * self.base_from_lidar;
        let footprint_from_lidar = felt.unwrap_or(usual);
        let around = self.finder.find(end, &scan.points, &footprint_from_lidar);
        for out in &self.obstacles {
            let _ = out.send(around);
        }

        if let Some(mut kept) = self.out.empty.receive() {
            kept.scanned = scan.points.len();
            thin(&mut scan, self.level);
            let frames = ScanFrames {
                base_from_lidar: self.base_from_lidar,
                footprint_from_lidar: felt,
            };
            let filtered = self.filters.step(&scan.points, &frames, &mut kept.points);
            (kept.header, kept.filtered, kept.begun) = (scan.header, Some(filtered), begun);
            self.out.send(kept);
        }
        self.scans.give_back(scan);
        match self.scans.full.is_empty() {
            true => Progress::Done,
            false => Progress::More,
        }
    }

    fn degrade(&mut self, level: usize) {
        self.level = level;
    }
}

/// Leaves out points evenly, as the ladder says. The last stays: its time is the scan's end.
fn thin(scan: &mut Scan, level: usize) {
    let keep_one_of = 1usize << level;
    if keep_one_of > 1 {
        let mut left = scan.points.len();
        scan.points.retain(|_| {
            left -= 1;
            left.is_multiple_of(keep_one_of)
        });
    }
}
