//! Who may be where a node is: old nodes inside the search ellipsoid.
//!
//! In: a node of the map, what its place looks like. Out: a few [`Candidate`]s: those that look
//! alike, and, while the graph knows well enough where it is, the nearest. A revisit is proven by
//! alignment, so a corridor that looks like ten others is found by nearness all the same.

use hachi_hal::Pose;
use hachi_place::Match;
use nalgebra::Matrix6;

use crate::config::SlamConfig;
use crate::ledger::FoundBy;
use crate::map::Map;
use crate::node::{Node, NodeId, PieceId};
use crate::places::node_of;
use crate::recognition::{PlaceId, Recognition};
use crate::uncertainty::largest_sigmas;

/// Half axes of the search ellipsoid where the place is known exactly, metres: what one sees from
/// there, one sees from here.
const SEARCH_LEAST_M: f64 = 4.0;

/// Standard deviations of the position since the candidate that are added.
const SEARCH_SIGMAS: f64 = 3.0;

/// Alike places that are looked at for each node.
const ALIKE: usize = 3;

/// Alike places of other pieces that are looked at for each node.
const RECOGNISED: usize = 8;

/// And where one of them is about to be said, or none was for a while.
const CHALLENGERS: usize = 32;

/// A node this close to a place shows it, metres.
const NEIGHBOUR_M: f64 = 8.0;

/// Alignment finds its way from a guess this far off (metres, radians): nearness is asked while three
/// standard deviations are below.
const NEAR_ENOUGH_M: f64 = 1.5;
const NEAR_ENOUGH_RAD: f64 = 0.25;

/// Nodes this close to each other, by number, are one place.
const SAME_PLACE: u32 = 3;

/// An old node that may be where a new one is.
#[derive(Debug, Clone, Copy)]
pub struct Candidate {
    /// The old node.
    pub node: NodeId,
    /// How it came up.
    pub found_by: FoundBy,
    /// How it looks.
    pub looks: Option<Match>,
    /// Where somebody says that it is: `candidate_from_node`.
    pub proposed: Option<Pose>,
    /// The place that is asked again, of those where a piece may lie.
    pub place: Option<PlaceId>,
}

/// The candidates for a node that was described last, the most promising first.
pub fn candidates(map: &mut Map, id: NodeId, config: &SlamConfig, out: &mut Vec<Candidate>) {
    out.clear();
    let Some(node) = map.node(id).copied() else {
        return;
    };
    let own = map.covariance(id);
    let alike = alike(map, &node, own.as_ref(), config);
    let near = own.and_then(|own| nearest(map, &node, &own, config));
    out.extend(alike);
    if let Some(near) = near {
        let same = |c: &&mut Candidate| c.node.0.abs_diff(near.0) <= SAME_PLACE;
        if out.iter_mut().find(same).is_none() {
            out.push(Candidate {
                node: near,
                found_by: FoundBy::Nearness,
                looks: None,
                proposed: None,
                place: None,
            });
        }
    }
}

/// Where a node of a piece that hangs on nothing may be: the places that were thought of before, then
/// nodes of other pieces that look alike, one for each place, most alike first.
pub fn recognised(map: &Map, node: &Node, recognition: &mut Recognition, out: &mut Vec<Candidate>) {
    out.clear();
    let places: Vec<(PlaceId, PieceId, Pose)> = recognition.places().collect();
    for (place, target, target_from_piece) in places {
        let target_from_node = target_from_piece * node.map_from_node;
        match closest(map, target, &target_from_node) {
            Some(old) => out.push(Candidate {
                node: old.id,
                found_by: FoundBy::Recognition,
                looks: None,
                proposed: Some(old.map_from_node.inv_mul(&target_from_node)),
                place: Some(place),
            }),
            None => recognition.leads_off_the_map(node.id, place),
        }
    }
    let mut matches = Vec::new();
    let nodes = map.nodes();
    let elsewhere = |id: NodeId| nodes.get(id.index()).is_some_and(|n| n.piece != node.piece);
    let most = if recognition.asks_everywhere() {
        CHALLENGERS
    } else {
        RECOGNISED
    };
    map.places.query(elsewhere, 3 * most, &mut matches);
    let first = out.len();
    for found in matches {
        let old = node_of(&found);
        let known = |c: &Candidate| c.node.0.abs_diff(old.0) <= SAME_PLACE;
        if out.len() < first + most && !out[first..].iter().any(known) {
            out.push(Candidate {
                node: old,
                found_by: FoundBy::Recognition,
                looks: Some(found),
                proposed: None,
                place: None,
            });
        }
    }
}

/// The node of a piece that is closest to a place, if there is one from which that can be seen.
fn closest<'a>(map: &'a Map, piece: PieceId, place: &Pose) -> Option<&'a Node> {
    let distance =
        |n: &Node| (n.map_from_node.translation.vector - place.translation.vector).norm();
    map.nodes()
        .iter()
        .filter(|n| n.piece == piece)
        .map(|n| (n, distance(n)))
        .filter(|(_, distance)| *distance <= NEIGHBOUR_M)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(n, _)| n)
}

fn alike(
    map: &mut Map,
    node: &Node,
    own: Option<&Matrix6<f64>>,
    config: &SlamConfig,
) -> Vec<Candidate> {
    // First with the node's whole uncertainty, which is never less than that since a candidate.
    let wide = Ellipsoid::new(node, own);
    let nodes = map.nodes();
    let inside = |id: NodeId| {
        nodes
            .get(id.index())
            .is_some_and(|old| is_old(old, node, config) && wide.holds(old))
    };
    let mut matches = Vec::new();
    map.places.query(inside, ALIKE, &mut matches);
    let mut out: Vec<Candidate> = Vec::new();
    for found in matches {
        let old = node_of(&found);
        if out.iter().any(|c| c.node.0.abs_diff(old.0) <= SAME_PLACE) {
            continue;
        }
        let since = map.relative_covariance(old, node.id);
        let ellipsoid = Ellipsoid::new(node, since.as_ref());
        if map.node(old).is_some_and(|old| ellipsoid.holds(old)) {
            out.push(Candidate {
                node: old,
                found_by: FoundBy::Looks,
                looks: Some(found),
                proposed: None,
                place: None,
            });
        }
    }
    out
}

/// The nearest old node, if the graph knows well enough that it is.
fn nearest(map: &mut Map, node: &Node, own: &Matrix6<f64>, config: &SlamConfig) -> Option<NodeId> {
    let reach = Ellipsoid::new(node, Some(own));
    let distance = |old: &Node| {
        let apart = old.map_from_node.translation.vector - node.map_from_node.translation.vector;
        apart.norm()
    };
    let near = map
        .nodes()
        .iter()
        .filter(|old| is_old(old, node, config) && reach.holds(old))
        .map(|old| (old.id, distance(old)))
        .filter(|(_, distance)| *distance <= SEARCH_LEAST_M)
        .min_by(|a, b| a.1.total_cmp(&b.1))?
        .0;
    let since = map.relative_covariance(near, node.id)?;
    let (metres, radians) = largest_sigmas(&since);
    (3.0 * metres < NEAR_ENOUGH_M && 3.0 * radians < NEAR_ENOUGH_RAD).then_some(near)
}

/// Whether the way from the one to the other was long enough to be a revisit.
fn is_old(old: &Node, node: &Node, config: &SlamConfig) -> bool {
    old.piece == node.piece
        && old.id < node.id
        && (old.session != node.session || node.path_m - old.path_m >= config.loop_least_way_m)
}

/// Where old nodes are looked for: the thesis's search area, with axes along the map's.
#[derive(Debug, Clone, Copy)]
struct Ellipsoid {
    centre: nalgebra::Vector3<f64>,
    axes_m: nalgebra::Vector3<f64>,
}

impl Ellipsoid {
    /// Around a node, `since` being the covariance of its pose since the candidate.
    fn new(node: &Node, since: Option<&Matrix6<f64>>) -> Self {
        let rotation = node.map_from_node.rotation.to_rotation_matrix();
        let sigmas = since.map_or_else(nalgebra::Vector3::zeros, |since| {
            let shift = since.fixed_view::<3, 3>(0, 0).into_owned();
            let in_map = rotation.matrix() * shift * rotation.matrix().transpose();
            in_map.diagonal().map(|v| v.max(0.0).sqrt())
        });
        Self {
            centre: node.map_from_node.translation.vector,
            axes_m: sigmas.map(|s| SEARCH_LEAST_M + SEARCH_SIGMAS * s),
        }
    }

    fn holds(&self, old: &Node) -> bool {
        let apart = old.map_from_node.translation.vector - self.centre;
        apart.component_div(&self.axes_m).norm_squared() <= 1.0
    }
}
