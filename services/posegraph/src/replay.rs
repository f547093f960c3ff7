//! A finished graph as a robot would have met it: pose by pose.
//!
//! In: a [`Graph`], and an [`Isam2`] that is fed. Out: what each update adds. Poses come in the order
//! of their keys, each with its factors to poses that came before; a pose that no factor ties to
//! those waits until one does.

use std::collections::VecDeque;

use crate::factor::{Factor, FactorKind, Key};
use crate::graph::Graph;
use crate::group::{Dense, Group, Square};
use crate::isam2::Isam2;

/// Information of the prior that stands for a fixed pose: a micrometre and microradian would make
/// rounding worse, a millimetre is well below what any edge knows.
const FIXED_INFORMATION: f64 = 1e6;

/// What one update adds.
#[derive(Debug, Clone, PartialEq)]
pub struct Step<G: Group> {
    /// The new pose's key.
    pub key: Key,
    /// Where it is, as far as is known before the update: composed from the estimate of the pose
    /// before and the factor to it.
    pub pose: G,
    /// Its factors.
    pub factors: Vec<Factor<G>>,
}

/// The steps of a graph.
#[derive(Debug)]
pub struct Replay<'a, G: Group> {
    graph: &'a Graph<G>,
    /// Poses by key.
    order: Vec<u32>,
    next: usize,
    /// Factors of each pose, one list after another.
    begin: Vec<usize>,
    slots: Vec<u32>,
    is_added: Vec<bool>,
    /// Poses that came too early, and whose neighbour has come since.
    waiting: VecDeque<u32>,
}

impl<'a, G: Group> Replay<'a, G> {
    /// From the beginning. Fixed poses become poses with a tight prior.
    pub fn new(graph: &'a Graph<G>) -> Self {
        let poses = graph.poses.len();
        let mut order: Vec<u32> = (0..poses as u32).collect();
        order.sort_unstable_by_key(|&i| graph.keys[i as usize]);
        let mut begin = vec![0; poses + 1];
        let ends = |from: u32, to: u32| [Some(from), (from != to).then_some(to)];
        let all = || graph.factors.iter().map(|(id, b)| (id.slot, b.from, b.to));
        for (_, from, to) in all() {
            for end in ends(from, to).into_iter().flatten() {
                begin[end as usize + 1] += 1;
            }
        }
        for i in 0..poses {
            begin[i + 1] += begin[i];
        }
        let mut free = begin.clone();
        let mut slots = vec![0; begin[poses]];
        for (slot, from, to) in all() {
            for end in ends(from, to).into_iter().flatten() {
                slots[free[end as usize]] = slot;
                free[end as usize] += 1;
            }
        }
        Self {
            graph,
            order,
            next: 0,
            begin,
            slots,
            is_added: vec![false; poses],
            waiting: VecDeque::new(),
        }
    }

    /// What to add next; `None` at the end, or when no factor ties the poses that are left.
    pub fn next_step(&mut self, isam: &Isam2<G>) -> Option<Step<G>> {
        while let Some(i) = self.waiting.pop_front().or_else(|| self.pop_in_order()) {
            if self.is_added[i as usize] {
                continue;
            }
            if let Some(step) = self.step(i, isam) {
                self.is_added[i as usize] = true;
                self.wake_neighbours(i);
                return Some(step);
            }
        }
        None
    }

    fn pop_in_order(&mut self) -> Option<u32> {
        let i = self.order.get(self.next).copied()?;
        self.next += 1;
        Some(i)
    }

    fn factors_of(&self, i: u32) -> &[u32] {
        &self.slots[self.begin[i as usize]..self.begin[i as usize + 1]]
    }

    fn step(&self, i: u32, isam: &Isam2<G>) -> Option<Step<G>> {
        let key = self.graph.keys[i as usize];
        let given = self.graph.poses[i as usize];
        let mut factors = Vec::new();
        let mut nearest: Option<(Key, G)> = None;
        for &slot in self.factors_of(i) {
            let bound = self.graph.factors.at(slot);
            let factor = &bound.factor;
            if factor.kind() == FactorKind::Prior {
                factors.push(*factor);
                nearest.get_or_insert((u64::MAX, given));
                continue;
            }
            let other = bound.from ^ bound.to ^ i;
            if !self.is_added[other as usize] {
                continue;
            }
            factors.push(*factor);
            // The pose with the nearest key is the one the robot came from.
            let distance = self.graph.keys[other as usize].abs_diff(key);
            if nearest.is_none_or(|(least, _)| distance < least) {
                let before = isam.estimate(self.graph.keys[other as usize])?;
                let pose = if bound.from == other {
                    before.compose(factor.measured())
                } else {
                    before.compose(&factor.measured().inverse())
                };
                nearest = Some((distance, pose));
            }
        }
        if self.graph.is_fixed[i as usize] {
            let mut information = G::Matrix::identity();
            let numbers = information.numbers_mut().iter_mut();
            numbers.for_each(|v| *v *= FIXED_INFORMATION);
            factors.push(Factor::prior(key, given, information));
            nearest = Some((0, given));
        }
        let (_, pose) = nearest?;
        Some(Step { key, pose, factors })
    }

    /// Neighbours that were passed over may be tied now.
    fn wake_neighbours(&mut self, i: u32) {
        let last = match self.order[..self.next].last() {
            Some(&last) => self.graph.keys[last as usize],
            None => return,
        };
        for at in self.begin[i as usize]..self.begin[i as usize + 1] {
            let bound = self.graph.factors.at(self.slots[at]);
            let other = bound.from ^ bound.to ^ i;
            let passed = self.graph.keys[other as usize] <= last;
            if bound.from != bound.to && passed && !self.is_added[other as usize] {
                self.waiting.push_back(other);
            }
        }
    }
}
