//! What is known of each pose, by index: indices are given in the order of adding and stay.

use hashbrown::HashMap;

use crate::factor::Key;
use crate::group::{Dense, Group};
use crate::symbolic::NONE;

#[derive(Debug, Clone)]
pub(crate) struct Variables<G: Group> {
    pub keys: Vec<Key>,
    index: HashMap<Key, u32>,
    /// Where factors are linearised.
    pub points: Vec<G>,
    /// The step from there to the estimate.
    pub steps: Vec<G::Tangent>,
    /// The step when it was passed on last.
    pub passed_on: Vec<G::Tangent>,
    /// In which pass that was.
    pub passed_in: Vec<u32>,
    /// The largest diagonal of a factor's `J' W J` so far: what rounding is measured by.
    pub scale: Vec<G::Tangent>,
    /// The clique that eliminates it.
    pub clique: Vec<u32>,
    /// Slots of its factors, in the order of adding.
    pub factors: Vec<Vec<u32>>,
    /// Whether it stands in the list of poses to linearise anew.
    pub is_pending: Vec<bool>,
}

impl<G: Group> Default for Variables<G> {
    fn default() -> Self {
        Self {
            keys: Vec::new(),
            index: HashMap::new(),
            points: Vec::new(),
            steps: Vec::new(),
            passed_on: Vec::new(),
            passed_in: Vec::new(),
            scale: Vec::new(),
            clique: Vec::new(),
            factors: Vec::new(),
            is_pending: Vec::new(),
        }
    }
}

impl<G: Group> Variables<G> {
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    pub fn index_of(&self, key: Key) -> Option<u32> {
        self.index.get(&key).copied()
    }

    pub fn push(&mut self, key: Key, pose: G) {
        self.index.insert(key, self.keys.len() as u32);
        self.keys.push(key);
        self.points.push(pose);
        self.steps.push(G::Tangent::zeros());
        self.passed_on.push(G::Tangent::zeros());
        self.passed_in.push(0);
        self.scale.push(G::Tangent::zeros());
        self.clique.push(NONE);
        self.factors.push(Vec::new());
        self.is_pending.push(false);
    }

    /// Forgets the poses added last.
    pub fn truncate(&mut self, len: usize) {
        for key in self.keys.drain(len..) {
            self.index.remove(&key);
        }
        self.points.truncate(len);
        self.steps.truncate(len);
        self.passed_on.truncate(len);
        self.passed_in.truncate(len);
        self.scale.truncate(len);
        self.clique.truncate(len);
        self.factors.truncate(len);
        self.is_pending.truncate(len);
    }

    pub fn estimate(&self, i: usize) -> G {
        self.points[i].retract(&self.steps[i])
    }
}

/// The largest number of a vector, without sign; NaN counts as nothing.
#[inline(always)]
pub(crate) fn largest<D: Dense>(vector: &D) -> f64 {
    vector
        .numbers()
        .iter()
        .fold(0.0, |m: f64, v| m.max(v.abs()))
}
