//! Submaps that existing nodes cover: odometry hangs on the node, and the graph is told what it does
//! not know.

use hachi_hal::Stamp;

use super::{Work, Workshop};
use crate::anchor::{Anchor, Link};
use crate::config::SlamConfig;
use crate::covering::{Arrival, Covered};
use crate::edge::EdgeKind;
use crate::growing::GrownSubmap;
use crate::input::{SlamEvents, Visit};
use crate::ledger::{FoundBy, LedgerEntry};
use crate::map::Map;
use crate::node::NodeId;
use crate::uncertainty::gain;

/// What a factor between nodes that exist has to tell, nats: about as much as if all six numbers were
/// known as well already as it knows them.
const GAIN: f64 = 2.0;

impl Workshop {
    /// Begins to lay a submap on old nodes. `false` if it has to become a node.
    pub(super) fn may_be_covered(
        &mut self,
        grown: &GrownSubmap,
        chained: &Link,
        map: &mut Map,
        config: &SlamConfig,
    ) -> bool {
        let Some(anchor) = self.anchor.filter(|_| config.close_loops) else {
            return false;
        };
        if self.is_floating(map) {
            return false;
        }
        let arrival = Arrival {
            grown,
            anchor: &anchor,
            chained,
            recent: self.recent.make_contiguous(),
            session: self.session,
        };
        self.covering.begin(map, &arrival, config)
    }

    /// A node covers the submap.
    pub(super) fn visit(
        &mut self,
        grown: &GrownSubmap,
        chained: &Link,
        covered: &Covered,
        map: &mut Map,
        config: &SlamConfig,
        events: &mut SlamEvents,
    ) -> Work {
        let (Some(anchor), Some(way)) = (self.anchor, grown.way) else {
            return Work::Going;
        };
        self.tell(&anchor, grown.stamp, chained, covered, map, events);
        events.visits.push(Visit {
            stamp: grown.stamp,
            odom_from_submap: grown.odom_from_node,
            node: covered.node,
            node_from_submap: covered.to_submap.pose,
        });
        let next = anchor.covered(
            covered.node,
            &covered.to_submap,
            &grown.odom_from_node,
            &way,
        );
        self.hang_on(next, config);
        self.keep(map, events);
        Work::Moved
    }

    /// Odometry hangs on another node, or on the same in another place.
    pub(super) fn hang_on(&mut self, anchor: Anchor, config: &SlamConfig) {
        self.recent.retain(|id| *id != anchor.node);
        self.recent.push_front(anchor.node);
        self.recent.truncate(config.chain_submaps.max(1));
        self.anchor = Some(anchor);
    }

    /// Tells the graph how the node that odometry hung on lies to the one that covers the submap, if it
    /// does not know that as well already.
    fn tell(
        &mut self,
        anchor: &Anchor,
        stamp: Stamp,
        chained: &Link,
        covered: &Covered,
        map: &mut Map,
        events: &mut SlamEvents,
    ) {
        let (from, to) = (covered.node, anchor.node);
        if from == to {
            return;
        }
        let mut is_tied = false;
        let mut known = None;
        for edge in map.ties(from, to) {
            is_tied = true;
            if let EdgeKind::Loop(id) = edge.kind {
                known = Some(id);
            }
        }
        if let Some(id) = known {
            map.agrees(id);
        }
        if is_tied {
            return;
        }
        let measured = covered.aligned.then(&chained.inverse());
        let Some(since) = map.relative_covariance(from, to) else {
            return;
        };
        if gain(&since, &measured.covariance) >= GAIN {
            self.tie(to, from, stamp, &measured, Some(covered), map, events);
        }
    }

    /// A loop that a covered submap makes: `node` as seen from `candidate`.
    #[allow(clippy::too_many_arguments, reason = "the parts of one loop")]
    pub(super) fn tie(
        &mut self,
        node: NodeId,
        candidate: NodeId,
        stamp: Stamp,
        candidate_to_node: &Link,
        covered: Option<&Covered>,
        map: &mut Map,
        events: &mut SlamEvents,
    ) {
        let entry = map.open_entry(stamp, node, candidate, FoundBy::Coverage);
        let apart = candidate_to_node.pose.translation.vector.norm();
        let mut entry = LedgerEntry {
            distance_m: apart as f32,
            candidate_from_node: candidate_to_node.pose,
            ..entry
        };
        if let Some(covered) = covered {
            entry.overlap = covered.fitness.overlap as f32;
            entry.inlier_share = covered.fitness.inlier_share() as f32;
            entry.residual_m = covered.fitness.residual_m as f32;
            entry.chi2 = covered.chi2 as f32;
        }
        map.close_entry(entry);
        self.close(&[(entry.id, candidate_to_node.information())], map, events);
    }
}
