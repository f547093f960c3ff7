//! The places known so far, asked which of them look like this.
//!
//! In: descriptors with ids, then descriptors to look for. Out: [`Match`]es. A search takes three
//! steps: nearest ring keys in k-d trees, the sector keys' best shifts, the full comparison around
//! these. Elsewhere: which ids may match now (the caller's closure), what a match is worth
//! (registration), files ([`to_bytes`](Database::to_bytes) makes what a file holds).

use std::collections::HashMap;

use crate::comparison::{Aligner, Comparison, Features, ShiftSearch};
use crate::descriptor::{Descriptor, Kind, Layout};
use crate::key_tree::{KeyForest, Near};
use crate::ring_key::RingKey;

/// How places are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SearchConfig {
    /// Places with the nearest ring keys that are compared in full, for each view.
    pub candidates: usize,
    /// Where the full comparison looks for the best shift.
    pub shifts: ShiftSearch,
    /// Only what is more alike than this is a match, the thesis's `tau`.
    pub min_similarity: f32,
}

impl Default for SearchConfig {
    fn default() -> Self {
        Self {
            candidates: 50,
            shifts: ShiftSearch::default(),
            min_similarity: 0.4,
        }
    }
}

/// What a database is for its life, and how places are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DatabaseConfig {
    /// How two descriptors are compared.
    pub comparison: Comparison,
    /// What places are first looked up by.
    pub ring_key: RingKey,
    /// How they are looked for; may change later.
    pub search: SearchConfig,
}

impl DatabaseConfig {
    /// What suits a kind: Scan Context as published, with occupancy keys and the plain cosine; the
    /// Gaussian kinds with what was measured to work best.
    pub fn for_kind(kind: Kind) -> Self {
        match kind {
            Kind::ScanContext => Self {
                comparison: Comparison::Frobenius,
                ring_key: RingKey::Occupancy,
                ..Self::default()
            },
            Kind::GscHeight | Kind::GscHuber | Kind::GscIntensity => Self::default(),
        }
    }
}

/// A known place that looks like the one asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// The known place.
    pub id: u64,
    /// How alike: 1 for the same descriptor.
    pub similarity: f32,
    /// Rotation about z from the query's levelled frame to the candidate's, radians in
    /// `(-pi, pi]`: see [`candidate_from_query`](Self::candidate_from_query).
    pub yaw_rad: f32,
    /// How far the candidate's position lies to the left of the query's (along the query's y
    /// axis), metres: the offset of the view that matched.
    pub lateral_m: f32,
}

impl Match {
    /// The pose of the query's levelled frame in the candidate's, as far as descriptors know it: a
    /// point `p` of the query's cloud lies at `R_z(yaw) * (p - (0, lateral, 0))` in the candidate's.
    pub fn candidate_from_query(&self) -> hachi_hal::Pose {
        let yaw = hachi_hal::Rotation::from_euler_angles(0.0, 0.0, f64::from(self.yaw_rad));
        let aside = hachi_hal::Vector3::new(0.0, -f64::from(self.lateral_m), 0.0);
        hachi_hal::Pose::from_parts((yaw * aside).into(), yaw)
    }
}

/// A descriptor that does not fit the database's others.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the database holds descriptors of {expected:?}, this one is of {got:?}")]
pub struct LayoutMismatch {
    /// The database's.
    pub expected: Layout,
    /// The descriptor's.
    pub got: Layout,
}

/// A place in the database.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub(crate) id: u64,
    pub(crate) features: Features,
}

/// Places that can be recognised.
#[derive(Debug, Clone, Default)]
pub struct Database {
    pub(crate) config: DatabaseConfig,
    /// Given, or the first descriptor's.
    pub(crate) layout: Option<Layout>,
    pub(crate) keys: KeyForest,
    /// By slot; `None` where a place was removed.
    pub(crate) places: Vec<Option<Place>>,
    slots: HashMap<u64, u32>,
}

impl Database {
    /// An empty database, which takes the layout of its first descriptor.
    pub fn new(config: DatabaseConfig) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// An empty database for descriptors of one layout.
    pub fn with_layout(layout: Layout, config: DatabaseConfig) -> Self {
        Self {
            keys: KeyForest::new(config.ring_key.dimensions(layout.profile.rings())),
            layout: Some(layout),
            ..Self::new(config)
        }
    }

    /// What its descriptors have in common; `None` before the first.
    pub fn layout(&self) -> Option<&Layout> {
        self.layout.as_ref()
    }

    /// Its configuration.
    pub fn config(&self) -> &DatabaseConfig {
        &self.config
    }

    /// Changes how places are looked for.
    pub fn set_search(&mut self, search: SearchConfig) {
        self.config.search = search;
    }

    /// How many places there are.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Whether there is a place of this id.
    pub fn contains(&self, id: u64) -> bool {
        self.slots.contains_key(&id)
    }

    /// The ids, earliest first.
    pub fn ids(&self) -> impl Iterator<Item = u64> + '_ {
        self.places.iter().flatten().map(|place| place.id)
    }

    /// Adds a place. One with the same id is replaced. An empty descriptor is kept, and matches
    /// nothing.
    ///
    /// # Errors
    /// [`LayoutMismatch`]: another grid, kind or formula than the database's.
    pub fn insert(&mut self, id: u64, descriptor: &Descriptor) -> Result<(), LayoutMismatch> {
        self.check(descriptor)?;
        let mut features = Features::default();
        Features::of(descriptor, self.config.comparison, &mut features);
        if self.layout.is_none() {
            self.layout = Some(descriptor.layout);
            self.keys = self.no_keys();
        }
        self.remove(id);
        self.append(id, features, &self.config.ring_key.of(descriptor));
        Ok(())
    }

    fn no_keys(&self) -> KeyForest {
        let rings = self.layout.map_or(0, |layout| layout.profile.rings());
        KeyForest::new(self.config.ring_key.dimensions(rings))
    }

    pub(crate) fn append(&mut self, id: u64, features: Features, key: &[u16]) {
        self.slots.insert(id, self.places.len() as u32);
        self.keys.push(key);
        self.places.push(Some(Place { id, features }));
    }

    /// Removes a place; says whether there was one.
    pub fn remove(&mut self, id: u64) -> bool {
        let Some(slot) = self.slots.remove(&id) else {
            return false;
        };
        self.places[slot as usize] = None;
        /// Holes that are not worth the work.
        const FEW: usize = 64;
        let holes = self.places.len() - self.slots.len();
        if holes > FEW.max(self.slots.len()) {
            self.close_holes();
        }
        true
    }

    /// Makes slots and trees anew, in the same order, without the removed ones.
    fn close_holes(&mut self) {
        let keys = std::mem::take(&mut self.keys);
        let places = std::mem::take(&mut self.places);
        self.keys = self.no_keys();
        for (slot, place) in places.into_iter().enumerate() {
            if let Some(Place { id, features }) = place {
                self.append(id, features, keys.key(slot));
            }
        }
    }

    /// The places most alike to the one seen, into `matches`, most alike first: at most `n`, each
    /// more alike than the configured least, of ids that `accept` takes. Of equally alike ones, the
    /// earlier.
    ///
    /// `views` is what is seen from one position, or what
    /// [`describe_views`](crate::Describer::describe_views) made of it; each place is given with
    /// the view that fits it best. `accept` is asked about some ids more than once.
    ///
    /// # Errors
    /// [`LayoutMismatch`]: another grid, kind or formula than the database's.
    pub fn query(
        &self,
        views: &[Descriptor],
        accept: impl Fn(u64) -> bool,
        n: usize,
        matches: &mut Vec<Match>,
    ) -> Result<(), LayoutMismatch> {
        matches.clear();
        let Some(layout) = self.layout else {
            return Ok(());
        };
        views.iter().try_for_each(|view| self.check(view))?;
        let config = &self.config;
        let mut aligner = Aligner::default();
        let mut features = Features::default();
        let mut near = Vec::new();
        let mut compared: Vec<(u32, Match)> = Vec::new();
        for view in views {
            Features::of(view, config.comparison, &mut features);
            if features.is_empty() {
                continue;
            }
            self.nearest_keys(&config.ring_key.of(view), &accept, &mut near);
            for &Near { slot, .. } in &near {
                let Some(place) = &self.places[slot as usize] else {
                    continue;
                };
                let aligned = aligner.align(
                    &features,
                    &place.features,
                    config.comparison,
                    config.search.shifts,
                );
                let Some(aligned) = aligned else {
                    continue;
                };
                if aligned.similarity > config.search.min_similarity {
                    let found = Match {
                        id: place.id,
                        similarity: aligned.similarity,
                        yaw_rad: wrapped(aligned.shift * layout.profile.sector_rad()),
                        lateral_m: view.lateral_m,
                    };
                    compared.push((slot, found));
                }
            }
        }
        // Each place once, with its best view; the sort is stable, so the earlier view on a tie.
        compared.sort_by(|(a_slot, a), (b_slot, b)| {
            a_slot
                .cmp(b_slot)
                .then(b.similarity.total_cmp(&a.similarity))
        });
        compared.dedup_by_key(|(slot, _)| *slot);
        compared.sort_by(|(_, a), (_, b)| b.similarity.total_cmp(&a.similarity));
        matches.extend(compared.into_iter().take(n).map(|(_, found)| found));
        Ok(())
    }

    fn nearest_keys(&self, key: &[u16], accept: impl Fn(u64) -> bool, near: &mut Vec<Near>) {
        let taken = |slot: u32| {
            let place = self.places[slot as usize].as_ref();
            place.is_some_and(|place| !place.features.is_empty() && accept(place.id))
        };
        self.keys
            .nearest(key, self.config.search.candidates, taken, near);
    }

    fn check(&self, descriptor: &Descriptor) -> Result<(), LayoutMismatch> {
        match self.layout {
            Some(expected) if expected != descriptor.layout => Err(LayoutMismatch {
                expected,
                got: descriptor.layout,
            }),
            _ => Ok(()),
        }
    }
}

/// An angle in `(-pi, pi]`.
fn wrapped(angle: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    let angle = angle.rem_euclid(TAU);
    if angle > PI { angle - TAU } else { angle }
}
