//! Proving a candidate: the nodes before the present one laid on those around the candidate.
//!
//! In: a candidate, the map. Out: a ledger entry with the numbers, and a verdict. Elsewhere: which
//! candidates there are ([`candidates`](crate::candidates)), what a loop does to the map
//! ([`Map::add_loops`](crate::map::Map::add_loops)).

use hachi_hal::{Pose, Rotation};
use nalgebra::Matrix6;

use crate::alignment::{Aligned, Alignment};
use crate::candidates::Candidate;
use crate::config::SlamConfig;
use crate::ledger::{LedgerEntry, LoopId, Refusal, Verdict};
use crate::map::Map;
use crate::node::{Node, NodeId};
use crate::sight::Walls;
use crate::surfaces::Surfaces;
use crate::tangent::difference;
use crate::uncertainty::of_alignment;

/// Surfaces farther than this from either place are left out.
const REACH_M: f32 = 50.0;

/// Of the odometry's way between two candidates' nodes, what it may be wrong by, when loops are asked
/// whether they agree.
const AGREE_M: f64 = 0.3;
const AGREE_RAD: f64 = 0.05;
const AGREE_SHARE: f64 = 0.01;

/// How far from the graph a loop may lie at all: a share of the way since, and some metres. Beyond,
/// however many agree, it is another place that looks the same.
const BELIEVABLE_SHARE: f64 = 0.05;
const BELIEVABLE_M: f64 = 1.0;

/// Squared Mahalanobis distance to the graph beyond which a loop needs others that agree: of true
/// ones one in a thousand is farther, with six degrees of freedom.
const MOST_CHI2: f64 = 22.46;

/// How many others have to agree.
const AGREEING: usize = 2;

/// Share of what is seen that has to lie at a place of another piece for it to be looked at closely.
const LEAST_LIKELY: f64 = 0.35;

/// Nodes follow each other within this many times the way after which one is fixed; between others the
/// robot passed places that have nodes.
const FOLLOWS: f64 = 2.0;

/// Loops that wait for others to agree.
const MOST_WAITING: usize = 16;

/// A loop that fits, and what it would weigh in the graph.
#[derive(Debug, Clone, Copy)]
pub struct Proven {
    /// Its ledger entry.
    pub entry: LedgerEntry,
    /// Its information.
    pub information: Matrix6<f64>,
}

/// Checks candidates, in steps; keeps its buffers.
#[derive(Debug, Default)]
pub struct Closing {
    target: Surfaces,
    source: Surfaces,
    alignment: Alignment,
    walls: Walls,
    waiting: Vec<Proven>,
}

impl Closing {
    /// Begins with a candidate. `false` if its submaps can't be read.
    pub fn begin(
        &mut self,
        map: &mut Map,
        entry: &mut LedgerEntry,
        candidate: &Candidate,
        config: &SlamConfig,
    ) -> bool {
        let (Some(node), Some(old)) = (
            map.node(entry.node).copied(),
            map.node(entry.candidate).copied(),
        ) else {
            return false;
        };
        let v = config.loop_submaps as u32;
        let before = gather(map, &node, v, 0, config, &mut self.source);
        let around = gather(map, &old, v, v, config, &mut self.target);
        if !before || !around {
            return false;
        }
        self.target.index();
        let mut guesses = [Pose::identity(); 3];
        let mut count = 0;
        let mut add = |guess: Pose| {
            guesses[count] = guess;
            count += 1;
        };
        if node.piece == old.piece {
            let by_graph = old.map_from_node.inv_mul(&node.map_from_node);
            entry.distance_m = by_graph.translation.vector.norm() as f32;
            add(by_graph);
        }
        if let Some(looks) = &candidate.looks {
            entry.similarity = looks.similarity;
            entry.yaw_rad = looks.yaw_rad;
            let mut by_looks = looks.candidate_from_query();
            by_looks.translation.z += f64::from(node.ground.below_m - old.ground.below_m);
            add(by_looks);
            if node.piece != old.piece {
                // A corridor looks much the same both ways.
                add(by_looks * Rotation::from_euler_angles(0.0, 0.0, std::f64::consts::PI));
            }
        }
        if let Some(proposed) = candidate.proposed {
            add(proposed);
        }
        if node.piece == old.piece {
            self.alignment.begin(&self.source, &guesses[..count]);
        } else {
            // Nothing says which of them is right: each is judged by itself.
            self.alignment.begin_each(&self.source, &guesses[..count]);
        }
        true
    }

    /// A step; the alignment when it is done. Of a candidate on another piece there may be several,
    /// one after the other, until [`Closing::is_over`].
    pub fn step(&mut self) -> Option<Aligned> {
        self.alignment.step(&self.target)
    }

    /// Whether the candidate has been looked at from all sides.
    pub fn is_over(&self) -> bool {
        self.alignment.is_over()
    }

    /// Share of the lines of sight of either place that lead through surfaces of the other.
    fn seen_through(&mut self, target_from_source: &Pose) -> f64 {
        self.walls.gather(&self.target);
        let there = self.walls.seen_through(&self.source, target_from_source);
        self.walls.gather(&self.source);
        let source_from_target = target_from_source.inverse();
        there + self.walls.seen_through(&self.target, &source_from_target)
    }

    /// Writes what was found into the entry, and says whether it is good by itself.
    pub fn judge(
        &mut self,
        entry: &mut LedgerEntry,
        candidate: &Candidate,
        aligned: &Aligned,
        same_piece: bool,
        config: &SlamConfig,
    ) -> Result<Proven, Refusal> {
        let (found, fitness) = (&aligned.found, &aligned.fitness);
        let of_guess = |i: usize| {
            self.alignment
                .guess_fitness(i)
                .map_or(f32::NAN, |f| f as f32)
        };
        if same_piece {
            entry.graph_fitness = of_guess(0);
        }
        if candidate.looks.is_some() {
            entry.looks_fitness = of_guess(if same_piece { 1 } else { aligned.guess });
        }
        entry.overlap = fitness.overlap as f32;
        entry.inlier_share = fitness.inlier_share() as f32;
        entry.residual_m = fitness.residual_m as f32;
        entry.open = (found.degeneracy.translations + found.degeneracy.rotations) as u8;
        entry.candidate_from_node = found.target_from_source;
        if !same_piece && fitness.fit_share >= LEAST_LIKELY {
            entry.seen_through = self.seen_through(&found.target_from_source) as f32;
        }
        if !found.converged {
            return Err(Refusal::NotConverged);
        }
        if fitness.overlap < config.loop_least_overlap {
            return Err(Refusal::LittleOverlap);
        }
        if fitness.inlier_share() < config.loop_least_inliers {
            return Err(Refusal::PoorFit);
        }
        // Where odometry says nothing of it, a place along an open direction is the guess's.
        let most_open = usize::from(same_piece);
        if found.degeneracy.rotations > 0 || found.degeneracy.translations > most_open {
            return Err(Refusal::Unobserved);
        }
        Ok(Proven {
            entry: *entry,
            information: of_alignment(found, fitness),
        })
    }

    /// Asks the graph, and where it disagrees the other loops that it disagreed with. All loops that
    /// are to be added now; none if this one has to wait.
    pub fn agree(&mut self, map: &mut Map, proven: &mut Proven) -> Vec<(LoopId, Matrix6<f64>)> {
        let entry = &mut proven.entry;
        let chi2 = map.chi2(
            entry.candidate,
            entry.node,
            &entry.candidate_from_node,
            &proven.information,
        );
        let Some(chi2) = chi2 else {
            entry.verdict = Verdict::Refused(Refusal::AgainstGraph);
            return Vec::new();
        };
        entry.chi2 = chi2 as f32;
        if chi2 <= MOST_CHI2 {
            return vec![(entry.id, proven.information)];
        }
        if !believable(map, entry) {
            entry.verdict = Verdict::Refused(Refusal::AgainstGraph);
            return Vec::new();
        }
        let agreeing: Vec<Proven> = self
            .waiting
            .iter()
            .filter(|other| agrees(map, &other.entry, entry))
            .copied()
            .collect();
        entry.agreeing = agreeing.len() as u16;
        if agreeing.len() < AGREEING {
            entry.verdict = Verdict::Waiting;
            if self.waiting.len() >= MOST_WAITING {
                self.waiting.remove(0);
            }
            self.waiting.push(*proven);
            return Vec::new();
        }
        self.waiting
            .retain(|w| !agreeing.iter().any(|a| a.entry.id == w.entry.id));
        let mut loops: Vec<_> = agreeing
            .iter()
            .map(|p| (p.entry.id, p.information))
            .collect();
        loops.push((entry.id, proven.information));
        loops
    }
}

/// Whether odometry could have drifted as far as a loop says.
fn believable(map: &Map, entry: &LedgerEntry) -> bool {
    let (Some(node), Some(old)) = (map.node(entry.node), map.node(entry.candidate)) else {
        return false;
    };
    let by_graph = old.map_from_node.inv_mul(&node.map_from_node);
    let off = (by_graph.translation.vector - entry.candidate_from_node.translation.vector).norm();
    let way_m = if node.session == old.session {
        node.path_m - old.path_m
    } else {
        node.path_m
    };
    off <= BELIEVABLE_M + BELIEVABLE_SHARE * way_m
}

/// Whether two loops say the same of how the new nodes lie to the old ones.
fn agrees(map: &Map, a: &LedgerEntry, b: &LedgerEntry) -> bool {
    let pose = |id: NodeId| map.node(id).map(|n| n.map_from_node);
    let (Some(a_new), Some(a_old), Some(b_new), Some(b_old)) = (
        pose(a.node),
        pose(a.candidate),
        pose(b.node),
        pose(b.candidate),
    ) else {
        return false;
    };
    if a.node == b.node {
        return false;
    }
    let news = a_new.inv_mul(&b_new);
    let olds = a_old.inv_mul(&b_old);
    let by_a = a.candidate_from_node * news;
    let by_b = olds * b.candidate_from_node;
    let off = difference(&by_a, &by_b);
    let way = news.translation.vector.norm() + olds.translation.vector.norm();
    off.fixed_rows::<3>(0).norm() < AGREE_M + AGREE_SHARE * way
        && off.fixed_rows::<3>(3).norm() < AGREE_RAD
}

/// Lays a node's neighbours together in its frame: up to `before` before and `after` after it, of its
/// own session and as far as the robot went on from one to the next without passing known places.
/// `false` if its own submap can't be read.
pub fn gather(
    map: &mut Map,
    node: &Node,
    before: u32,
    after: u32,
    config: &SlamConfig,
    out: &mut Surfaces,
) -> bool {
    out.clear();
    let Ok(own) = map.submap(node.id) else {
        return false;
    };
    let most_m = FOLLOWS * config.node_every_m(own.voxel_m);
    let follows = |map: &Map, id: u32, beside: &Node| {
        let other = map.node(NodeId(id)).copied();
        other.filter(|other| {
            other.session == node.session
                && other.piece == node.piece
                && (other.path_m - beside.path_m).abs() <= most_m
        })
    };
    let (mut first, mut last) = (*node, *node);
    while node.id.0 - first.id.0 < before
        && let Some(other) = first
            .id
            .0
            .checked_sub(1)
            .and_then(|id| follows(map, id, &first))
    {
        first = other;
    }
    while last.id.0 - node.id.0 < after
        && let Some(other) = follows(map, last.id.0.saturating_add(1), &last)
    {
        last = other;
    }
    for id in (first.id.0..=last.id.0).map(NodeId) {
        let (Some(other), Ok(submap)) = (map.node(id).copied(), map.submap(id)) else {
            continue;
        };
        let node_from_other = node.map_from_node.inv_mul(&other.map_from_node);
        out.add(&submap, &node_from_other, [0.0; 3], REACH_M);
    }
    true
}
