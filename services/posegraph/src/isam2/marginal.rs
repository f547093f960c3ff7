//! Covariances from the tree: two triangular solves along paths to the root, nothing dense.
//!
//! In: one pose, or two. Out: their covariance at the linearisation points, in the tangent space of
//! the pose (right-hand steps). Work and memory grow with the depth of the poses in the tree.

use hashbrown::HashMap;

use super::Isam2;
use crate::dense;
use crate::error::Error;
use crate::factor::Key;
use crate::group::{Dense, Group, Square};
use crate::symbolic::NONE;

impl<G: Group> Isam2<G> {
    /// The covariance of a pose: of the step `delta` in `pose * Exp(delta)`, given all factors.
    ///
    /// # Errors
    /// [`Error::UnknownKey`].
    pub fn marginal_covariance(&self, key: Key) -> Result<G::Matrix, Error> {
        let pose = self.index(key)?;
        let columns = self.inverse_columns(pose);
        Ok(symmetric::<G>(&self.rows_of(&columns, pose)))
    }

    /// The covariance of where `to` is, seen from `from`: of the step of `from^-1 * to`.
    ///
    /// # Errors
    /// [`Error::UnknownKey`].
    pub fn relative_covariance(&self, from: Key, to: Key) -> Result<G::Matrix, Error> {
        let (a, b) = (self.index(from)?, self.index(to)?);
        if a == b {
            return Ok(G::Matrix::zeros());
        }
        let of_a = self.inverse_columns(a);
        let of_b = self.inverse_columns(b);
        let aa = self.rows_of(&of_a, a);
        let bb = self.rows_of(&of_b, b);
        let ab = self.rows_of(&of_b, a);
        let points = &self.variables.points;
        let seen = points[a as usize].between(&points[b as usize]);
        // A step of `from` is the step -Ad(seen^-1) of `seen`.
        let carried = -seen.inverse().adjoint();
        let cross = carried * ab;
        let mut covariance = carried * aa * carried.transposed();
        let sums = covariance.numbers_mut().iter_mut();
        let transposed = cross.transposed();
        for (k, sum) in sums.enumerate() {
            *sum += cross.numbers()[k] + transposed.numbers()[k] + bb.numbers()[k];
        }
        Ok(symmetric::<G>(&covariance))
    }

    fn index(&self, key: Key) -> Result<u32, Error> {
        self.variables
            .index_of(key)
            .ok_or(Error::UnknownKey { key })
    }
}

/// Columns of the inverse that belong to one pose, half done: `L^-1 e` at the poses between its
/// clique and the root, where alone it is not zero.
struct HalfSolved<G: Group> {
    at: HashMap<u32, G::Matrix>,
}

impl<G: Group> Isam2<G> {
    fn inverse_columns(&self, pose: u32) -> HalfSolved<G> {
        let d = G::DIM;
        let mut at: HashMap<u32, G::Matrix> = HashMap::new();
        at.insert(pose, G::Matrix::identity());
        let mut x = Vec::new();
        let mut slot = self.variables.clique[pose as usize];
        while slot != NONE {
            let clique = &self.tree.cliques[slot as usize];
            let pivots = clique.frontals as usize * d;
            let columns = clique.variables.len() * d;
            for c in 0..d {
                x.clear();
                for pose in &clique.variables {
                    let block = at.entry(*pose).or_insert_with(G::Matrix::zeros);
                    x.extend_from_slice(&block.numbers()[c * d..(c + 1) * d]);
                }
                dense::forward_substitute(&clique.numbers, columns, pivots, &mut x);
                for (k, pose) in clique.variables.iter().enumerate() {
                    if let Some(block) = at.get_mut(pose) {
                        let part = &x[k * d..(k + 1) * d];
                        block.numbers_mut()[c * d..(c + 1) * d].copy_from_slice(part);
                    }
                }
            }
            slot = clique.parent;
        }
        HalfSolved { at }
    }

    /// The rows of one pose in the columns of another.
    fn rows_of(&self, columns: &HalfSolved<G>, pose: u32) -> G::Matrix {
        let d = G::DIM;
        let mut path = Vec::new();
        let mut slot = self.variables.clique[pose as usize];
        while slot != NONE {
            path.push(slot);
            slot = self.tree.cliques[slot as usize].parent;
        }
        let mut solved: HashMap<u32, G::Matrix> = HashMap::new();
        let mut x = Vec::new();
        for &slot in path.iter().rev() {
            let clique = &self.tree.cliques[slot as usize];
            let pivots = clique.frontals as usize * d;
            let size = clique.variables.len() * d;
            for c in 0..d {
                x.clear();
                for (k, pose) in clique.variables.iter().enumerate() {
                    let known = if k < clique.frontals as usize {
                        &columns.at
                    } else {
                        &solved
                    };
                    match known.get(pose) {
                        Some(block) => x.extend_from_slice(&block.numbers()[c * d..(c + 1) * d]),
                        None => x.resize(x.len() + d, 0.0),
                    }
                }
                dense::back_substitute_in_place(&clique.numbers, size, pivots, &mut x);
                for (k, pose) in clique.frontal().iter().enumerate() {
                    let block = solved.entry(*pose).or_insert_with(G::Matrix::zeros);
                    let part = &x[k * d..(k + 1) * d];
                    block.numbers_mut()[c * d..(c + 1) * d].copy_from_slice(part);
                }
            }
        }
        solved.get(&pose).copied().unwrap_or_else(G::Matrix::zeros)
    }
}

/// Without the last digits in which a matrix and its transpose differ.
fn symmetric<G: Group>(matrix: &G::Matrix) -> G::Matrix {
    let mut result = *matrix;
    let transposed = matrix.transposed();
    let both = result.numbers_mut().iter_mut().zip(transposed.numbers());
    both.for_each(|(a, b)| *a = 0.5 * (*a + b));
    result
}
