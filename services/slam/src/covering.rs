//! Whether nodes that exist cover a finished submap: then it says nothing new, and needs no node.
//!
//! In: a submap, and where the graph and the chain put it. Out: the node that covers it with the
//! offset that alignment found, or nothing: it becomes a node then, and its loops are looked for as
//! those of any other. Only where the graph knows its place already is it asked at all: a place that
//! has to be recognised needs nodes, and the search of [`candidates`](crate::candidates).

use hachi_hal::Pose;
use hashbrown::HashMap;
use nalgebra::Matrix6;

use crate::alignment::{Alignment, Fitness};
use crate::anchor::{Anchor, Link};
use crate::config::SlamConfig;
use crate::growing::GrownSubmap;
use crate::map::Map;
use crate::node::{Node, NodeId};
use crate::surfaces::Surfaces;
use crate::tangent::{difference, stepped};
use crate::uncertainty::{invert, largest_sigmas, of_alignment};

/// A node this close covers a submap, of the way after which nodes follow each other: nodes come no
/// denser than that, and of those along a way passed before one is always closer.
const CLOSE_SHARE: f64 = 0.75;

/// Alignment begins within half a metre: how surely the place has to be known, three standard
/// deviations.
const KNOWN_M: f64 = 0.5;
const KNOWN_RAD: f64 = 0.1;

/// And afterwards: surer than odometry is after some ten metres.
const SURE_M: f64 = 0.1;
const SURE_RAD: f64 = 0.03;

/// Squared Mahalanobis distance between graph and alignment, at most: of true ones one in a thousand is
/// farther, with six degrees of freedom.
const MOST_CHI2: f64 = 22.46;

/// Of the submap's surfaces, the share that has to lie near ones of the nodes, and of these, on them.
const LEAST_OVERLAP: f64 = 0.9;
const LEAST_INLIERS: f64 = 0.85;

/// A node is old after the way that makes a place seen again a loop, or after so many others: a robot
/// that turns on the spot goes no way.
const OLD_AFTER: u32 = 12;

/// Surfaces farther away are seen by a few rays only, and others every time, metres.
const REACH_M: f32 = 50.0;
const LOOKED_AT_M: f32 = 20.0;

/// Nothing within this of a surface, metres and in cubes: it is new.
const NEW_M: f32 = 0.3;
const NEW_VOXELS: f32 = 2.0;

/// Edge of the columns in which new surfaces are counted, metres and in cubes.
const COLUMN_M: f32 = 1.0;
const COLUMN_VOXELS: f32 = 5.0;

/// A thing is new if so many surfaces of a column are.
const NEW_SURFACES: usize = 30;

/// A finished submap, and how it came.
#[derive(Debug, Clone, Copy)]
pub struct Arrival<'a> {
    /// The submap.
    pub grown: &'a GrownSubmap,
    /// What odometry hung on before.
    pub anchor: &'a Anchor,
    /// From that node to the submap.
    pub chained: &'a Link,
    /// The nodes that it was aligned with for this.
    pub recent: &'a [NodeId],
    /// The present run of the robot.
    pub session: u32,
}

/// A node that covers a submap.
#[derive(Debug, Clone, Copy)]
pub struct Covered {
    /// The node.
    pub node: NodeId,
    /// From it to the submap, by alignment alone.
    pub aligned: Link,
    /// The same by all that is known.
    pub to_submap: Link,
    /// Squared Mahalanobis distance between the two.
    pub chi2: f64,
    /// How well the submap lies on the nodes.
    pub fitness: Fitness,
}

/// Asks whether submaps are covered, in steps; keeps its buffers.
#[derive(Debug, Default)]
pub struct Covering {
    target: Surfaces,
    source: Surfaces,
    alignment: Alignment,
    asked: Option<Asked>,
    /// The old nodes of the piece, and those that the robot made a moment ago, the nearest first.
    old: Vec<(f64, NodeId)>,
    fresh: Vec<(f64, NodeId)>,
    /// Surfaces of the latter.
    beside: Surfaces,
    columns: HashMap<[i32; 2], usize>,
}

#[derive(Debug, Clone, Copy)]
struct Asked {
    node: Node,
    expected: Link,
    /// How many nodes are asked whether they know what is new.
    beside: usize,
}

impl Covering {
    /// Begins with a submap. `false` if its place is not known well enough, or no old node is close.
    pub fn begin(&mut self, map: &mut Map, arrival: &Arrival<'_>, config: &SlamConfig) -> bool {
        let (grown, chained) = (arrival.grown, arrival.chained);
        let Some(from) = map.node(arrival.anchor.node).copied() else {
            return false;
        };
        let map_from_submap = from.map_from_node * chained.pose;
        self.find(map, &from, &map_from_submap, arrival, config);
        let most_m = CLOSE_SHARE * config.node_every_m(grown.submap.voxel_m);
        let closest = self.old.first().filter(|(metres, _)| *metres <= most_m);
        let Some(node) = closest.and_then(|(_, id)| map.node(*id)).copied() else {
            return false;
        };
        let Some(since) = map.relative_covariance(node.id, from.id) else {
            return false;
        };
        let by_graph = Link {
            pose: node.map_from_node.inv_mul(&from.map_from_node),
            covariance: since,
        };
        let expected = by_graph.then(chained);
        let (metres, radians) = largest_sigmas(&expected.covariance);
        if 3.0 * metres > KNOWN_M || 3.0 * radians > KNOWN_RAD || map.is_contested(from.id, node.id)
        {
            return false;
        }
        self.lay_out(map, &node, &expected.pose, arrival.recent, config);
        self.source.clear();
        self.source
            .add(&grown.submap, &Pose::identity(), [0.0; 3], REACH_M);
        self.alignment.begin_close(&self.source, &expected.pose);
        self.asked = Some(Asked {
            node,
            expected,
            beside: 2 * config.loop_submaps + 1,
        });
        true
    }

    /// The nodes of the piece, by distance.
    fn find(
        &mut self,
        map: &Map,
        from: &Node,
        map_from_submap: &Pose,
        arrival: &Arrival<'_>,
        config: &SlamConfig,
    ) {
        let is_old = |n: &Node| {
            n.session != arrival.session
                || arrival.grown.path_m - n.path_m >= config.loop_least_way_m
                || arrival.anchor.made.0 >= n.id.0.saturating_add(OLD_AFTER)
        };
        let here = map_from_submap.translation.vector;
        self.old.clear();
        self.fresh.clear();
        for node in map.nodes().iter().filter(|n| n.piece == from.piece) {
            let metres = (node.map_from_node.translation.vector - here).norm();
            let list = if is_old(node) {
                &mut self.old
            } else {
                &mut self.fresh
            };
            list.push((metres, node.id));
        }
        for list in [&mut self.old, &mut self.fresh] {
            list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
    }

    /// The nearest old nodes as something to align to, in the frame of the closest. What the submap was
    /// aligned with already is left out: the two are to say something of each other.
    fn lay_out(
        &mut self,
        map: &mut Map,
        node: &Node,
        node_from_submap: &Pose,
        recent: &[NodeId],
        config: &SlamConfig,
    ) {
        let centre = node_from_submap.translation.vector.cast::<f32>().into();
        let most = 2 * config.loop_submaps + 1;
        let others = self
            .old
            .iter()
            .map(|(_, id)| *id)
            .filter(|id| *id == node.id || !recent.contains(id))
            .take(most);
        lay(map, node, centre, others, &mut self.target);
    }

    /// A step; when it is decided, the node that covers the submap, if one does.
    pub fn step(&mut self, map: &mut Map) -> Option<Option<Covered>> {
        let Some(asked) = self.asked else {
            return Some(None);
        };
        let aligned = self.alignment.step(&self.target)?;
        self.asked = None;
        let (found, fitness) = (&aligned.found, &aligned.fitness);
        if !found.converged
            || fitness.overlap < LEAST_OVERLAP
            || fitness.inlier_share() < LEAST_INLIERS
        {
            return Some(None);
        }
        let aligned = Link {
            pose: found.target_from_source,
            covariance: invert(&of_alignment(found, fitness)),
        };
        let (to_submap, chi2) = weighed(&asked.expected, &aligned);
        let (metres, radians) = largest_sigmas(&to_submap.covariance);
        let is_sure = chi2 <= MOST_CHI2 && metres <= SURE_M && radians <= SURE_RAD;
        if !is_sure {
            return Some(None);
        }
        let mut newest = self.newest(&to_submap.pose, false);
        if newest >= NEW_SURFACES {
            // Perhaps a node that was made a moment ago has it.
            let centre = to_submap.pose.translation.vector.cast::<f32>().into();
            let fresh = self.fresh.iter().map(|(_, id)| *id).take(asked.beside);
            lay(map, &asked.node, centre, fresh, &mut self.beside);
            newest = self.newest(&to_submap.pose, true);
        }
        if newest >= NEW_SURFACES {
            return Some(None);
        }
        Some(Some(Covered {
            node: asked.node.id,
            aligned,
            to_submap,
            chi2,
            fitness: *fitness,
        }))
    }

    /// The most new surfaces in a column; those that a node made a moment ago has are not, if such were
    /// laid `beside`.
    fn newest(&mut self, node_from_submap: &Pose, beside: bool) -> usize {
        let pose = node_from_submap.cast::<f32>();
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let voxel_m = self.source.voxel_m().max(self.target.voxel_m());
        let reach = NEW_M.max(NEW_VOXELS * voxel_m);
        let column_m = COLUMN_M.max(COLUMN_VOXELS * voxel_m);
        self.columns.clear();
        for point in self.source.points() {
            let position = nalgebra::Vector3::from(point.position);
            if position.norm() > LOOKED_AT_M {
                continue;
            }
            let moved = rotation * position + shift;
            let moved = moved.into();
            if self.target.is_near(moved, reach) || (beside && self.beside.is_near(moved, reach)) {
                continue;
            }
            let column = [moved[0], moved[1]].map(|c| (c / column_m).floor() as i32);
            *self.columns.entry(column).or_default() += 1;
        }
        self.columns.values().copied().max().unwrap_or(0)
    }
}

/// Lays nodes together in the frame of one, and makes them ready to be searched.
fn lay(
    map: &mut Map,
    node: &Node,
    centre: [f32; 3],
    others: impl Iterator<Item = NodeId>,
    out: &mut Surfaces,
) {
    out.clear();
    for id in others {
        let Some(map_from_other) = map.node(id).map(|n| n.map_from_node) else {
            continue;
        };
        if let Ok(submap) = map.submap(id) {
            let node_from_other = node.map_from_node.inv_mul(&map_from_other);
            out.add(&submap, &node_from_other, centre, REACH_M);
        }
    }
    out.index();
}

/// Where two measurements of one pose put it together, and their squared Mahalanobis distance.
fn weighed(expected: &Link, aligned: &Link) -> (Link, f64) {
    let off = difference(&expected.pose, &aligned.pose);
    let apart = invert(&(expected.covariance + aligned.covariance));
    let chi2 = (off.transpose() * apart * off)[0];
    let of_alignment = aligned.information();
    let covariance: Matrix6<f64> = invert(&(of_alignment + expected.information()));
    let step = covariance * of_alignment * off;
    let link = Link {
        pose: stepped(&expected.pose, &step),
        covariance,
    };
    (link, chi2)
}
