//! A pose graph as plain data: poses, factors, and which poses stay where they are.

use hashbrown::HashMap;

use crate::anchor::Anchors;
use crate::error::Error;
use crate::factor::{Factor, FactorId, Key};
use crate::group::Group;
use crate::slab::{Bound, MOST, Slab};

/// Poses by key, and the factors between them.
///
/// ```
/// use hachi_posegraph::{Factor, Graph, Se2, batch};
/// use nalgebra::Matrix3;
///
/// let mut graph = Graph::new();
/// graph.insert(0, Se2::new(0.0, 0.0, 0.0))?;
/// graph.insert(1, Se2::new(1.2, 0.0, 0.0))?;
/// graph.fix(0)?;
/// graph.add(Factor::between(0, 1, Se2::new(1.0, 0.0, 0.0), Matrix3::identity()))?;
/// let report = batch::optimize(&mut graph, &batch::Options::default())?;
/// assert!(report.converged && report.final_error < 1e-12);
/// # Ok::<(), hachi_posegraph::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Graph<G: Group> {
    pub(crate) keys: Vec<Key>,
    index: HashMap<Key, u32>,
    pub(crate) poses: Vec<G>,
    pub(crate) is_fixed: Vec<bool>,
    pub(crate) factors: Slab<Bound<G>>,
}

impl<G: Group> Default for Graph<G> {
    fn default() -> Self {
        Self::new()
    }
}

impl<G: Group> Graph<G> {
    /// A graph without poses.
    pub fn new() -> Self {
        Self {
            keys: Vec::new(),
            index: HashMap::new(),
            poses: Vec::new(),
            is_fixed: Vec::new(),
            factors: Slab::default(),
        }
    }

    /// Adds a pose.
    ///
    /// # Errors
    /// [`Error::DuplicateKey`], [`Error::PoseNotFinite`], [`Error::TooLarge`].
    pub fn insert(&mut self, key: Key, pose: G) -> Result<(), Error> {
        if self.index.contains_key(&key) {
            return Err(Error::DuplicateKey { key });
        }
        if !pose.is_finite() {
            return Err(Error::PoseNotFinite { key });
        }
        if self.keys.len() >= MOST {
            return Err(Error::TooLarge { limit: MOST });
        }
        self.index.insert(key, self.keys.len() as u32);
        self.keys.push(key);
        self.poses.push(pose);
        self.is_fixed.push(false);
        Ok(())
    }

    /// Moves a pose.
    ///
    /// # Errors
    /// [`Error::UnknownKey`], [`Error::PoseNotFinite`].
    pub fn set_pose(&mut self, key: Key, pose: G) -> Result<(), Error> {
        let i = self.index_of(key)?;
        if !pose.is_finite() {
            return Err(Error::PoseNotFinite { key });
        }
        self.poses[i as usize] = pose;
        Ok(())
    }

    /// Holds a pose where it is: solvers do not move it.
    ///
    /// # Errors
    /// [`Error::UnknownKey`].
    pub fn fix(&mut self, key: Key) -> Result<(), Error> {
        let i = self.index_of(key)?;
        self.is_fixed[i as usize] = true;
        Ok(())
    }

    /// Lets a pose go.
    ///
    /// # Errors
    /// [`Error::UnknownKey`].
    pub fn release(&mut self, key: Key) -> Result<(), Error> {
        let i = self.index_of(key)?;
        self.is_fixed[i as usize] = false;
        Ok(())
    }

    /// Whether a pose is held where it is.
    pub fn is_fixed(&self, key: Key) -> bool {
        self.index_of(key).is_ok_and(|i| self.is_fixed[i as usize])
    }

    /// Adds a factor between poses that are there.
    ///
    /// # Errors
    /// [`Error::UnknownKey`], or what is wrong with the factor.
    pub fn add(&mut self, factor: Factor<G>) -> Result<FactorId, Error> {
        let definite = factor.validate()?;
        let from = self.index_of(factor.from())?;
        let to = self.index_of(factor.to())?;
        self.factors.check_room(1)?;
        Ok(self.factors.insert(Bound {
            factor,
            from,
            to,
            definite,
        }))
    }

    /// Takes a factor out.
    ///
    /// # Errors
    /// [`Error::UnknownFactor`].
    pub fn remove(&mut self, id: FactorId) -> Result<Factor<G>, Error> {
        let bound = self.factors.remove(id);
        let bound = bound.ok_or(Error::UnknownFactor { id })?;
        Ok(bound.factor)
    }

    /// A pose.
    pub fn pose(&self, key: Key) -> Option<&G> {
        let i = self.index.get(&key)?;
        Some(&self.poses[*i as usize])
    }

    /// All poses, in the order in which they were added.
    pub fn poses(&self) -> impl ExactSizeIterator<Item = (Key, &G)> {
        self.keys.iter().copied().zip(&self.poses)
    }

    /// Poses.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// A factor.
    pub fn factor(&self, id: FactorId) -> Option<&Factor<G>> {
        self.factors.get(id).map(|bound| &bound.factor)
    }

    /// All factors.
    pub fn factors(&self) -> impl Iterator<Item = (FactorId, &Factor<G>)> {
        self.factors.iter().map(|(id, bound)| (id, &bound.factor))
    }

    /// Half the sum of `kernel(r' * information * r)` over all factors.
    pub fn error(&self) -> f64 {
        self.error_at(&self.poses)
    }

    /// The same with every kernel quadratic.
    pub fn squared_error(&self) -> f64 {
        let squares = self.factors.iter().map(|(_, bound)| {
            let at = |i: u32| &self.poses[i as usize];
            bound
                .factor
                .squared_mahalanobis(at(bound.from), at(bound.to))
        });
        0.5 * squares.sum::<f64>()
    }

    pub(crate) fn error_at(&self, poses: &[G]) -> f64 {
        let costs = self.factors.iter().map(|(_, bound)| {
            let at = |i: u32| &poses[i as usize];
            bound.factor.cost(at(bound.from), at(bound.to))
        });
        costs.sum()
    }

    fn index_of(&self, key: Key) -> Result<u32, Error> {
        let index = self.index.get(&key).copied();
        index.ok_or(Error::UnknownKey { key })
    }

    /// Which poses hang on a prior or a fixed pose, by any factors.
    fn anchors(&self) -> Anchors {
        let mut anchors = Anchors::default();
        anchors.resize(self.keys.len());
        for (_, bound) in self.factors.iter() {
            anchors.add(&Bound {
                definite: true,
                ..*bound
            });
        }
        let fixed = self
            .is_fixed
            .iter()
            .enumerate()
            .filter(|(_, fixed)| **fixed);
        fixed.for_each(|(i, _)| anchors.hold(i as u32));
        anchors
    }

    /// That every pose hangs on a prior or a fixed pose, by any factors.
    pub(crate) fn check_held(&self) -> Result<(), Error> {
        let anchors = self.anchors();
        let loose = (0..self.keys.len()).filter(|&i| !anchors.holds(i as u32));
        match loose.min_by_key(|&i| self.keys[i]) {
            Some(i) => Err(self.unconstrained(i)),
            None => Ok(()),
        }
    }

    /// Fixes the pose with the smallest key of every part in which nothing is held. How many parts
    /// that were, besides the one of the smallest key of all.
    pub fn hold_loose_parts(&mut self) -> usize {
        let mut anchors = self.anchors();
        let mut by_key: Vec<u32> = (0..self.keys.len() as u32).collect();
        by_key.sort_unstable_by_key(|&i| self.keys[i as usize]);
        let mut held = 0;
        for (place, &i) in by_key.iter().enumerate() {
            if !anchors.holds(i) {
                anchors.hold(i);
                self.is_fixed[i as usize] = true;
                held += usize::from(place > 0);
            }
        }
        held
    }

    pub(crate) fn unconstrained(&self, i: usize) -> Error {
        let touches = |bound: &&Bound<G>| bound.from as usize == i || bound.to as usize == i;
        let factors = self.factors.iter().map(|(_, bound)| bound);
        Error::Unconstrained {
            key: self.keys[i],
            last_factor: factors
                .filter(touches)
                .last()
                .map(|b| b.factor.description()),
        }
    }

    /// The error, or which factor's is not finite.
    pub(crate) fn finite_error(&self) -> Result<f64, Error> {
        let error = self.error();
        if error.is_finite() {
            return Ok(error);
        }
        let at = |i: u32| &self.poses[i as usize];
        let mut bounds = self.factors.iter().map(|(_, bound)| bound);
        let first = bounds.find(|b| !b.factor.cost(at(b.from), at(b.to)).is_finite());
        let factor = first.or_else(|| self.factors.iter().map(|(_, b)| b).next());
        match factor {
            Some(bound) => Err(Error::Overflow {
                factor: bound.factor.description(),
            }),
            None => Ok(0.0),
        }
    }
}
