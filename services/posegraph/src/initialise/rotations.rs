//! Rotations first, then translations: two linear systems, no initial poses needed.
//!
//! Chordal relaxation: rotation matrices that agree best with the measured ones, entry by entry,
//! without asking them to be rotations, then the nearest rotations (Martinec and Pajdla, CVPR 2007;
//! Carlone et al., *Initialization techniques for 3D SLAM*, ICRA 2015). With rotations known the
//! translations are a linear problem.

use super::Rigid;
use crate::error::Error;
use crate::factor::FactorKind;
use crate::graph::Graph;
use crate::group::Dense;
use crate::sparse::{BlockSystem, SparseError};
use crate::symbolic::NONE;

/// Finds rotations, then translations. Kernels are not looked at.
///
/// # Errors
/// [`Error::Unconstrained`] if a pose hangs on no prior and no fixed pose, or if factors that know no
/// rotation or no translation leave one open.
pub fn rotations_first<G: Rigid>(graph: &mut Graph<G>) -> Result<(), Error> {
    graph.check_held()?;
    let mut block = vec![NONE; graph.poses.len()];
    let mut pose = Vec::new();
    for (i, &fixed) in graph.is_fixed.iter().enumerate() {
        if !fixed {
            block[i] = pose.len() as u32;
            pose.push(i as u32);
        }
    }
    if pose.is_empty() {
        return Ok(());
    }
    let mut relaxation = Relaxation::<G>::new(graph, block, pose)?;
    let rotations = relaxation.rotations(graph)?;
    relaxation.translations(graph, &rotations)
}

struct Relaxation<G: Rigid> {
    system: BlockSystem,
    places: Vec<crate::sparse::Place>,
    block: Vec<u32>,
    pose: Vec<u32>,
    right: Vec<f64>,
    group: core::marker::PhantomData<G>,
}

impl<G: Rigid> Relaxation<G> {
    fn new(graph: &Graph<G>, block: Vec<u32>, pose: Vec<u32>) -> Result<Self, Error> {
        let bounds = graph.factors.iter().map(|(_, bound)| bound);
        let pairs: Vec<_> = bounds
            .filter(|bound| bound.from != bound.to)
            .map(|bound| (block[bound.from as usize], block[bound.to as usize]))
            .filter(|&(a, b)| a != NONE && b != NONE)
            .collect();
        let (system, places) = BlockSystem::new(pose.len(), G::SPACE, &pairs)
            .map_err(|error| graph.sparse_error(error, &pose))?;
        Ok(Self {
            system,
            places,
            block,
            pose,
            right: Vec::new(),
            group: core::marker::PhantomData,
        })
    }

    fn add(&mut self, block: u32, column: usize, numbers: &[f64], sign: f64) {
        let rows = self.pose.len() * G::SPACE;
        let begin = column * rows + self.system.row(block);
        let target = &mut self.right[begin..begin + G::SPACE];
        for (t, v) in target.iter_mut().zip(numbers) {
            *t += sign * v;
        }
    }

    fn solve(&mut self, graph: &Graph<G>) -> Result<(), Error> {
        let outcome = self.system.factorize();
        outcome.map_err(|error| graph.sparse_error(error, &self.pose))?;
        self.system.solve(&mut self.right);
        Ok(())
    }

    /// The nearest rotation of each pose. Unknown are the rows of rotation matrices: with
    /// `R_j = R_i R_ij` each row `x` of one follows from that of the other, `x_j = R_ij' x_i`.
    fn rotations(&mut self, graph: &Graph<G>) -> Result<Vec<G>, Error> {
        let s = G::SPACE;
        let rows = self.pose.len() * s;
        self.system.clear();
        self.right.clear();
        self.right.resize(rows * s, 0.0);
        let mut diagonal = [0.0; 9];
        let mut off = [0.0; 9];
        let mut pair = 0;
        for (_, bound) in graph.factors.iter() {
            let weight = G::rotation_weight(bound.factor.information());
            let measured = bound.factor.measured().rotation();
            diagonal[..s * s].fill(0.0);
            (0..s).for_each(|k| diagonal[k * (s + 1)] = weight);
            let (from, to) = (
                self.block[bound.from as usize],
                self.block[bound.to as usize],
            );
            if bound.factor.kind() == FactorKind::Prior {
                if to != NONE {
                    self.system.add_diagonal(to, &diagonal, s);
                    for k in 0..s {
                        self.add(to, k, &row(&measured, s, k), weight);
                    }
                }
                continue;
            }
            for block in [from, to] {
                if block != NONE {
                    self.system.add_diagonal(block, &diagonal, s);
                }
            }
            if from != NONE && to != NONE {
                off.iter_mut()
                    .zip(&measured)
                    .for_each(|(o, m)| *o = -weight * m);
                self.system.add_pair(self.places[pair], &off, s);
                pair += 1;
            } else if to != NONE {
                let known = graph.poses[bound.from as usize].rotation();
                for k in 0..s {
                    let x = row(&known, s, k);
                    let turned: [f64; 3] = core::array::from_fn(|r| match r < s {
                        true => (0..s).map(|c| measured[r * s + c] * x[c]).sum(),
                        false => 0.0,
                    });
                    self.add(to, k, &turned, weight);
                }
            } else if from != NONE {
                let known = graph.poses[bound.to as usize].rotation();
                for k in 0..s {
                    let x = row(&known, s, k);
                    let turned: [f64; 3] = core::array::from_fn(|r| match r < s {
                        true => (0..s).map(|c| measured[c * s + r] * x[c]).sum(),
                        false => 0.0,
                    });
                    self.add(from, k, &turned, weight);
                }
            }
        }
        self.solve(graph)?;
        let mut poses = graph.poses.clone();
        for (block, &i) in self.pose.iter().enumerate() {
            let begin = self.system.row(block as u32);
            let mut matrix = [0.0; 9];
            for k in 0..s {
                for c in 0..s {
                    matrix[c * s + k] = self.right[k * rows + begin + c];
                }
            }
            poses[i as usize] = G::nearest(&[0.0; 3], &matrix);
        }
        Ok(poses)
    }

    /// Translations for given rotations: `t_j - t_i = R_i t_ij`, weighted as the factor knows it.
    fn translations(&mut self, graph: &mut Graph<G>, rotations: &[G]) -> Result<(), Error> {
        let s = G::SPACE;
        self.system.clear();
        self.right.clear();
        self.right.resize(self.pose.len() * s, 0.0);
        let mut pair = 0;
        for (_, bound) in graph.factors.iter() {
            let (from, to) = (
                self.block[bound.from as usize],
                self.block[bound.to as usize],
            );
            let prior = bound.factor.kind() == FactorKind::Prior;
            // The information is in the frame of the measured pose, seen from the first one's.
            let frame = match prior {
                true => *bound.factor.measured(),
                false => rotations[bound.from as usize].compose(bound.factor.measured()),
            };
            let weight = turned_information::<G>(&frame, bound.factor.information());
            let measured = match prior {
                true => bound.factor.measured().translation(),
                false => {
                    let turn = rotations[bound.from as usize].rotation();
                    product(&turn, &bound.factor.measured().translation(), s)
                }
            };
            let mut shift = product(&weight, &measured, s);
            if to != NONE {
                self.system.add_diagonal(to, &weight, s);
                self.add(to, 0, &shift, 1.0);
            }
            if prior {
                continue;
            }
            if from != NONE {
                self.system.add_diagonal(from, &weight, s);
                self.add(from, 0, &shift, -1.0);
            }
            if from != NONE && to != NONE {
                let off = weight.map(|w| -w);
                self.system.add_pair(self.places[pair], &off, s);
                pair += 1;
            } else {
                let (known, open) = match to {
                    NONE => (bound.to, from),
                    open => (bound.from, open),
                };
                if open != NONE {
                    let at = graph.poses[known as usize].translation();
                    shift = product(&weight, &at, s);
                    self.add(open, 0, &shift, 1.0);
                }
            }
        }
        self.solve(graph)?;
        for (block, &i) in self.pose.iter().enumerate() {
            let begin = self.system.row(block as u32);
            let mut translation = [0.0; 3];
            translation[..s].copy_from_slice(&self.right[begin..begin + s]);
            graph.poses[i as usize] = G::nearest(&translation, &rotations[i as usize].rotation());
        }
        Ok(())
    }
}

fn row(matrix: &[f64; 9], s: usize, k: usize) -> [f64; 3] {
    core::array::from_fn(|c| if c < s { matrix[c * s + k] } else { 0.0 })
}

fn product(matrix: &[f64; 9], vector: &[f64; 3], s: usize) -> [f64; 3] {
    core::array::from_fn(|r| match r < s {
        true => (0..s).map(|c| matrix[c * s + r] * vector[c]).sum(),
        false => 0.0,
    })
}

/// `R W R'` of the translation's block of an information matrix.
fn turned_information<G: Rigid>(frame: &G, information: &G::Matrix) -> [f64; 9] {
    let s = G::SPACE;
    let turn = frame.rotation();
    let w = |r: usize, c: usize| information.numbers()[c * G::DIM + r];
    let mut half = [0.0; 9];
    let mut whole = [0.0; 9];
    for c in 0..s {
        for r in 0..s {
            half[c * s + r] = (0..s).map(|k| turn[k * s + r] * w(k, c)).sum();
        }
    }
    for c in 0..s {
        for r in 0..s {
            whole[c * s + r] = (0..s).map(|k| half[k * s + r] * turn[k * s + c]).sum();
        }
    }
    whole
}

impl<G: Rigid> Graph<G> {
    fn sparse_error(&self, error: SparseError, pose: &[u32]) -> Error {
        match error {
            SparseError::NotPositive { block } => self.unconstrained(pose[block] as usize),
            SparseError::TooLarge => Error::TooLarge {
                limit: crate::slab::MOST,
            },
        }
    }
}
