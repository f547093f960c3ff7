//! What was measured of the motion beside the scans, kept as long as a scan may ask for it.
//!
//! In: a bag with `sensor_msgs/Imu` or `nav_msgs/Odometry`. Out: the samples around each scan.

use std::path::Path;

use hachi_bridge::{Bag, Body, Input, MessageKind};
use hachi_hal::{ImuSample, OdometrySample, Stamp};
use tracing::warn;

use crate::config::MotionInput;
use crate::exit::Failure;

/// Samples kept before the last scan's end: a gap of this length is not bridged anyway.
const KEEP_NS: i64 = 100_000_000;

/// Samples from a recording, or none.
#[derive(Debug, Default)]
pub struct MotionSamples {
    bag: Option<Bag>,
    imu: Vec<ImuSample>,
    odometry: Vec<OdometrySample>,
}

impl MotionSamples {
    /// The samples that the settings ask for.
    ///
    /// # Errors
    /// They ask for samples that the recording does not hold.
    pub fn open(path: &Path, wanted: MotionInput) -> Result<Self, Failure> {
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
        if !bag.topics().iter().any(|t| t.kind == Some(kind)) {
            return Err(missing(&"no topic of that type"));
        }
        bag.retain(|topic| topic.kind == Some(kind));
        Ok(Self {
            bag: Some(bag),
            ..Self::default()
        })
    }

    /// Forgets what lies before `from` and reads on past `until`.
    pub fn read_until(&mut self, from: Stamp, until: Stamp) {
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

    /// Odometry around the scan.
    pub fn odometry(&self) -> &[OdometrySample] {
        &self.odometry
    }
}
