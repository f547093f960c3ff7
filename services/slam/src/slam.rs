//! Scan after scan: follow, grow a submap, and a little of the work that finished submaps bring.

use std::collections::VecDeque;

use hachi_cloud::{GroundFinder, Reason};
use hachi_hal::{Pose, Vector3};
use hachi_odometry::{Condition, Doubt};
use nalgebra::Matrix6;

use crate::anchor::Anchor;
use crate::condition::{SlamCondition, SlamDoubt};
use crate::config::SlamConfig;
use crate::confirmation::Confirmation;
use crate::graph::GraphError;
use crate::growing::{Growing, GrownSubmap};
use crate::input::{ScanInput, SlamEstimate, SlamEvents};
use crate::ledger::{LedgerEntry, LoopId};
use crate::map::{Map, ResumeError};
use crate::node::NodeId;
use crate::saved::SavedMap;
use crate::store::{MemoryStore, SubmapStore};
use crate::uncertainty::invert;
use crate::work::{Pace, Work, Workshop};

/// Submaps that may wait for their work; a further one is worked off at once.
const MOST_WAITING: usize = 2;

/// Steps of work made with each scan, and while a further submap waits.
const STEPS: usize = 1;
const STEPS_BEHIND: usize = 4;
/// And while the place is not known: many places are asked then, and nothing else is as urgent.
const STEPS_LOST: usize = 4;

/// Least confidence in the ground's plane for the first scan to say which way is up.
const UP_CONFIDENCE: f32 = 0.5;

/// LEO-SLAM; one call a scan.
#[derive(Debug)]
pub struct Slam {
    config: SlamConfig,
    map: Map,
    growing: Growing,
    waiting: VecDeque<GrownSubmap>,
    workshop: Workshop,
    /// Which way is up in the odometry's frame.
    up: Option<Vector3>,
    ground: GroundFinder,
    /// Where the odometry's frame was last known to lie.
    map_from_odom: Pose,
    covariance: Matrix6<f64>,
    broken: bool,
    /// The present scans hang on no node: the first submap since odometry broke has not become one.
    adrift: bool,
    confirmation: Confirmation,
}

impl Slam {
    /// An empty map.
    pub fn new(config: SlamConfig, store: Box<dyn SubmapStore>) -> Self {
        let memory = config.submap_memory_mb.saturating_mul(1 << 20);
        Self {
            map: Map::new(store, memory),
            growing: Growing::default(),
            waiting: VecDeque::new(),
            workshop: Workshop::default(),
            up: None,
            ground: GroundFinder::default(),
            map_from_odom: Pose::identity(),
            covariance: Matrix6::identity() * 1e-6,
            broken: false,
            adrift: false,
            confirmation: Confirmation::default(),
            config,
        }
    }

    /// Goes on with a saved map, in another frame of odometry: until places of it are recognised, the
    /// robot is `LOST`, and what it sees is a piece of its own.
    ///
    /// # Errors
    /// The parts of the map do not fit together.
    pub fn resume(
        config: SlamConfig,
        saved: SavedMap,
        store: Box<dyn SubmapStore>,
    ) -> Result<Self, ResumeError> {
        let memory = config.submap_memory_mb.saturating_mul(1 << 20);
        let map = Map::resume(saved, store, memory)?;
        let session = map.sessions();
        let mut slam = Self::new(config, Box::new(MemoryStore::default()));
        slam.map = map;
        slam.workshop.begin_session(session);
        Ok(slam)
    }

    /// Whether [`Slam::step`] will look at the points of a scan that odometry placed here.
    pub fn wants_points(&self, odom_from_base: &Pose, condition: &Condition) -> bool {
        self.up.is_none()
            || self.confirmation.is_due()
            || self.growing.joins(odom_from_base, condition)
    }

    /// One scan; `events` is emptied first.
    pub fn step(&mut self, scan: &ScanInput<'_>, events: &mut SlamEvents) -> SlamEstimate {
        events.clear();
        let up = self.which_way_is_up(scan);
        if self.odometry_broke(scan) {
            let rest = self.growing.break_off();
            self.adrift = true;
            self.hand_over(rest, events);
            return self.estimate(scan);
        }
        let alone = self.workshop.is_floating(&self.map) && self.workshop.anchor().is_none();
        let full = self.growing.is_full(alone, &self.config);
        if full {
            let grown = self.growing.take(scan, &up);
            self.hand_over(grown, events);
        }
        self.growing.follow(scan, &up, &self.config);
        if self.growing.joins(&scan.odom_from_base, &scan.condition) {
            self.growing.join(scan);
        }
        let steps = match self.waiting.len() {
            // Shaping a submap's surfaces was work enough.
            1 if full && self.workshop.is_free() => 0,
            0 if self.workshop.is_floating(&self.map) => STEPS_LOST,
            0 => STEPS,
            _ => STEPS_BEHIND,
        };
        self.work(steps, events);
        self.confirm(scan, events);
        self.estimate(scan)
    }

    /// A place that was just recognised is believed once what is seen now lies on the map there.
    fn confirm(&mut self, scan: &ScanInput<'_>, events: &SlamEvents) {
        // The next scan has points.
        let just_joined = !events.joined.is_empty();
        if !self.confirmation.is_due()
            || just_joined
            || self.adrift
            || self.workshop.is_floating(&self.map)
        {
            return;
        }
        self.confirmation.count(events.fixed.len());
        let map_from_base = self.map_from_odom * scan.odom_from_base;
        let session = self.workshop.session();
        self.confirmation.look(
            &mut self.map,
            &map_from_base,
            session,
            scan.points,
            &self.config,
        );
    }

    /// The end of a run: fixes what has grown, checks what is to be checked, keeps everything.
    pub fn finish(&mut self, events: &mut SlamEvents) {
        events.clear();
        let rest = self.growing.finish();
        self.hand_over(rest, events);
        while self.workshop.is_busy() || !self.waiting.is_empty() {
            self.work(1, events);
        }
        if let Err(error) = self.map.commit(true) {
            events.store_errors.push(error);
        }
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// The map, to read submaps from.
    pub fn map_mut(&mut self) -> &mut Map {
        &mut self.map
    }

    /// The number of this run of the robot.
    pub fn session(&self) -> u32 {
        self.workshop.session()
    }

    /// Takes a loop out by hand, and optimises again without it. The entry as it is then; `None` if
    /// there is no such loop in the map.
    ///
    /// # Errors
    /// The graph can't do without it: it alone joins two parts of the map.
    pub fn veto(&mut self, loop_id: LoopId) -> Result<Option<LedgerEntry>, GraphError> {
        let entry = self.map.veto(loop_id)?;
        self.take_over();
        Ok(entry)
    }

    /// Proposes that a node is near an old one, at `candidate_from_node`: it is checked like any other
    /// candidate with the work of the next scans. `false` if there are no such nodes.
    pub fn propose(&mut self, node: NodeId, candidate: NodeId, candidate_from_node: &Pose) -> bool {
        let there = |id| self.map.node(id).is_some();
        let known = there(node) && there(candidate) && node != candidate;
        if known {
            self.workshop.propose(node, candidate, candidate_from_node);
        }
        known
    }

    /// What the next step of work does, in a word, for those who measure.
    pub fn activity(&self) -> &'static str {
        self.workshop.activity()
    }

    /// The settings.
    pub fn config(&self) -> &SlamConfig {
        &self.config
    }

    /// Odometry no longer knows how here hangs together with before.
    fn odometry_broke(&mut self, scan: &ScanInput<'_>) -> bool {
        let broke = match scan.condition {
            Condition::Lost(_) | Condition::Degraded(Doubt::NewPlace { .. }) => true,
            // Not placed since: goes on when it is.
            Condition::Degraded(Doubt::PoorFit { .. } | Doubt::FewPoints { .. }) => self.broken,
            _ => false,
        };
        self.broken = broke;
        broke
    }

    /// Up in the odometry's frame: the normal of the ground at the first scan, or its z axis.
    fn which_way_is_up(&mut self, scan: &ScanInput<'_>) -> Vector3 {
        if let Some(up) = self.up {
            return up;
        }
        let labels = vec![Reason::Kept; scan.points.len()];
        let up = match self.ground.find(scan.points, &labels, None) {
            Ok(plane) if plane.confidence >= UP_CONFIDENCE => {
                let normal = Vector3::from(plane.height.up.map(f64::from));
                (scan.odom_from_base.rotation * normal).normalize()
            }
            _ => Vector3::z(),
        };
        *self.up.insert(up)
    }

    fn hand_over(&mut self, grown: Option<GrownSubmap>, events: &mut SlamEvents) {
        let Some(grown) = grown else {
            return;
        };
        while self.waiting.len() >= MOST_WAITING {
            self.work(1, events);
        }
        self.waiting.push_back(grown);
    }

    /// Some steps of the work that waits.
    fn work(&mut self, steps: usize, events: &mut SlamEvents) {
        for _ in 0..steps {
            if self.workshop.is_free()
                && let Some(grown) = self.waiting.pop_front()
            {
                self.adrift &= grown.way.is_some();
                self.workshop
                    .begin(grown, &mut self.map, &self.map_from_odom, &self.config);
            }
            if !self.workshop.is_busy() {
                return;
            }
            let pace = Pace {
                hurry: !self.waiting.is_empty(),
                reuse: self.config.reuse_nodes && !self.confirmation.is_due(),
            };
            match self
                .workshop
                .step(&mut self.map, pace, &self.config, events)
            {
                Work::Going => {}
                Work::Moved => self.take_over(),
            }
            if !events.joined.is_empty() {
                self.confirmation.demand();
            }
        }
    }

    /// The anchor is new, or has moved.
    fn take_over(&mut self) {
        let Some(anchor) = self.anchor().copied() else {
            return;
        };
        let Some(map_from_node) = self.map.node(anchor.node).map(|n| n.map_from_node) else {
            return;
        };
        self.map_from_odom = map_from_node * anchor.odom_from_node.inverse();
        if let Some(covariance) = self.map.covariance(anchor.node) {
            self.covariance = covariance + anchor.to_submap.covariance;
        }
    }

    fn anchor(&self) -> Option<&Anchor> {
        self.workshop.anchor().filter(|_| !self.adrift)
    }

    fn estimate(&self, scan: &ScanInput<'_>) -> SlamEstimate {
        let anchor = self.anchor();
        let since = anchor.map(|anchor| {
            let node_from_base = anchor.odom_from_node.inv_mul(&scan.odom_from_base);
            (anchor.node, node_from_base)
        });
        SlamEstimate {
            stamp: scan.stamp,
            map_from_odom: self.map_from_odom,
            map_from_base: self.map_from_odom * scan.odom_from_base,
            covariance: self.covariance + invert(&self.growing.way().information()),
            condition: self.condition(&scan.condition),
            piece: anchor.and_then(|a| self.map.node(a.node)).map(|n| n.piece),
            anchor: since,
        }
    }

    fn condition(&self, odometry: &Condition) -> SlamCondition {
        if matches!(odometry, Condition::Lost(_)) {
            return (*odometry).into();
        }
        let floating = self.workshop.is_floating(&self.map);
        if self.broken || self.adrift || floating {
            let recognition = self.workshop.recognition();
            let leading = if floating { recognition.leading() } else { 0 };
            return match leading {
                0 => SlamCondition::Lost(SlamDoubt::NotRecognised {
                    nodes: recognition.nodes(),
                }),
                agreeing => SlamCondition::Recovering(SlamDoubt::Unconfirmed { agreeing }),
            };
        }
        if self.confirmation.is_due() {
            return SlamCondition::Recovering(SlamDoubt::NotSeen);
        }
        (*odometry).into()
    }
}
