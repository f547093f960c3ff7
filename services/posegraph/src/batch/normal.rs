//! The normal equations of a graph: linearise, damp, solve, apply.

use core::marker::PhantomData;

use crate::error::Error;
use crate::factor::FactorKind;
use crate::graph::Graph;
use crate::group::{Dense, Group};
use crate::sparse::{BlockSystem, Place, SparseError};
use crate::symbolic::NONE;

pub(super) struct NormalEquations<G: Group> {
    system: BlockSystem,
    /// Each pose's block, or `NONE` where it is fixed.
    block: Vec<u32>,
    /// The pose of each block.
    pose: Vec<u32>,
    /// For each factor in the order of the graph, where both its poses move.
    places: Vec<Option<Place>>,
    gradient: Vec<f64>,
    undamped: Vec<f64>,
    step: Vec<f64>,
    group: PhantomData<G>,
}

impl<G: Group> NormalEquations<G> {
    /// Analyses the pattern of a graph.
    pub fn new(graph: &Graph<G>) -> Result<Self, Error> {
        let mut block = vec![NONE; graph.poses.len()];
        let mut pose = Vec::with_capacity(graph.poses.len());
        for (i, &fixed) in graph.is_fixed.iter().enumerate() {
            if !fixed {
                block[i] = pose.len() as u32;
                pose.push(i as u32);
            }
        }
        let mut pairs = Vec::new();
        let mut has_pair = Vec::new();
        for (_, bound) in graph.factors.iter() {
            let pair = (block[bound.from as usize], block[bound.to as usize]);
            let both = bound.from != bound.to && pair.0 != NONE && pair.1 != NONE;
            has_pair.push(both);
            if both {
                pairs.push(pair);
            }
        }
        let (system, found) = BlockSystem::new(pose.len(), G::DIM, &pairs).map_err(too_large)?;
        let mut found = found.into_iter();
        let places = has_pair
            .iter()
            .map(|&both| both.then(|| found.next()).flatten());
        let numbers = pose.len() * G::DIM;
        Ok(Self {
            places: places.collect(),
            system,
            block,
            pose,
            gradient: vec![0.0; numbers],
            undamped: Vec::with_capacity(numbers),
            step: Vec::with_capacity(numbers),
            group: PhantomData,
        })
    }

    /// Whether nothing can move.
    pub fn is_empty(&self) -> bool {
        self.pose.is_empty()
    }

    /// Sums `J' W J` and `J' W r` at these poses.
    pub fn linearize(&mut self, graph: &Graph<G>, poses: &[G]) {
        self.system.clear();
        self.gradient.fill(0.0);
        for (k, (_, bound)) in graph.factors.iter().enumerate() {
            let (from, to) = (bound.from as usize, bound.to as usize);
            let blocks = (self.block[from], self.block[to]);
            let linear = bound.factor.linearize(&poses[from], &poses[to]);
            if blocks.1 != NONE {
                self.add(blocks.1, &linear.to_to, &linear.to_gradient);
            }
            if blocks.0 != NONE && bound.factor.kind() != FactorKind::Prior {
                self.add(blocks.0, &linear.from_from, &linear.from_gradient);
            }
            if let Some(place) = self.places[k] {
                self.system
                    .add_pair(place, linear.from_to.numbers(), G::DIM);
            }
        }
        self.undamped.clear();
        self.undamped.extend(self.system.diagonal_mut().map(|v| *v));
    }

    #[inline(always)]
    fn add(&mut self, block: u32, matrix: &G::Matrix, gradient: &G::Tangent) {
        self.system.add_diagonal(block, matrix.numbers(), G::DIM);
        let row = self.system.row(block);
        let target = &mut self.gradient[row..row + G::DIM];
        for (t, g) in target.iter_mut().zip(gradient.numbers()) {
            *t += g;
        }
    }

    /// Solves with the diagonal raised by that share of itself. By how much the linearised error
    /// falls.
    pub fn solve(&mut self, graph: &Graph<G>, damping: f64) -> Result<f64, Error> {
        let diagonal = self.system.diagonal_mut().zip(&self.undamped);
        diagonal.for_each(|(target, v)| *target = v * (1.0 + damping));
        self.system.factorize().map_err(|error| match error {
            SparseError::TooLarge => too_large(error),
            SparseError::NotPositive { block } => graph.unconstrained(self.pose[block] as usize),
        })?;
        self.step.clear();
        self.step.extend(self.gradient.iter().map(|g| -g));
        self.system.solve(&mut self.step);
        // With H d + damping D d = -g: g' d + d' H d / 2 = (g' d - damping d' D d) / 2.
        let sums = self.step.iter().zip(&self.gradient).zip(&self.undamped);
        let twice: f64 = sums
            .map(|((d, g), diagonal)| d * (damping * diagonal * d - g))
            .sum();
        Ok(0.5 * twice)
    }

    /// Moves poses by the step.
    pub fn apply(&self, poses: &mut [G]) {
        for (block, &pose) in self.pose.iter().enumerate() {
            let row = self.system.row(block as u32);
            let mut delta = G::Tangent::zeros();
            delta
                .numbers_mut()
                .copy_from_slice(&self.step[row..row + G::DIM]);
            let pose = &mut poses[pose as usize];
            *pose = pose.retract(&delta);
        }
    }
}

fn too_large(_: SparseError) -> Error {
    Error::TooLarge {
        limit: crate::slab::MOST,
    }
}
