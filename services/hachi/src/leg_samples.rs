//! A robot's legs from the states in a capture: where the ground is, and how the body moves.
//!
//! In: a capture in which a Unitree robot's HighStates went by besides the LiDAR's packets. Out: leg
//! odometry and `footprint_from_base` around each scan.

use std::fs::File;
use std::path::Path;

use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::{OdometrySample, PacketSource, Pose, Stamp};
use hachi_unitree::frame::HighState;
use hachi_unitree::fresh::ContentWatch;
use hachi_unitree::{LegTracker, Quadruped, reading};
use tracing::debug;

use crate::service::settings::Platform;

/// Packets looked at for a first state: three seconds of a VLP-16.
const LOOK_AT: usize = 2_500;

/// Largest UDP payload.
const MAX_PAYLOAD: usize = 65_536;

/// A ground that legs felt longer ago than this is not used, ns.
pub const GROUND_STALE_NS: i64 = 300_000_000;

/// The legs of one robot in one capture.
pub struct LegSamples {
    robot: &'static Quadruped,
    packets: CaptureSource<File>,
    buffer: Vec<u8>,
    watch: ContentWatch,
    tracker: LegTracker,
    ended: bool,
    ground: Option<(Stamp, Pose)>,
    states: u64,
}

impl LegSamples {
    /// The legs of this robot, if its states are in the capture.
    pub fn find(path: &Path, platform: &Platform) -> Option<Self> {
        let mut legs = Self::open(path, platform)?;
        let found = (0..LOOK_AT).any(|_| matches!(legs.next(), Some(Some(_))));
        // From the beginning: what was looked at counts too.
        found.then(|| Self::open(path, platform)).flatten()
    }

    fn open(path: &Path, platform: &Platform) -> Option<Self> {
        let packets = CaptureSource::open(path, CaptureConfig::on_ports(&[])).ok()?;
        Some(Self {
            robot: platform.robot,
            packets,
            buffer: vec![0; MAX_PAYLOAD],
            watch: ContentWatch::default(),
            tracker: LegTracker::new(platform.robot),
            ended: false,
            ground: None,
            states: 0,
        })
    }

    /// One more packet; of a new state, how the body moves. `None` at the end.
    fn next(&mut self) -> Option<Option<OdometrySample>> {
        let received = match self
            .packets
            .receive(&mut self.buffer, Stamp::from_nanos(i64::MAX))
        {
            Ok(Some(received)) => received,
            Ok(None) => return None,
            // A frame that can't be read; the LiDAR's reader counts it.
            Err(_) => return Some(None),
        };
        let bytes = &self.buffer[..received.len];
        // All that is not this robot's state is somebody else's.
        let Ok((state, _)) = HighState::decode(&self.robot.layout, bytes) else {
            return Some(None);
        };
        if !self.watch.is_new(bytes, received.stamp) {
            return Some(None);
        }
        let body = reading::body_sample(&state.body, &self.robot.joints, received.stamp);
        let estimate = body.ok().and_then(|body| self.tracker.step(&body).ok());
        let Some(estimate) = estimate else {
            debug!(stamp = %received.stamp, "a state was left out");
            return Some(None);
        };
        self.states += 1;
        if let Some(footprint) = estimate.footprint {
            self.ground = Some((footprint.stamp, footprint.footprint_from_base));
        }
        Some(Some(estimate.motion.sample))
    }

    /// Reads on past `until`; `each` is given how the body moves.
    pub fn read_until(&mut self, until: Stamp, mut each: impl FnMut(OdometrySample)) {
        while !self.ended {
            match self.next() {
                None => self.ended = true,
                Some(None) => {}
                Some(Some(sample)) => {
                    each(sample);
                    if sample.stamp >= until {
                        return;
                    }
                }
            }
        }
    }

    /// Where the ground is at a scan's end, as far as the legs know.
    pub fn footprint_from_base(&self, at: Stamp) -> Option<Pose> {
        let (stamp, pose) = self.ground?;
        (at.nanos_since(stamp).abs() < GROUND_STALE_NS).then_some(pose)
    }

    /// States that were used so far.
    pub fn states(&self) -> u64 {
        self.states
    }
}
