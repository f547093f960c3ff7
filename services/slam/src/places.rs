//! What places look like: descriptors of submaps, and which known ones are alike.
//!
//! In: submaps with the height of the ground. Out: descriptors, matches. Elsewhere: the descriptors
//! themselves (`hachi-place`), who may be a candidate ([`candidates`](crate::candidates)), proof.

use hachi_cloud::{CeilingFilter, Reason};
use hachi_hal::{Point, Pose};
use hachi_place::{Database, Describer, DescriberConfig, Descriptor, Match, Profile};

use crate::node::{Ground, NodeId};
use crate::submap::Submap;

/// Describes submaps and remembers them; keeps its buffers.
#[derive(Debug, Default)]
pub struct Places {
    /// Made for the first place: its grid follows from how far one sees there.
    describer: Option<Describer>,
    database: Database,
    ceiling: CeilingFilter,
    points: Vec<Point>,
    labels: Vec<Reason>,
    cloud: Vec<[f32; 4]>,
    views: Vec<Descriptor>,
}

impl Places {
    /// Describes a place, as seen from the node and from beside it; what [`Places::query`] and
    /// [`Places::insert`] then work with.
    pub fn describe(&mut self, submap: &Submap, ground: &Ground) {
        self.points.clear();
        self.points.extend(submap.points.iter().map(|p| Point {
            intensity: f32::from(p.intensity),
            ..Point::at(p.position[0], p.position[1], p.position[2])
        }));
        self.labels.clear();
        self.labels.resize(self.points.len(), Reason::Kept);
        // Levelled by gravity, not by the ground: a place on a slope looks the same either way round.
        let footprint_from_node = Pose::translation(0.0, 0.0, f64::from(ground.below_m));
        // A ceiling looks the same everywhere, and is higher than all that tells places apart.
        self.ceiling
            .label(&self.points, &footprint_from_node, &mut self.labels);
        self.cloud.clear();
        let kept = self.points.iter().zip(&self.labels);
        self.cloud.extend(
            kept.filter(|(_, label)| label.is_kept())
                .map(|(p, _)| [p.x, p.y, p.z + ground.below_m, p.intensity]),
        );
        let describer = self.describer.get_or_insert_with(|| {
            let profile = Profile::for_cloud(&self.cloud).unwrap_or(Profile::OUTDOOR);
            Describer::new(profile, DescriberConfig::default())
        });
        describer.describe_views(&self.cloud, &mut self.views);
    }

    /// The bytes of the place described last.
    pub fn bytes(&self) -> Vec<u8> {
        self.views
            .first()
            .map_or_else(Vec::new, Descriptor::to_bytes)
    }

    /// Remembers the place described last as a node's.
    pub fn insert(&mut self, node: NodeId) {
        if let Some(view) = self.views.first() {
            // Of one describer, so of one layout.
            let _ = self.database.insert(u64::from(node.0), view);
        }
    }

    /// Remembers a place read from a saved map. Says whether it could be: its descriptor is whole,
    /// and of the kind that the map's others are.
    pub fn insert_bytes(&mut self, node: NodeId, bytes: &[u8]) -> bool {
        let Ok(descriptor) = Descriptor::from_bytes(bytes) else {
            return false;
        };
        let layout = *descriptor.layout();
        self.describer.get_or_insert_with(|| {
            let config = DescriberConfig {
                kind: layout.kind,
                formula: layout.formula,
                ..DescriberConfig::default()
            };
            Describer::new(layout.profile, config)
        });
        self.database.insert(u64::from(node.0), &descriptor).is_ok()
    }

    /// Known places that look like the one described last, most alike first, at most `n`.
    pub fn query(&self, accept: impl Fn(NodeId) -> bool, n: usize, matches: &mut Vec<Match>) {
        let accept = |id: u64| u32::try_from(id).is_ok_and(|id| accept(NodeId(id)));
        // Of one describer, so of one layout.
        let _ = self.database.query(&self.views, accept, n, matches);
    }
}

/// The node of a match.
pub fn node_of(found: &Match) -> NodeId {
    NodeId(u32::try_from(found.id).unwrap_or(u32::MAX))
}
