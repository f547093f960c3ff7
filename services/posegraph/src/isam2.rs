//! Incremental smoothing: iSAM2 on a Bayes tree.
//!
//! In: new factors and poses, a few at a time. Out: the best estimate of all poses after each
//! update, at the cost of the part that changed. Kaess et al., *iSAM2: Incremental smoothing and
//! mapping using the Bayes tree*, IJRR 2012: the poses near the change are eliminated anew, in an
//! order that keeps recent poses at the root; poses whose step has grown are linearised anew; steps
//! are passed on down the tree only where they changed. Cliques are kept as Cholesky factors.
//!
//! Read `update.rs` first: it is the pipeline. No step calls itself, so no chain is too long; no
//! clock is read and nothing is iterated in hash order, so the same calls give the same bits.

mod eliminate;
mod marginal;
mod pool;
mod relinearise;
mod solve;
mod tree;
mod update;
mod variables;

use crate::anchor::Anchors;
use crate::error::Error;
use crate::factor::{Factor, FactorId, Key};
use crate::group::Group;
use crate::slab::{Bound, Slab};
use tree::Tree;
use update::Workspace;
use variables::Variables;

/// How much is done in an update.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Isam2Config {
    /// A pose is linearised anew once a number of its step is this large, metres or radians.
    pub relinearise_threshold: f64,
    /// A step is passed on to the poses that depend on it once one of its numbers changed by more
    /// than this since it was passed on last.
    pub propagate_threshold: f64,
    /// How many poses an update may eliminate anew, beyond those that its own factors make
    /// necessary, and to how many more poses it may pass steps on. The rest is left for the next
    /// updates; what one leaves unused adds to the next, so that nothing waits forever. `None`: no
    /// limit.
    pub work_limit: Option<usize>,
}

impl Default for Isam2Config {
    fn default() -> Self {
        Self {
            relinearise_threshold: 0.05,
            propagate_threshold: 1e-4,
            work_limit: None,
        }
    }
}

/// What one update does differently.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UpdateOptions {
    /// Instead of [`Isam2Config::relinearise_threshold`]; zero linearises every pose anew.
    pub relinearise_threshold: Option<f64>,
    /// Instead of [`Isam2Config::propagate_threshold`]; zero computes every step.
    pub propagate_threshold: Option<f64>,
    /// Do all of the work, whatever [`Isam2Config::work_limit`] says.
    pub unlimited: bool,
}

/// What an update did.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct UpdateReport {
    /// Identifiers of the new factors, in their order.
    pub factor_ids: Vec<FactorId>,
    /// Poses that were linearised anew.
    pub relinearised: usize,
    /// Poses that were eliminated anew, new ones included.
    pub affected: usize,
    /// Cliques these poses now form.
    pub cliques: usize,
    /// Poses whose step was computed.
    pub solved: usize,
    /// Poses that should be linearised anew but wait for a later update.
    pub waiting: usize,
    /// Poses of which less is known than rounding can tell, though they hang on a prior: they are
    /// held where they are by a share of 1e-11 of their factors.
    pub weak: usize,
}

/// An incremental solver that owns its factors and poses.
///
/// ```
/// use hachi_posegraph::{Factor, Isam2, Isam2Config, Se2};
/// use nalgebra::Matrix3;
///
/// let mut isam = Isam2::new(Isam2Config::default());
/// let tight = Matrix3::identity() * 1e4;
/// isam.update(&[Factor::prior(0, Se2::new(0.0, 0.0, 0.0), tight)], &[(0, Se2::new(0.0, 0.0, 0.0))], &[])?;
/// let step = Factor::between(0, 1, Se2::new(1.0, 0.0, 0.1), tight);
/// let report = isam.update(&[step], &[(1, Se2::new(0.9, 0.1, 0.0))], &[])?;
/// assert!((isam.estimate(1).unwrap().translation.x - 1.0).abs() < 1e-6);
/// isam.update(&[Factor::loop_closure(1, 0, Se2::new(-1.0, 0.1, -0.1), tight)], &[], &report.factor_ids)?;
/// # Ok::<(), hachi_posegraph::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Isam2<G: Group> {
    config: Isam2Config,
    variables: Variables<G>,
    factors: Slab<Bound<G>>,
    anchors: Anchors,
    tree: Tree,
    work: Workspace<G>,
}

impl<G: Group> Isam2<G> {
    /// A solver without poses.
    pub fn new(config: Isam2Config) -> Self {
        Self {
            config,
            variables: Variables::default(),
            factors: Slab::default(),
            anchors: Anchors::default(),
            tree: Tree::default(),
            work: Workspace::default(),
        }
    }

    /// Adds poses and factors, removes factors, and brings the estimate up to date. All three may be
    /// empty: the work that an earlier update left is taken up.
    ///
    /// Factors join poses that are there or come with this call. The poses of a removed factor are
    /// linearised anew.
    ///
    /// # Errors
    /// See [`Error`]; [`Error::Unconstrained`] where a pose is held by nothing. The solver is then as
    /// it was before the call.
    pub fn update(
        &mut self,
        new_factors: &[Factor<G>],
        new_poses: &[(Key, G)],
        removed: &[FactorId],
    ) -> Result<UpdateReport, Error> {
        self.update_with(new_factors, new_poses, removed, &UpdateOptions::default())
    }

    /// As [`update`](Self::update), with options for this one call.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn update_with(
        &mut self,
        new_factors: &[Factor<G>],
        new_poses: &[(Key, G)],
        removed: &[FactorId],
        options: &UpdateOptions,
    ) -> Result<UpdateReport, Error> {
        update::run(self, new_factors, new_poses, removed, options)
    }

    /// How much an update does.
    pub fn config(&self) -> &Isam2Config {
        &self.config
    }

    /// Changes how much the next updates do.
    pub fn set_config(&mut self, config: Isam2Config) {
        self.config = config;
    }

    /// The best estimate of a pose.
    pub fn estimate(&self, key: Key) -> Option<G> {
        let i = self.variables.index_of(key)?;
        Some(self.variables.estimate(i as usize))
    }

    /// The best estimates of all poses, in the order in which they were added.
    pub fn estimates(&self) -> impl ExactSizeIterator<Item = (Key, G)> {
        (0..self.variables.len()).map(|i| (self.variables.keys[i], self.variables.estimate(i)))
    }

    /// Poses.
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// Whether it has no poses.
    pub fn is_empty(&self) -> bool {
        self.variables.len() == 0
    }

    /// The factor of that identifier.
    pub fn factor(&self, id: FactorId) -> Option<&Factor<G>> {
        self.factors.get(id).map(|bound| &bound.factor)
    }

    /// All factors.
    pub fn factors(&self) -> impl Iterator<Item = (FactorId, &Factor<G>)> {
        self.factors.iter().map(|(id, bound)| (id, &bound.factor))
    }

    /// The factors of a pose, in the order in which they were added.
    pub fn factors_of(&self, key: Key) -> impl Iterator<Item = (FactorId, &Factor<G>)> {
        let list = match self.variables.index_of(key) {
            Some(i) => &self.variables.factors[i as usize][..],
            None => &[],
        };
        let of = |&slot: &u32| (self.factors.id_at(slot), &self.factors.at(slot).factor);
        list.iter().map(of)
    }

    /// `r' * information * r` of a factor at the estimates: chi-square distributed with `G::DIM`
    /// degrees of freedom where the factor is right.
    pub fn squared_mahalanobis(&self, id: FactorId) -> Option<f64> {
        let bound = self.factors.get(id)?;
        let at = |i: u32| self.variables.estimate(i as usize);
        Some(
            bound
                .factor
                .squared_mahalanobis(&at(bound.from), &at(bound.to)),
        )
    }

    /// Half the sum of `kernel(r' * information * r)` over all factors, at the estimates.
    pub fn error(&self) -> f64 {
        let estimates: Vec<G> = self.estimates().map(|(_, pose)| pose).collect();
        let costs = self.factors.iter().map(|(_, bound)| {
            let at = |i: u32| &estimates[i as usize];
            bound.factor.cost(at(bound.from), at(bound.to))
        });
        costs.sum()
    }
}
