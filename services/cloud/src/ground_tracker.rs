//! The ground from scan to scan.
//!
//! In: each scan's points. Out: `footprint_from_lidar` for that scan, and where it came from. A
//! new plane near the last one is blended with it by its confidence; a jump needs a second scan
//! that agrees; with no ground in sight the last plane is carried for [`MAX_CARRIED`] scans.

use hachi_hal::{Point, Pose};

use crate::float::{dot, unit};
use crate::ground::{GroundFinder, GroundPlane, NoGround, footprint_from_lidar};
use crate::intensity::Height;
use crate::label::Reason;

/// Scans for which the plane is carried with no ground in sight: 2 s at 10 Hz, after which a
/// walking robot may stand at any angle.
pub const MAX_CARRIED: u32 = 20;
/// A step from one scan to the next that a body can make: 12 degrees and 0.25 m.
const MIN_COS_STEP: f32 = 0.978;
const MAX_STEP_M: f32 = 0.25;

/// Where the ground plane of a scan comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GroundSource {
    /// Seen in this scan.
    Seen {
        /// Confidence of the plane, 0 to 1.
        confidence: f32,
    },
    /// Carried from an earlier scan.
    Carried {
        /// How many scans ago it was seen.
        scans: u32,
        /// Why this scan gave none; `None` if it gave one too far from the last to believe yet.
        because: Option<NoGround>,
    },
    /// Not known.
    Unknown {
        /// Why this scan gave none.
        because: NoGround,
    },
}

/// The ground at one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundEstimate {
    /// Takes points in the sensor frame to the footprint frame; `None` if the ground is unknown.
    pub footprint_from_lidar: Option<Pose>,
    /// Where it comes from.
    pub source: GroundSource,
}

/// Follows the ground plane.
#[derive(Debug, Clone, Default)]
pub struct GroundTracker {
    finder: GroundFinder,
    last: Option<Height>,
    /// A plane far from the last one, waiting for a second that agrees.
    jumped: Option<Height>,
    carried: u32,
}

impl GroundTracker {
    /// The ground at this scan, from its kept points and what is known from before.
    pub fn step(&mut self, points: &[Point], labels: &[Reason]) -> GroundEstimate {
        match self.finder.find(points, labels, self.last) {
            Ok(plane) => self.seen(plane),
            Err(because) => self.carry(Some(because)),
        }
    }

    fn seen(&mut self, plane: GroundPlane) -> GroundEstimate {
        let believed = match (self.last, self.jumped) {
            (Some(last), _) if is_near(last, plane.height) => {
                // At least half the new plane: the body bobs within a few scans, and this scan's
                // own plane is what its points are judged by.
                blend(last, plane.height, 0.5 + 0.5 * plane.confidence)
            }
            (None, _) => plane.height,
            (Some(_), Some(jumped)) if is_near(jumped, plane.height) => plane.height,
            _ => {
                self.jumped = Some(plane.height);
                return self.carry(None);
            }
        };
        self.last = Some(believed);
        self.jumped = None;
        self.carried = 0;
        GroundEstimate {
            footprint_from_lidar: Some(footprint_from_lidar(believed)),
            source: GroundSource::Seen {
                confidence: plane.confidence,
            },
        }
    }

    fn carry(&mut self, because: Option<NoGround>) -> GroundEstimate {
        self.carried += 1;
        match (self.last, because) {
            (Some(last), because) if self.carried <= MAX_CARRIED => GroundEstimate {
                footprint_from_lidar: Some(footprint_from_lidar(last)),
                source: GroundSource::Carried {
                    scans: self.carried,
                    because,
                },
            },
            (_, because) => {
                self.last = None;
                self.jumped = None;
                self.carried = 0;
                GroundEstimate {
                    footprint_from_lidar: None,
                    source: GroundSource::Unknown {
                        because: because.unwrap_or(NoGround::NoPlane),
                    },
                }
            }
        }
    }
}

fn is_near(a: Height, b: Height) -> bool {
    dot(a.up, b.up) >= MIN_COS_STEP && (a.sensor_height_m - b.sensor_height_m).abs() <= MAX_STEP_M
}

/// `share` of `new`, the rest of `old`.
fn blend(old: Height, new: Height, share: f32) -> Height {
    let mix = |a: f32, b: f32| a + (b - a) * share;
    let up: [f32; 3] = core::array::from_fn(|axis| mix(old.up[axis], new.up[axis]));
    Height {
        up: unit(up).unwrap_or(new.up),
        sensor_height_m: mix(old.sensor_height_m, new.sensor_height_m),
    }
}
