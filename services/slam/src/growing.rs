//! The submap in the making: which scans join it, and when it is full.
//!
//! In: scan after scan as odometry placed them. Out: [`GrownSubmap`]s, each with its frame, its
//! surfaces and how odometry got from the one before to it.

use hachi_hal::{Pose, Stamp, Vector3};
use hachi_odometry::Condition;

use crate::anchor::Link;
use crate::config::SlamConfig;
use crate::ground::GroundSeeker;
use crate::input::ScanInput;
use crate::node::{Ground, levelled};
use crate::submap::{Submap, SubmapBuilder};
use crate::uncertainty::WayCovariance;

/// A node is not fixed before this many scans: what it costs is spread over them.
const LEAST_SCANS: usize = 10;

/// A robot that stands and does not know where it is looks around for this many scans.
const STANDING_SCANS: usize = 20;

/// A scan joins the submap when the robot has moved this far since the last that did, or turned.
const SCAN_EVERY_M: f64 = 0.2;
const SCAN_EVERY_RAD: f64 = 0.15;

/// Points of one scan that join, evenly picked: a 64-beam scan has more than cubes can tell apart.
const SCAN_POINTS: usize = 10_000;

/// A finished submap.
#[derive(Debug)]
pub struct GrownSubmap {
    /// The end of its first scan.
    pub stamp: Stamp,
    /// Its frame.
    pub odom_from_node: Pose,
    /// Distance travelled before it, metres.
    pub path_m: f64,
    /// Its surfaces.
    pub submap: Submap,
    /// The ground under it, where one was found.
    pub ground: Option<Ground>,
    /// Takes points of its frame to that of the submap before it, by odometry; with how surely.
    /// `None` for the first of a piece.
    pub way: Option<Link>,
}

/// The submap that is growing.
#[derive(Debug, Default)]
pub struct Growing {
    builder: SubmapBuilder,
    seeker: GroundSeeker,
    begun: Option<Begun>,
    /// The last scan that was placed.
    last: Option<Pose>,
    path_m: f64,
    /// From the frame of the growing submap to the present scan.
    way: WayCovariance,
    /// How the growing submap hangs on the one before.
    hangs: Option<Link>,
}

#[derive(Debug, Clone, Copy)]
struct Begun {
    stamp: Stamp,
    odom_from_node: Pose,
    odom_from_first: Pose,
    path_m: f64,
    scans: usize,
    joined_at: Option<Pose>,
}

impl Growing {
    /// Distance travelled so far, metres.
    pub fn path_m(&self) -> f64 {
        self.path_m
    }

    /// The frame of the growing submap.
    pub fn odom_from_node(&self) -> Option<Pose> {
        self.begun.map(|b| b.odom_from_node)
    }

    /// From the growing submap's frame to the present scan.
    pub fn way(&self) -> &WayCovariance {
        &self.way
    }

    /// Follows the robot to a scan; begins a submap there if there is none.
    pub fn follow(&mut self, scan: &ScanInput<'_>, up: &Vector3, config: &SlamConfig) {
        let moved = self
            .last
            .map_or_else(Pose::identity, |last| last.inv_mul(&scan.odom_from_base));
        let (moved_m, turned) = (moved.translation.vector.norm(), moved.rotation.angle());
        self.path_m += moved_m;
        self.last = Some(scan.odom_from_base);
        match &mut self.begun {
            Some(begun) => {
                begun.scans += 1;
                let rotation =
                    begun.odom_from_node.rotation.inverse() * scan.odom_from_base.rotation;
                let carried = !matches!(
                    scan.condition,
                    Condition::Ok | Condition::Degraded(hachi_odometry::Doubt::Unobserved { .. })
                );
                let open = Some(&scan.open).filter(|open| open.any());
                let noise = &config.odometry_noise;
                self.way
                    .add(noise, &rotation, moved_m, turned, open, carried);
            }
            None => self.begin(scan, up),
        }
    }

    fn begin(&mut self, scan: &ScanInput<'_>, up: &Vector3) {
        self.builder.clear();
        self.way = WayCovariance::default();
        self.begun = Some(Begun {
            stamp: scan.stamp,
            odom_from_node: levelled(&scan.odom_from_base, up),
            odom_from_first: scan.odom_from_base,
            path_m: self.path_m,
            scans: 1,
            joined_at: None,
        });
    }

    /// Whether this scan joins the submap: it was placed, and shows something new.
    pub fn joins(&self, odom_from_base: &Pose, condition: &Condition) -> bool {
        let placed = matches!(
            condition,
            Condition::Ok | Condition::Degraded(hachi_odometry::Doubt::Unobserved { .. })
        );
        // Not begun: it begins with this one.
        let fresh = self.begun.and_then(|b| b.joined_at).is_none_or(|at| {
            let moved = at.inv_mul(odom_from_base);
            moved.translation.vector.norm() >= SCAN_EVERY_M
                || moved.rotation.angle() >= SCAN_EVERY_RAD
        });
        placed && fresh
    }

    /// Adds the scan's points.
    pub fn join(&mut self, scan: &ScanInput<'_>) {
        let Some(begun) = &mut self.begun else {
            return;
        };
        begun.joined_at = Some(scan.odom_from_base);
        let node_from_base = begun.odom_from_node.inv_mul(&scan.odom_from_base);
        let pose = node_from_base.cast::<f32>();
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let eye = (node_from_base * nalgebra::Point3::from(scan.base_from_sensor)).cast::<f32>();
        let stride = scan.points.len().div_ceil(SCAN_POINTS).max(1);
        let placed = scan.points.iter().step_by(stride).map(|p| {
            let position = rotation * nalgebra::Vector3::from(p.position()) + shift;
            (position.into(), p.intensity)
        });
        self.builder.add(eye.coords.into(), placed);
    }

    /// Whether the submap is full.
    ///
    /// One that looks for its place (`alone`) is full after a while even if the robot stands.
    pub fn is_full(&self, alone: bool, config: &SlamConfig) -> bool {
        let (Some(begun), Some(last)) = (&self.begun, &self.last) else {
            return false;
        };
        if begun.scans < LEAST_SCANS || self.builder.is_empty() {
            return false;
        }
        if alone && begun.scans >= STANDING_SCANS {
            return true;
        }
        let turned = begun.odom_from_first.rotation.angle_to(&last.rotation);
        let every_m = config.node_every_m(self.builder.voxel_m());
        self.path_m - begun.path_m >= every_m || turned >= config.node_every_rad
    }

    /// Takes the submap; the next begins at the present scan and hangs on it. `None` if it is empty.
    pub fn take(&mut self, scan: &ScanInput<'_>, up: &Vector3) -> Option<GrownSubmap> {
        let grown = self.finish()?;
        let way = self.way;
        self.begin(scan, up);
        let begun = self.begun?;
        let last_from_this = grown.odom_from_node.inv_mul(&begun.odom_from_node);
        self.hangs = Some(Link {
            pose: last_from_this,
            covariance: way.covariance(),
        });
        Some(grown)
    }

    /// Takes what there is, with nothing to follow.
    pub fn finish(&mut self) -> Option<GrownSubmap> {
        let begun = self.begun.take()?;
        let way = self.hangs.take();
        if self.builder.is_empty() {
            return None;
        }
        let mut submap = Submap::default();
        self.builder.finish(&mut submap);
        self.builder.clear();
        Some(GrownSubmap {
            stamp: begun.stamp,
            odom_from_node: begun.odom_from_node,
            path_m: begun.path_m,
            ground: self.seeker.find(&submap),
            submap,
            way,
        })
    }

    /// Forgets how things hang together: odometry no longer knows. What had grown is handed out.
    pub fn break_off(&mut self) -> Option<GrownSubmap> {
        let grown = self.finish();
        self.hangs = None;
        self.last = None;
        grown
    }
}
