//! What a finished submap brings, cut into steps: it is aligned and becomes a node, or is covered by
//! one; a node's place is looked for among the known ones, candidates are proven, loops close.
//!
//! Steps are of about equal size and their number is fixed for each scan, so that no scan's pose is
//! late because of a loop, and the same scans give the same map.

mod visits;

use std::collections::VecDeque;
use std::sync::Arc;

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::anchor::{Anchor, Link};
use crate::candidates::{Candidate, candidates, recognised};
use crate::chain::ChainAlignment;
use crate::closing::Closing;
use crate::config::SlamConfig;
use crate::covering::Covering;
use crate::edge::EdgeKind;
use crate::growing::GrownSubmap;
use crate::input::SlamEvents;
use crate::ledger::{FoundBy, LedgerEntry, LoopId, Refusal, Verdict};
use crate::map::Map;
use crate::node::{Ground, Node, NodeId, PieceId};
use crate::recognition::Recognition;

/// The ground below the base, metres, where no submap has shown it yet.
const USUAL_GROUND_M: f32 = 0.5;

/// Proposals that wait to be checked.
const MOST_PROPOSED: usize = 64;

/// So many loops of a node to nodes this close to each other are enough, metres.
const LOOPS_ENOUGH: usize = 2;
const ONE_PLACE_M: f64 = 4.0;

/// What a step did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// Nothing that moves a pose.
    Going,
    /// A node is new, or nodes moved.
    Moved,
}

/// How a step is made.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Candidates are left unproven: a node more matters more than a loop more.
    pub hurry: bool,
    /// Submaps that nodes cover become none.
    pub reuse: bool,
}

#[derive(Debug, Default)]
enum Stage {
    #[default]
    Idle,
    /// The submap is being laid on those before it.
    Aligning(Box<GrownSubmap>),
    /// It hangs there; it is looked for nodes that cover it.
    Chained(Box<GrownSubmap>, Link),
    /// It is laid on them.
    Covering(Box<GrownSubmap>, Link),
    /// It becomes a node.
    Fixing(Box<GrownSubmap>, Option<Link>),
    /// Its place is looked for.
    Looking(NodeId),
    /// Candidates are proven one by one.
    Proving {
        node: NodeId,
        rest: VecDeque<Candidate>,
    },
    /// One of them.
    Aligned {
        node: NodeId,
        rest: VecDeque<Candidate>,
        candidate: Candidate,
        entry: LedgerEntry,
    },
}

/// Works submaps off, one after the other.
#[derive(Debug, Default)]
pub struct Workshop {
    stage: Stage,
    chain: ChainAlignment,
    covering: Covering,
    closing: Closing,
    recognition: Recognition,
    found: Vec<Candidate>,
    proposed: VecDeque<(NodeId, Candidate)>,
    /// What odometry hangs on.
    anchor: Option<Anchor>,
    /// The nodes of the present piece that it hung on since that began, the last first; a few.
    recent: VecDeque<NodeId>,
    piece: Option<PieceId>,
    session: u32,
    ground: Option<Ground>,
    map_from_odom: Pose,
}

impl Workshop {
    /// Whether there is something to do.
    pub fn is_busy(&self) -> bool {
        !matches!(self.stage, Stage::Idle) || !self.proposed.is_empty()
    }

    /// What the next step does, in a word, for those who measure.
    pub fn activity(&self) -> &'static str {
        match &self.stage {
            Stage::Idle => "idle",
            Stage::Aligning(_) => "aligning",
            Stage::Chained(..) | Stage::Covering(..) => "covering",
            Stage::Fixing(..) => "fixing",
            Stage::Looking(_) => "looking",
            Stage::Proving { .. } => "laying out",
            Stage::Aligned { .. } => "proving",
        }
    }

    /// Whether the next submap can be begun with.
    pub fn is_free(&self) -> bool {
        matches!(self.stage, Stage::Idle)
    }

    /// Another run of the robot: what it sees hangs on nothing at first.
    pub fn begin_session(&mut self, session: u32) {
        self.session = session;
        self.forget();
    }

    /// Odometry hangs on nothing any more.
    fn forget(&mut self) {
        self.anchor = None;
        self.recent.clear();
        self.piece = None;
        self.recognition.clear();
    }

    /// The number of this run of the robot.
    pub fn session(&self) -> u32 {
        self.session
    }

    /// A candidate from elsewhere, to be checked when there is time. The oldest goes if there are too
    /// many.
    pub fn propose(&mut self, node: NodeId, candidate: NodeId, candidate_from_node: &Pose) {
        if self.proposed.len() >= MOST_PROPOSED {
            self.proposed.pop_front();
        }
        let candidate = Candidate {
            node: candidate,
            found_by: FoundBy::Proposal,
            looks: None,
            proposed: Some(*candidate_from_node),
            place: None,
        };
        self.proposed.push_back((node, candidate));
    }

    /// What odometry hangs on.
    pub fn anchor(&self) -> Option<&Anchor> {
        self.anchor.as_ref()
    }

    /// Whether the present piece hangs on nothing though there is another map.
    pub fn is_floating(&self, map: &Map) -> bool {
        match self.piece {
            Some(piece) => piece != PieceId(0),
            None => !map.pieces().is_empty(),
        }
    }

    /// The search for the present piece's place.
    pub fn recognition(&self) -> &Recognition {
        &self.recognition
    }

    /// Begins with a submap; `map_from_odom` is the best guess for one that hangs on nothing.
    pub fn begin(
        &mut self,
        grown: GrownSubmap,
        map: &mut Map,
        map_from_odom: &Pose,
        config: &SlamConfig,
    ) {
        self.map_from_odom = *map_from_odom;
        if grown.way.is_none() {
            self.forget();
        }
        let previous: Vec<NodeId> = self
            .recent
            .iter()
            .take(config.chain_submaps)
            .copied()
            .collect();
        let way = self.anchor.zip(grown.way);
        let way = way.map(|(anchor, way)| anchor.to_submap.then(&way));
        self.stage = match way {
            Some(way) if self.chain.begin(map, &grown, &way, &previous) => {
                Stage::Aligning(Box::new(grown))
            }
            way => Stage::Fixing(Box::new(grown), way),
        };
    }

    /// One step.
    pub fn step(
        &mut self,
        map: &mut Map,
        pace: Pace,
        config: &SlamConfig,
        events: &mut SlamEvents,
    ) -> Work {
        match std::mem::take(&mut self.stage) {
            Stage::Idle => {
                if let Some((node, candidate)) = self.proposed.pop_front() {
                    let rest = VecDeque::from([candidate]);
                    self.stage = Stage::Proving { node, rest };
                }
                Work::Going
            }
            Stage::Aligning(grown) => {
                self.stage = match self.chain.step() {
                    Some(edge) if pace.reuse => Stage::Chained(grown, edge),
                    Some(edge) => Stage::Fixing(grown, Some(edge)),
                    None => Stage::Aligning(grown),
                };
                Work::Going
            }
            Stage::Chained(grown, edge) => {
                if self.may_be_covered(&grown, &edge, map, config) {
                    self.stage = Stage::Covering(grown, edge);
                    return Work::Going;
                }
                self.fix(*grown, Some(edge), map, config, events)
            }
            Stage::Covering(grown, edge) => {
                match self.covering.step(map) {
                    Some(Some(covered)) => {
                        return self.visit(&grown, &edge, &covered, map, config, events);
                    }
                    Some(None) => self.stage = Stage::Fixing(grown, Some(edge)),
                    None => self.stage = Stage::Covering(grown, edge),
                }
                Work::Going
            }
            Stage::Fixing(grown, edge) => self.fix(*grown, edge, map, config, events),
            Stage::Looking(node) => {
                self.look(node, map, config);
                Work::Going
            }
            Stage::Proving { node, rest } => {
                self.prove_next(node, rest, map, pace.hurry, config, events)
            }
            Stage::Aligned {
                node,
                rest,
                candidate,
                entry,
            } => self.prove(node, rest, candidate, entry, map, config, events),
        }
    }

    /// The submap becomes a node.
    fn fix(
        &mut self,
        grown: GrownSubmap,
        edge: Option<Link>,
        map: &mut Map,
        config: &SlamConfig,
        events: &mut SlamEvents,
    ) -> Work {
        let piece = *self.piece.get_or_insert_with(|| map.begin_piece());
        let hangs = self.anchor.zip(edge);
        let map_from_node = hangs
            .and_then(|(anchor, edge)| Some(map.node(anchor.node)?.map_from_node * edge.pose))
            .unwrap_or_else(|| self.map_from_odom * grown.odom_from_node);
        let ground = grown.ground.or(self.ground);
        self.ground = ground;
        let ground = ground.unwrap_or(Ground::level(USUAL_GROUND_M));
        let id = NodeId(map.nodes().len() as u32);
        let node = Node {
            id,
            session: self.session,
            piece,
            chained: hangs.is_some(),
            stamp: grown.stamp,
            odom_from_node: grown.odom_from_node,
            map_from_node,
            path_m: grown.path_m,
            ground,
        };
        map.places.describe(&grown.submap, &ground);
        let way = grown.way;
        let edge = hangs.map(|(anchor, edge)| {
            let chain = match way {
                // The node before is one that it did not become: by odometry alone.
                Some(way) if !anchor.is_made() => anchor.made_to_submap.then(&way),
                _ => edge,
            };
            (anchor.made, chain.pose, chain.information())
        });
        if let Err(error) = map.add_node(node, Arc::new(grown.submap), edge) {
            events.graph_errors.push(error);
            return Work::Going;
        }
        if let Some((anchor, edge)) = hangs.filter(|(anchor, _)| !anchor.is_made()) {
            self.tie(id, anchor.node, node.stamp, &edge, None, map, events);
        }
        self.keep(map, events);
        events.fixed.push(id);
        self.hang_on(Anchor::made(id, &grown.odom_from_node), config);
        if config.close_loops {
            self.stage = Stage::Looking(id);
        }
        Work::Moved
    }

    /// Looks for known places that may be this one.
    fn look(&mut self, node: NodeId, map: &mut Map, config: &SlamConfig) {
        let mut rest = VecDeque::new();
        candidates(map, node, config, &mut self.found);
        rest.extend(self.found.drain(..));
        if self.is_floating(map)
            && let Some(node) = map.node(node)
        {
            recognised(map, node, &mut self.recognition, &mut self.found);
            rest.extend(self.found.drain(..));
        }
        self.stage = Stage::Proving { node, rest };
    }

    /// Lays out the next candidate.
    fn prove_next(
        &mut self,
        node: NodeId,
        mut rest: VecDeque<Candidate>,
        map: &mut Map,
        hurry: bool,
        config: &SlamConfig,
        events: &mut SlamEvents,
    ) -> Work {
        let (Some(candidate), Some(stamp)) = (rest.pop_front(), map.node(node).map(|n| n.stamp))
        else {
            let work = self.conclude(node, map, events);
            self.keep(map, events);
            return work;
        };
        let mut entry = map.open_entry(stamp, node, candidate.node, candidate.found_by);
        // Places that were thought of before and challengers are asked even so: without that nothing is
        // ever decided.
        let must = candidate.proposed.is_some() || self.recognition.asks_everywhere();
        if !must && is_redundant(map, node, candidate.node) {
            refuse(map, entry, Refusal::Redundant, events);
            self.stage = Stage::Proving { node, rest };
        } else if hurry && !must {
            refuse(map, entry, Refusal::NoTime, events);
            self.stage = Stage::Proving { node, rest };
        } else if self.closing.begin(map, &mut entry, &candidate, config) {
            self.stage = Stage::Aligned {
                node,
                rest,
                candidate,
                entry,
            };
        } else {
            refuse(map, entry, Refusal::Unreadable, events);
            self.stage = Stage::Proving { node, rest };
        }
        Work::Going
    }

    /// Aligns a candidate a little further, and decides when that is done.
    #[allow(clippy::too_many_arguments, reason = "the parts of one stage")]
    fn prove(
        &mut self,
        node: NodeId,
        rest: VecDeque<Candidate>,
        candidate: Candidate,
        mut entry: LedgerEntry,
        map: &mut Map,
        config: &SlamConfig,
        events: &mut SlamEvents,
    ) -> Work {
        let Some(aligned) = self.closing.step() else {
            self.stage = Stage::Aligned {
                node,
                rest,
                candidate,
                entry,
            };
            return Work::Going;
        };
        self.stage = if self.closing.is_over() {
            Stage::Proving { node, rest }
        } else {
            // The same two nodes lie on each other in another way too.
            let entry = map.open_entry(entry.stamp, node, candidate.node, candidate.found_by);
            Stage::Aligned {
                node,
                rest,
                candidate,
                entry,
            }
        };
        let piece = |id: NodeId| map.node(id).map(|n| n.piece);
        let same_piece = piece(entry.node) == piece(entry.candidate);
        let judged = self
            .closing
            .judge(&mut entry, &candidate, &aligned, same_piece, config);
        let recognising = !same_piece;
        let mut proven = match judged {
            Ok(proven) => proven,
            Err(refusal) => {
                if recognising {
                    self.recognition.vote(map, &candidate, &entry, None);
                }
                refuse(map, entry, refusal, events);
                return Work::Going;
            }
        };
        if recognising {
            let known = Some(proven.information);
            self.recognition.vote(map, &candidate, &entry, known);
            map.close_entry(entry);
            events.ledger.push(entry);
            return Work::Going;
        }
        let loops = self.closing.agree(map, &mut proven);
        map.close_entry(proven.entry);
        events.ledger.push(proven.entry);
        self.close(&loops, map, events)
    }

    /// All candidates of a node were asked: perhaps it is clear now where the piece lies.
    fn conclude(&mut self, node: NodeId, map: &mut Map, events: &mut SlamEvents) -> Work {
        if !self.is_floating(map) {
            return Work::Going;
        }
        let found = self.recognition.conclude(node);
        let (Some(found), Some(piece)) = (found, self.piece) else {
            return Work::Going;
        };
        match map.join(piece, found.target, &found.target_from_piece, &found.loops) {
            Ok(decided) => {
                events.ledger.extend(decided);
                for id in found.lookalikes {
                    if let Some(entry) = map.ledger().get(id.0 as usize).copied() {
                        refuse(map, entry, Refusal::AgainstLoops, events);
                    }
                }
                events.joined.push((piece, found.target));
                events.moved = true;
                self.piece = Some(found.target);
                self.recognition.clear();
                Work::Moved
            }
            Err(error) => {
                events.graph_errors.push(error);
                Work::Going
            }
        }
    }

    /// Puts loops into the graph.
    fn close(
        &mut self,
        loops: &[(LoopId, Matrix6<f64>)],
        map: &mut Map,
        events: &mut SlamEvents,
    ) -> Work {
        if loops.is_empty() {
            return Work::Going;
        }
        match map.add_loops(loops) {
            Ok(decided) => {
                events.ledger.extend(decided);
                events.moved = true;
                Work::Moved
            }
            Err(error) => {
                events.graph_errors.push(error);
                Work::Going
            }
        }
    }

    fn keep(&mut self, map: &mut Map, events: &mut SlamEvents) {
        if let Err(error) = map.commit(false) {
            events.store_errors.push(error);
        }
    }
}

/// Whether a node has loops enough to a place: another would say nothing new.
fn is_redundant(map: &Map, node: NodeId, candidate: NodeId) -> bool {
    let Some(place) = map.node(candidate).map(|n| n.map_from_node) else {
        return false;
    };
    let near = |id: NodeId| {
        map.node(id).is_some_and(|other| {
            let apart = other.map_from_node.translation.vector - place.translation.vector;
            apart.norm() <= ONE_PLACE_M
        })
    };
    let loops = map.edges().iter().filter(|e| {
        matches!(e.kind, EdgeKind::Loop(_))
            && ((e.first == node && near(e.second)) || (e.second == node && near(e.first)))
    });
    loops.count() >= LOOPS_ENOUGH
}

fn refuse(map: &mut Map, mut entry: LedgerEntry, refusal: Refusal, events: &mut SlamEvents) {
    entry.verdict = Verdict::Refused(refusal);
    map.close_entry(entry);
    events.ledger.push(entry);
}
