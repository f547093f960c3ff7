//! `legs`: joints and feet to the ground under the robot and to its motion.

use hachi_hal::{ImuSample, OdometrySample, Pose, Stamp};
use hachi_runtime::{Progress, Receiver, Sender, Work};
use hachi_unitree::{BodySample, LegTracker};

/// The task.
pub struct Legs {
    /// Contacts, footprint, odometry.
    pub tracker: LegTracker,
    /// Samples of the robot's body.
    pub bodies: Receiver<BodySample>,
    /// Motion, to the scans' odometry.
    pub motion: Sender<OdometrySample>,
    /// The robot's inertial samples, to the scans' odometry, where that shall have them.
    pub inertial: Option<Sender<ImuSample>>,
    /// Where the ground is, to the filters: `footprint_from_base`.
    pub ground: Sender<(Stamp, Pose)>,
    /// To the recorder, if there is one.
    pub record: Option<Sender<(BodySample, OdometrySample)>>,
}

impl Work for Legs {
    fn run(&mut self, _: Stamp) -> Progress {
        while let Some(sample) = self.bodies.receive() {
            // A sample that is not later, or not finite, is left out; the next one follows in 2 ms.
            let Ok(estimate) = self.tracker.step(&sample) else {
                continue;
            };
            let _ = self.motion.send(estimate.motion.sample);
            if let Some(inertial) = &self.inertial {
                let _ = inertial.send(sample.imu);
            }
            if let Some(record) = &self.record {
                let _ = record.send((sample, estimate.motion.sample));
            }
            if let Some(footprint) = estimate.footprint {
                let _ = self
                    .ground
                    .send((footprint.stamp, footprint.footprint_from_base));
            }
        }
        Progress::Done
    }
}
