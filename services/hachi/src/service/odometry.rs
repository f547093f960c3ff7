//! `odometry`: where each scan was.

use std::sync::{Arc, Mutex, PoisonError};

use hachi_behaviour::PlaceEstimate;
use hachi_hal::{Clock, ImuSample, OdometrySample, Pose, Stamp};
use hachi_odometry::{Odometry, ScanInput};
use hachi_runtime::{Histogram, Progress, Receiver, Sender, TaskClock, Work};

use super::crew::Crew;
use super::messages::{Belt, BeltEnd, Correction, Kept, Placed};
use super::signs::SharedSigns;
use crate::record::RunRecord;
use crate::slam_stage::deskew_into;

/// Samples of the legs, and inertial ones, that are kept for the scan they belong to: half a second
/// of a B1, a quarter of a sensor that measures a thousand times a second.
pub const SAMPLES: usize = 256;

/// The task.
pub struct OdometryTask {
    /// The odometry.
    pub odometry: Odometry,
    /// Where the LiDAR sits.
    pub base_from_lidar: Pose,
    /// From the filters.
    pub scans: BeltEnd<Kept>,
    /// By the legs.
    pub motion: Receiver<OdometrySample>,
    /// The samples that a scan may ask for.
    pub samples: Vec<OdometrySample>,
    /// Inertial samples in the base's axes.
    pub inertial: Receiver<ImuSample>,
    /// Those that a scan may ask for.
    pub inertial_samples: Vec<ImuSample>,
    /// From SLAM.
    pub corrections: Receiver<Correction>,
    /// The last of them.
    pub correction: Correction,
    /// To SLAM.
    pub out: Belt<Placed>,
    /// To whoever wants to know where the robot is.
    pub places: [Sender<PlaceEstimate>; 2],
    /// What was done so far.
    pub record: Arc<Mutex<RunRecord>>,
    /// From the first and from the last point of a scan to its pose.
    pub latencies: [Arc<Histogram>; 2],
    /// Where the last place is left.
    pub signs: SharedSigns,
    /// The clock that latencies are measured on.
    pub clock: TaskClock,
    /// Helpers.
    pub crew: Crew,
    /// Whether the legs' motion goes into the odometry.
    pub uses_legs: bool,
}

impl Work for OdometryTask {
    fn run(&mut self, _: Stamp) -> Progress {
        self.crew.assemble();
        let Some(kept) = self.scans.full.receive() else {
            return Progress::Done;
        };
        gather(&self.motion, &mut self.samples);
        gather(&self.inertial, &mut self.inertial_samples);
        self.place(&kept);
        self.scans.give_back(kept);
        match self.scans.full.is_empty() {
            true => Progress::Done,
            false => Progress::More,
        }
    }
}

impl OdometryTask {
    fn place(&mut self, kept: &Kept) {
        let header = &kept.header;
        let input = ScanInput {
            header,
            points: &kept.points,
            imu: &self.inertial_samples,
            odometry: match self.uses_legs {
                true => &self.samples,
                false => &[],
            },
        };
        let estimate = self.odometry.step(&input);
        let base_from_lidar = self.base_from_lidar;
        let odom_from_base = base_from_lidar * estimate.odom_from_lidar * base_from_lidar.inverse();
        self.correction = self.corrections.newest().unwrap_or(self.correction);
        let place = PlaceEstimate {
            stamp: estimate.stamp,
            map_from_base: self.correction.map_from_odom * odom_from_base,
            trusted: self.correction.trusted && !is_lost(&estimate),
        };
        for out in &self.places {
            let _ = out.send(place);
        }
        let now = self.clock.now();
        for (latency, from) in self.latencies.iter().zip([header.start, header.end]) {
            latency.record_signed_ns(now.nanos_since(from));
        }
        if let Some(filtered) = &kept.filtered {
            // Nobody else looks at it while the task runs.
            let mut record = self.record.lock().unwrap_or_else(PoisonError::into_inner);
            record.account(kept.scanned, filtered, &estimate, odom_from_base);
        }
        if let Some(mut placed) = self.out.empty.receive() {
            placed.points.clear();
            deskew_into(
                header,
                &kept.points,
                &self.odometry,
                &base_from_lidar,
                &mut placed.points,
            );
            (placed.estimate, placed.odom_from_base) = (Some(estimate), odom_from_base);
            placed.begun = kept.begun;
            self.out.send(placed);
        }
    }
}

/// Takes in what has come, and lets the oldest go.
fn gather<T>(come: &Receiver<T>, kept: &mut Vec<T>) {
    while let Some(sample) = come.receive() {
        if kept.len() >= SAMPLES {
            kept.remove(0);
        }
        kept.push(sample);
    }
}

fn is_lost(estimate: &hachi_odometry::Estimate) -> bool {
    matches!(estimate.condition, hachi_odometry::Condition::Lost(_))
}
