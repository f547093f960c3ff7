//! SLAM as a stage of the flow: scans as odometry placed them in, nodes, loops and a map out.
//!
//! In: each scan's estimate and kept points. Out: where the robot is on the map, and at the end the
//! whole path, the map and the ledger. Elsewhere: the flow ([`mapping`](crate::mapping)), SLAM itself
//! (`hachi-slam`).

use hachi_hal::{Point, Pose, ScanHeader, Stamp, Vector3};
use hachi_odometry::{Estimate, Odometry};
use hachi_registration::Degeneracy;
use hachi_slam::ledger::FoundBy;
use hachi_slam::{
    LedgerEntry, LoopCounts, Map, NodeId, ScanInput, Slam, SlamEstimate, SlamEvents, Visit,
};
use hachi_trajectory::Trajectory;
use tracing::{info, warn};

use crate::exit::Failure;
use crate::map_builder::MapBuilder;
use crate::report::{MapConditionCounts, Report};

/// The stage.
#[derive(Debug)]
pub struct SlamStage {
    slam: Slam,
    base_from_lidar: Pose,
    /// The session's scans as odometry placed them.
    scans: Vec<(Stamp, Pose)>,
    /// Its submaps that became no node: known places on the path.
    visits: Vec<Visit>,
    /// Where the last scan was.
    place: Option<SlamEstimate>,
    conditions: MapConditionCounts,
    points: Vec<Point>,
    events: SlamEvents,
    store_fails: bool,
    /// Submaps that were given up so far, and whether that was said since the store last worked.
    given_up: u64,
    given_up_said: bool,
    keeps_path: bool,
}

impl SlamStage {
    /// SLAM, new or going on with a saved map, for a LiDAR that sits there.
    pub fn new(slam: Slam, base_from_lidar: Pose) -> Self {
        Self {
            slam,
            base_from_lidar,
            place: None,
            conditions: MapConditionCounts::default(),
            scans: Vec::new(),
            visits: Vec::new(),
            points: Vec::new(),
            events: SlamEvents::default(),
            store_fails: false,
            given_up: 0,
            given_up_said: false,
            keeps_path: true,
        }
    }

    /// Without the path of the session: a run without an end would fill the memory with it.
    #[must_use]
    pub fn without_path(mut self) -> Self {
        self.keeps_path = false;
        self
    }

    /// Whether the map could not be kept when that was last tried.
    pub fn store_fails(&self) -> bool {
        self.store_fails
    }

    /// One scan, placed by odometry.
    pub fn step(
        &mut self,
        header: &ScanHeader,
        kept: &[Point],
        odometry: &Odometry,
        estimate: &Estimate,
    ) -> SlamEstimate {
        let base_from_lidar = self.base_from_lidar;
        // The odometry frame is the base's first pose.
        let odom_from_base = base_from_lidar * estimate.odom_from_lidar * base_from_lidar.inverse();
        let mut points = std::mem::take(&mut self.points);
        points.clear();
        if self.slam.wants_points(&odom_from_base, &estimate.condition) {
            deskew_into(header, kept, odometry, &base_from_lidar, &mut points);
        }
        let placed = self.step_placed(estimate, odom_from_base, &points);
        self.points = points;
        placed
    }

    /// One scan, placed by odometry, its points in the base's frame as if taken at its end.
    pub fn step_placed(
        &mut self,
        estimate: &Estimate,
        odom_from_base: Pose,
        points: &[Point],
    ) -> SlamEstimate {
        let base_from_lidar = self.base_from_lidar;
        if self.keeps_path {
            self.scans.push((estimate.stamp, odom_from_base));
        }
        let scan = ScanInput {
            stamp: estimate.stamp,
            odom_from_base,
            condition: estimate.condition,
            open: in_base(&estimate.fit.degeneracy, &base_from_lidar),
            base_from_sensor: base_from_lidar.translation.vector.into(),
            points,
        };
        let placed = self.slam.step(&scan, &mut self.events);
        if self.keeps_path {
            self.visits.extend_from_slice(&self.events.visits);
        }
        self.conditions.count(&placed.condition);
        self.place = Some(placed);
        self.say();
        placed
    }

    /// Where the last scan was, as it was known then.
    pub fn place(&self) -> Option<SlamEstimate> {
        self.place
    }

    /// The end of the run: what is under way is finished and kept.
    pub fn finish(&mut self) {
        self.slam.finish(&mut self.events);
        if self.keeps_path {
            self.visits.extend_from_slice(&self.events.visits);
        }
        self.say();
    }

    /// Tells people what happened.
    fn say(&mut self) {
        for entry in &self.events.ledger {
            info!(
                node = entry.node.0,
                candidate = entry.candidate.0,
                found_by = entry.found_by.name(),
                verdict = entry.verdict.name(),
                "loop {}",
                entry.id
            );
        }
        for (piece, target) in &self.events.joined {
            info!(
                "piece {} of the map was found to lie on piece {}",
                piece.0, target.0
            );
        }
        if let Some(error) = self.events.store_errors.first() {
            if !self.store_fails {
                warn!(%error, "the map can't be kept for now; it goes on in memory");
            }
            self.store_fails = true;
        } else if !self.events.fixed.is_empty() || !self.events.visits.is_empty() {
            self.store_fails = false;
            self.given_up_said = false;
        }
        let given_up = self.slam.map().submaps_given_up();
        if given_up > self.given_up && !self.given_up_said {
            warn!(
                "the map could not be kept for so long that its oldest waiting submaps are given up: \
                 make room on the disk"
            );
            self.given_up_said = true;
        }
        self.given_up = given_up;
        for error in &self.events.graph_errors {
            warn!(%error, "the graph does not take a node or a loop");
        }
    }

    /// SLAM itself.
    pub fn slam(&self) -> &Slam {
        &self.slam
    }

    /// The poses of this session's scans on the map, as known now.
    pub fn trajectory(&self) -> Trajectory {
        let fixes = hachi_slam::track::fixes(self.slam.map(), self.slam.session(), &self.visits);
        let mut trajectory = Trajectory::new();
        for (stamp, odom_from_base) in &self.scans {
            let pose = hachi_slam::track::corrected(&fixes, *stamp, odom_from_base)
                .unwrap_or(*odom_from_base);
            // Stamps increase, as those of the scans did.
            let _ = trajectory.push(*stamp, pose);
        }
        trajectory
    }

    /// The poses of this session's scans by odometry alone.
    pub fn odometry(&self) -> Trajectory {
        let mut trajectory = Trajectory::new();
        for (stamp, pose) in &self.scans {
            let _ = trajectory.push(*stamp, *pose);
        }
        trajectory
    }

    /// All submaps where their nodes are now.
    ///
    /// # Errors
    /// A submap can't be read back.
    pub fn build_map(&mut self, map: &mut MapBuilder) -> Result<(), Failure> {
        add_submaps(self.slam.map_mut(), map)
    }

    /// How many candidates there were, and what became of them.
    pub fn loop_counts(&self) -> LoopCounts {
        LoopCounts::of(self.slam.map().ledger())
    }

    /// Puts the loops, and what of the map was lost, into a report.
    pub fn fill(&self, report: &mut Report) {
        report.loops = self.loop_counts().into();
        report.map_conditions = Some(self.conditions);
        report.submaps_given_up = self.slam.map().submaps_given_up();
    }

    /// Where loops lead from and to, on the map.
    pub fn loop_lines(&self) -> Vec<(Vector3, Vector3)> {
        let map = self.slam.map();
        let place = |id| map.node(id).map(|n| n.map_from_node.translation.vector);
        map.ledger()
            .iter()
            .filter(|e| e.verdict.is_accepted())
            .filter_map(|e| place(e.node).zip(place(e.candidate)))
            .collect()
    }

    /// The ledger as a table: the first four columns as every run writes them.
    pub fn ledger_csv(&self) -> String {
        let map = self.slam.map();
        ledger_table(map, |id| {
            let node = map.node(id).filter(|n| n.session == self.slam.session())?;
            self.scans.binary_search_by_key(&node.stamp, |s| s.0).ok()
        })
    }
}

/// Adds all submaps, where their nodes are now, to a cloud.
///
/// # Errors
/// A submap can't be read back.
pub fn add_submaps(map: &mut Map, cloud: &mut MapBuilder) -> Result<(), Failure> {
    let nodes = map.nodes().to_vec();
    for node in &nodes {
        let submap = map
            .submap(node.id)
            .map_err(|error| Failure::new(error, "restore the map from a copy, or map anew"))?;
        for p in &submap.points {
            let place = hachi_slam::grid::placed(&node.map_from_node, p.position);
            cloud.add(place, f32::from(p.intensity));
        }
    }
    Ok(())
}

/// The ledger of a map as a table; `scan_of` gives the number of a node's first scan in this run.
pub fn ledger_table(map: &Map, scan_of: impl Fn(NodeId) -> Option<usize>) -> String {
    let mut table = LEDGER_HEADING.to_owned();
    for entry in map.ledger() {
        table.push_str(&row(entry, scan_of(entry.node), scan_of(entry.candidate)));
    }
    table
}

/// Heading of the ledger's table.
pub const LEDGER_HEADING: &str = "from_scan,to_scan,accepted,reason,id,node,candidate,found_by,\
distance_m,similarity,yaw_rad,graph_fitness,looks_fitness,overlap,inlier_share,residual_m,seen_through,\
open,chi2,agreeing,x_m,y_m,z_m,qx,qy,qz,qw\n";

fn row(entry: &LedgerEntry, from: Option<usize>, to: Option<usize>) -> String {
    // A scan of another session has no number here; a figure that was not asked for none at all.
    let index = |i: Option<usize>| i.map_or_else(String::new, |i| i.to_string());
    let figure = |v: f32| {
        if v.is_finite() {
            format!("{v:.4}")
        } else {
            String::new()
        }
    };
    let found_by: FoundBy = entry.found_by;
    let (t, q) = (
        entry.candidate_from_node.translation.vector,
        entry.candidate_from_node.rotation.coords,
    );
    format!(
        "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.4},{:.4},{:.4},{:.6},{:.6},{:.6},{:.6}\n",
        index(from),
        index(to),
        entry.verdict.is_accepted(),
        entry.verdict.name(),
        entry.id,
        entry.node,
        entry.candidate,
        found_by.name(),
        figure(entry.distance_m),
        figure(entry.similarity),
        figure(entry.yaw_rad),
        figure(entry.graph_fitness),
        figure(entry.looks_fitness),
        figure(entry.overlap),
        figure(entry.inlier_share),
        figure(entry.residual_m),
        figure(entry.seen_through),
        entry.open,
        figure(entry.chi2),
        entry.agreeing,
        t.x,
        t.y,
        t.z,
        q.x,
        q.y,
        q.z,
        q.w,
    )
}

/// Adds the kept points in the base's frame, as if taken at the scan's end.
pub fn deskew_into(
    header: &ScanHeader,
    kept: &[Point],
    odometry: &Odometry,
    base_from_lidar: &Pose,
    points: &mut Vec<Point>,
) {
    let per_ns = 1.0 / (header.end - header.start).max(1) as f32;
    let pose = base_from_lidar.cast::<f32>();
    let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
    points.extend(kept.iter().map(|point| {
        let share = if header.has_point_times {
            point.time_offset_ns as f32 * per_ns
        } else {
            1.0
        };
        let deskewed = odometry.deskew(point.position(), share);
        let [x, y, z] = (rotation * nalgebra::Vector3::from(deskewed) + shift).into();
        Point { x, y, z, ..*point }
    }));
}

/// What a scan left open, in the base's frame.
fn in_base(open: &Degeneracy, base_from_lidar: &Pose) -> Degeneracy {
    let rotation = base_from_lidar.rotation;
    Degeneracy {
        directions: open.directions.map(|d| rotation * d),
        axes: open.axes.map(|a| rotation * a),
        ..*open
    }
}
