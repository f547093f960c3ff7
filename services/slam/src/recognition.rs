//! Finding the way back: which place of the map a piece that hangs on nothing lies at.
//!
//! In: what alignment found at each place that may be the present one, node after node. Out: where
//! the whole piece lies, once one place explains what is seen clearly better than every other that
//! was ever thought of. Two corridors can look alike, a corridor looks alike both ways: then both are
//! followed, each is asked again at every further node, and nothing is said until one has lost. The
//! winner is challenged by everywhere else that looks at all alike before it is said.
//! Elsewhere: which places are asked ([`candidates`](crate::candidates)), alignment and lines of sight
//! ([`closing`](crate::closing)).

use hachi_hal::Pose;
use nalgebra::{Matrix6, Vector6};

use crate::candidates::Candidate;
use crate::ledger::{LedgerEntry, LoopId};
use crate::map::Map;
use crate::node::{NodeId, PieceId};
use crate::tangent::difference;

/// Places that are followed; the least likely goes.
const MOST_PLACES: usize = 32;

/// Nodes that are remembered for each; the oldest go.
const MOST_NODES: usize = 24;

/// Two alignments that put the robot this far apart, at most, mean one place.
const SAME_M: f64 = 0.6;
const SAME_RAD: f64 = 0.06;

/// And one that is asked again, from where it was at the last node.
const SLID_M: f64 = 2.5;
const SLID_RAD: f64 = 0.3;

/// Share of the lines of sight that lead through walls at which a place is less likely by a factor of
/// e. Measured in a simulated building: 0.02 to 0.05 at the true place, up to 0.1 where the robot has
/// only turned on the spot; 0.1 to 0.6 elsewhere, lookalikes included.
const SEEN_THROUGH: f64 = 0.08;

/// Likeness of a place that is out of the question, and of one that leads the robot off the map: the
/// map says nothing there, but robots are seldom where no map is.
const LEAST_LIKENESS: f64 = 0.02;
const OFF_THE_MAP: f64 = 0.15;

/// Nodes that have to be proven at a place, how likely it has to be at the last of them, and how much
/// likelier than any other at the nodes that were asked of both (natural logarithm of the ratio,
/// added up): a factor of 2.
const AGREEING: usize = 2;
const LIKELY: f64 = 0.4;
const LEAD: f64 = 0.7;

/// One node is enough if so much of what it sees lies there, and so much less anywhere else: a factor
/// of 4.
const ALONE_LIKELY: f64 = 0.5;
const ALONE_LEAD: f64 = 1.4;

/// Where so many nodes are proven at a place, and none elsewhere as well, what stands in the way of some
/// lines of sight counts for less: doors, furniture, people.
const ENDURING: usize = 5;
const ENDURING_LIKELY: f64 = 0.2;

/// Of so many nodes that are not recognised one is asked everywhere.
const EVERYWHERE: usize = 6;

/// A place that lags behind the best by a factor of twelve is followed no further.
const LOST_LEAD: f64 = 2.5;

/// A place's number: counts from 0 while one piece is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlaceId(u32);

/// A place where the piece may lie.
#[derive(Debug, Clone)]
struct Place {
    id: PlaceId,
    target: PieceId,
    target_from_piece: Pose,
    seen: Vec<Seen>,
}

/// What one node says of a place.
#[derive(Debug, Clone, Copy)]
struct Seen {
    node: NodeId,
    /// Share of what the node sees that lies on the map there, less what it sees through.
    likeness: f64,
    /// The loop it would be, if the alignment proved it.
    proven: Option<(LoopId, Matrix6<f64>)>,
}

/// Where a piece lies.
#[derive(Debug, Clone)]
pub struct Found {
    /// The piece it lies on.
    pub target: PieceId,
    /// Takes its frame to the target's.
    pub target_from_piece: Pose,
    /// The loops that say so.
    pub loops: Vec<(LoopId, Matrix6<f64>)>,
    /// Loops that say otherwise, and fitted by themselves.
    pub lookalikes: Vec<LoopId>,
}

/// The places where the present piece may lie.
#[derive(Debug, Default)]
pub struct Recognition {
    places: Vec<Place>,
    next: u32,
    nodes: usize,
    leading: usize,
    /// The place that would be said, had it been asked against all others that look alike.
    challenged: Option<PlaceId>,
}

impl Recognition {
    /// Starts anew, for another piece.
    pub fn clear(&mut self) {
        self.places.clear();
        self.nodes = 0;
        self.leading = 0;
        self.challenged = None;
    }

    /// Whether the next node is asked of many more places than the few that look most alike, among
    /// which the right one may not have been: before a place is said, and now and then.
    pub fn asks_everywhere(&self) -> bool {
        self.challenged.is_some() || self.nodes % EVERYWHERE == EVERYWHERE - 1
    }

    /// Nodes that were looked for.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Nodes that agree on the best place so far.
    pub fn leading(&self) -> usize {
        self.leading
    }

    /// Where the piece may lie, as far as is known: on which, and `target_from_piece`.
    pub fn places(&self) -> impl Iterator<Item = (PlaceId, PieceId, Pose)> + '_ {
        let place = |p: &Place| (p.id, p.target, p.target_from_piece);
        self.places.iter().map(place)
    }

    /// A place that would have a node where the map has none near.
    pub fn leads_off_the_map(&mut self, node: NodeId, place: PlaceId) {
        if let Some(place) = self.places.iter_mut().find(|p| p.id == place) {
            place.add(Seen {
                node,
                likeness: OFF_THE_MAP,
                proven: None,
            });
        }
    }

    /// Takes what was found for a candidate; `information` if it is proven.
    pub fn vote(
        &mut self,
        map: &Map,
        candidate: &Candidate,
        entry: &LedgerEntry,
        information: Option<Matrix6<f64>>,
    ) {
        let (Some(node), Some(old)) = (map.node(entry.node), map.node(entry.candidate)) else {
            return;
        };
        let fit = f64::from(entry.overlap * entry.inlier_share);
        // Not aligned at all: it says nothing.
        if !fit.is_finite() {
            return;
        }
        let seen = Seen {
            node: node.id,
            likeness: likeness(fit, f64::from(entry.seen_through)),
            proven: information.map(|i| (entry.id, i)),
        };
        let target_from_node = old.map_from_node * entry.candidate_from_node;
        let target_from_piece = target_from_node * node.map_from_node.inverse();
        let off = |place: &Place| {
            let there = place.target_from_piece * node.map_from_node;
            difference(&there, &target_from_node)
        };
        let known = self
            .places
            .iter()
            .position(|p| p.target == old.piece && is_within(&off(p), SAME_M, SAME_RAD));
        // One that was asked and slid a little, along a corridor for example, is itself still.
        let known = known.or_else(|| {
            let asked = self
                .places
                .iter()
                .position(|p| Some(p.id) == candidate.place);
            asked.filter(|&i| is_within(&off(&self.places[i]), SLID_M, SLID_RAD))
        });
        if let Some(place) = known {
            let place = &mut self.places[place];
            if place.add(seen) && information.is_some() {
                place.target_from_piece = target_from_piece;
            }
            return;
        }
        if self.places.len() >= MOST_PLACES {
            self.drop_least();
        }
        self.places.push(Place {
            id: PlaceId(self.next),
            target: old.piece,
            target_from_piece,
            seen: vec![seen],
        });
        self.next += 1;
    }

    /// How much likelier a place is than the next best.
    fn lead(&self, place: usize) -> f64 {
        let rivals = (0..self.places.len()).filter(|&i| i != place);
        rivals
            .map(|rival| self.places[place].lead(&self.places[rival]))
            .fold(f64::INFINITY, f64::min)
    }

    fn drop_least(&mut self) {
        let last = |p: &Place| p.seen.last().map_or(0.0, |s| s.likeness);
        let least = (0..self.places.len())
            .min_by(|&a, &b| last(&self.places[a]).total_cmp(&last(&self.places[b])));
        if let Some(least) = least {
            self.places.remove(least);
        }
    }

    /// All candidates of a node were asked: where the piece lies, if that is decided now.
    pub fn conclude(&mut self, node: NodeId) -> Option<Found> {
        self.nodes += 1;
        // One that was asked and turned out to be another is none.
        self.places.retain(|place| place.at(node).is_some());
        let best = (0..self.places.len())
            .filter(|&i| self.places[i].proven() > 0)
            .max_by(|&a, &b| self.lead(a).total_cmp(&self.lead(b)));
        let Some(best) = best else {
            self.leading = 0;
            self.challenged = None;
            return None;
        };
        let lead = self.lead(best);
        let best = self.places.remove(best);
        self.leading = best.proven();
        self.places.retain(|rival| best.lead(rival) < LOST_LEAD);
        let likeness = best.at(node).unwrap_or(0.0);
        let together = best.proven() >= AGREEING && likeness >= LIKELY && lead >= LEAD;
        let alone = likeness >= ALONE_LIKELY && lead >= ALONE_LEAD;
        let enduring = best.proven() >= ENDURING && likeness >= ENDURING_LIKELY && lead >= LEAD;
        let decided = (together || alone || enduring).then_some(best.id);
        if decided.is_none() || self.challenged != decided {
            self.challenged = decided;
            self.places.insert(0, best);
            return None;
        }
        let proven = |place: &Place| -> Vec<(LoopId, Matrix6<f64>)> {
            place.seen.iter().filter_map(|s| s.proven).collect()
        };
        Some(Found {
            target: best.target,
            target_from_piece: best.target_from_piece,
            loops: proven(&best),
            lookalikes: self
                .places
                .iter()
                .flat_map(|place| proven(place).into_iter().map(|(id, _)| id))
                .collect(),
        })
    }
}

impl Place {
    /// Adds a node's word; of two of one node the better counts. Whether this one does.
    fn add(&mut self, seen: Seen) -> bool {
        if let Some(known) = self.seen.iter_mut().find(|s| s.node == seen.node) {
            let better =
                (seen.proven.is_some(), seen.likeness) > (known.proven.is_some(), known.likeness);
            if better {
                *known = seen;
            }
            return better;
        }
        if self.seen.len() >= MOST_NODES {
            self.seen.remove(0);
        }
        self.seen.push(seen);
        true
    }

    fn at(&self, node: NodeId) -> Option<f64> {
        let seen = self.seen.iter().find(|s| s.node == node)?;
        Some(seen.likeness)
    }

    fn proven(&self) -> usize {
        self.seen.iter().filter(|s| s.proven.is_some()).count()
    }

    /// How much likelier this is than a rival, by the nodes that were asked of both.
    fn lead(&self, rival: &Self) -> f64 {
        let both = self
            .seen
            .iter()
            .filter_map(|s| Some((s.likeness, rival.at(s.node)?)));
        both.map(|(here, there)| (here / there).ln()).sum()
    }
}

/// How well a place explains what is seen, 0 to 1.
fn likeness(fit: f64, seen_through: f64) -> f64 {
    // What does not fit was not looked at closely.
    let through = if seen_through.is_finite() {
        seen_through
    } else {
        SEEN_THROUGH
    };
    (fit * (-through / SEEN_THROUGH).exp()).max(LEAST_LIKENESS)
}

/// Whether a step is this small.
fn is_within(off: &Vector6<f64>, metres: f64, radians: f64) -> bool {
    off.fixed_rows::<3>(0).norm() < metres && off.fixed_rows::<3>(3).norm() < radians
}
