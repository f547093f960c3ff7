//! What was measured of the motion beside the scans, kept as long as a scan may ask for it.
//!
//! In: a bag with `sensor_msgs/Imu` or `nav_msgs/Odometry`, or a capture with the states of a robot. Out: the samples around each scan.

use std::collections::BTreeSet;
use std::path::Path;

use hachi_bridge::{Bag, Body, Input, MessageKind};
use hachi_hal::{ImuSample, OdometrySample, Pose, Stamp};
use tracing::{info, warn};

use crate::config::MotionInput;
use crate::exit::Failure;
use crate::leg_samples::LegSamples;
use crate::recorder::IMU_ON_BUS;
use crate::service::settings::Platform;

/// Samples kept before the last scan's end: a gap of this length is not bridged anyway.
const KEEP_NS: i64 = 100_000_000;

/// Samples from a recording, or none.
#[derive(Default)]
pub struct MotionSamples {
    bag: Option<Bag>,
    legs: Option<LegSamples>,
    imu: Vec<ImuSample>,
    odometry: Vec<OdometrySample>,
}

impl MotionSamples {
    /// The samples that the settings ask for; also those of a robot's legs where its states are in
    /// the recording and nothing else was asked for.
    ///
    /// # Errors
    /// They ask for samples that the recording does not hold.
    pub fn open(path: &Path, wanted: MotionInput, platform: Option<&str>) -> Result<Self, Failure> {
        if wanted != MotionInput::Imu
            && let Some(platform) = platform.and_then(Platform::of_name)
            && let Some(legs) = LegSamples::find(path, &platform)
        {
            info!(
                robot = platform.robot.name(),
                "the robot's states are in the recording"
            );
            return Ok(Self {
                legs: Some(legs),
                ..Self::default()
            });
        }
        let kind = match wanted {
            MotionInput::None => return Ok(Self::default()),
            MotionInput::Imu => MessageKind::Imu,
            MotionInput::Odometry => MessageKind::Odometry,
        };
        let missing = |why: &dyn std::fmt::Display| {
            Failure::new(
                format_args!("{} has no {wanted:?} samples: {why}", path.display()),
                "set motion = \"none\" or give a bag that has them",
            )
        };
        let input = Input::recognise(path).map_err(|e| missing(&e))?;
        if !input.kind.is_bag() {
            return Err(missing(&input.kind.description()));
        }
        let mut bag = Bag::open(path).map_err(|e| missing(&e))?;
        let of_kind = bag.topics().iter().filter(|t| t.kind == Some(kind));
        let topics: BTreeSet<String> = of_kind.map(|t| t.name.clone()).collect();
        // Two sensors in turn would be none: they are mounted apart.
        let Some(chosen) = topics.get(IMU_ON_BUS).or(topics.first()) else {
            return Err(missing(&"no topic of that type"));
        };
        if topics.len() > 1 {
            warn!(topic = chosen, ?topics, "one of several topics is used");
        }
        bag.retain(|topic| topic.kind == Some(kind) && topic.name == *chosen);
        Ok(Self {
            bag: Some(bag),
            ..Self::default()
        })
    }

    /// Forgets what lies before `from` and reads on past `until`.
    pub fn read_until(&mut self, from: Stamp, until: Stamp) {
        if let Some(legs) = &mut self.legs {
            let oldest = from + -KEEP_NS;
            self.odometry.retain(|s| s.stamp >= oldest);
            // The last one read lies beyond the scan before, and may do for this one.
            if self.odometry.last().is_none_or(|s| s.stamp < until) {
                legs.read_until(until, |sample| self.odometry.push(sample));
            }
            return;
        }
        let Some(bag) = &mut self.bag else { return };
        let oldest = from + -KEEP_NS;
        self.imu.retain(|s| s.stamp >= oldest);
        self.odometry.retain(|s| s.stamp >= oldest);
        let newest = |imu: &[ImuSample], odometry: &[OdometrySample]| {
            imu.last()
                .map(|s| s.stamp)
                .max(odometry.last().map(|s| s.stamp))
        };
        while newest(&self.imu, &self.odometry).is_none_or(|stamp| stamp < until) {
            match bag.next_message() {
                Ok(Some(message)) => match message.body {
                    // Stamps that run backwards would break the integration.
                    Body::Imu(s) if self.imu.last().is_none_or(|l| l.stamp < s.stamp) => {
                        self.imu.push(s);
                    }
                    Body::Odometry(s) if self.odometry.last().is_none_or(|l| l.stamp < s.stamp) => {
                        self.odometry.push(s);
                    }
                    _ => {}
                },
                Ok(None) => {
                    self.bag = None;
                    return;
                }
                Err(error) => warn!(%error, "a motion sample was left out"),
            }
        }
    }

    /// Inertial samples around the scan.
    pub fn imu(&self) -> &[ImuSample] {
        &self.imu
    }

    /// Where the ground is at a scan's end, as the legs feel it.
    pub fn footprint_from_base(&self, at: Stamp) -> Option<Pose> {
        self.legs.as_ref()?.footprint_from_base(at)
    }

    /// States of the robot that were used so far.
    pub fn leg_states(&self) -> u64 {
        self.legs.as_ref().map_or(0, LegSamples::states)
    }

    /// Odometry around the scan.
    pub fn odometry(&self) -> &[OdometrySample] {
        &self.odometry
    }
}
