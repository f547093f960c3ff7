//! Symmetric positive definite systems in blocks, solved by faer's sparse Cholesky.
//!
//! In: which blocks are not zero, then their numbers, again and again. Out: solutions. The pattern is
//! ordered (approximate minimum degree on blocks, then post-ordered so that columns of one supernode
//! are neighbours) and analysed once; numbers go straight into their place in the ordered matrix.
//! One thread throughout: sums are always taken in the same order.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

use crate::ordering::{Cliques, MinimumDegree};
use crate::symbolic::Plan;

/// Why a system can't be factorised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SparseError {
    /// The pivot of this block is not positive.
    NotPositive { block: usize },
    /// More entries than can be counted or held.
    TooLarge,
}

/// Where a pair of blocks goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    column: u32,
    slot: u32,
    /// The first block of the pair comes later in the order.
    is_turned: bool,
}

/// The upper triangle of a symmetric matrix of blocks.
pub(crate) struct BlockSystem {
    dim: usize,
    /// Each block's place in the order.
    position: Vec<u32>,
    order: Vec<u32>,
    /// Off-diagonal blocks above each diagonal one.
    off_begin: Vec<usize>,
    column_begin: Vec<usize>,
    row_of: Vec<usize>,
    pub values: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl BlockSystem {
    /// Analyses the pattern of `blocks` diagonal blocks of `dim` rows and these pairs, which may
    /// come more than once. The place of each pair, in their order.
    pub fn new(
        blocks: usize,
        dim: usize,
        pairs: &[(u32, u32)],
    ) -> Result<(Self, Vec<Place>), SparseError> {
        let order = ordered(blocks, pairs);
        let mut position = vec![0; blocks];
        for (place, &block) in order.iter().enumerate() {
            position[block as usize] = place as u32;
        }
        let mut entries: Vec<(u32, u32)> = pairs
            .iter()
            .map(|&(a, b)| {
                let (a, b) = (position[a as usize], position[b as usize]);
                (a.max(b), a.min(b))
            })
            .collect();
        entries.sort_unstable();
        entries.dedup();
        let mut off_begin = vec![0; blocks + 1];
        for &(column, _) in &entries {
            off_begin[column as usize + 1] += 1;
        }
        for j in 0..blocks {
            off_begin[j + 1] += off_begin[j];
        }
        let places = pairs.iter().map(|&(a, b)| {
            let (a, b) = (position[a as usize], position[b as usize]);
            let (column, row) = (a.max(b), a.min(b));
            let begin = off_begin[column as usize];
            let found = entries[begin..off_begin[column as usize + 1]]
                .binary_search(&(column, row))
                .expect("every pair is an entry");
            Place {
                column,
                slot: found as u32,
                is_turned: a > b,
            }
        });
        let places = places.collect();
        let (column_begin, row_of) = expand(blocks, dim, &off_begin, &entries);
        let scalars = blocks * dim;
        let pattern =
            SymbolicSparseColMatRef::new_checked(scalars, scalars, &column_begin, None, &row_of);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Upper,
            SymmetricOrdering::Identity,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| SparseError::TooLarge)?;
        let request = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default())
            .or(symbolic.solve_in_place_scratch::<f64>(MOST_RIGHT_SIDES, Par::Seq));
        let memory = MemBuffer::try_new(request).map_err(|_| SparseError::TooLarge)?;
        let system = Self {
            dim,
            position,
            order,
            off_begin,
            values: vec![0.0; row_of.len()],
            column_begin,
            row_of,
            factor: vec![0.0; symbolic.len_val()],
            symbolic,
            memory,
        };
        Ok((system, places))
    }

    /// Sets all numbers to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// The first row of a block in right-hand sides and solutions.
    #[inline(always)]
    pub fn row(&self, block: u32) -> usize {
        self.position[block as usize] as usize * self.dim
    }

    /// Adds a symmetric block, column by column, to the diagonal.
    #[inline(always)]
    pub fn add_diagonal(&mut self, block: u32, numbers: &[f64], dim: usize) {
        let j = self.position[block as usize] as usize;
        let off = (self.off_begin[j + 1] - self.off_begin[j]) * dim;
        for c in 0..dim {
            let begin = self.column_begin[j * dim + c] + off;
            let target = &mut self.values[begin..=begin + c];
            for (t, v) in target.iter_mut().zip(&numbers[c * dim..]) {
                *t += v;
            }
        }
    }

    /// Adds the block of a pair: rows of its first, columns of its second.
    #[inline(always)]
    pub fn add_pair(&mut self, place: Place, numbers: &[f64], dim: usize) {
        for c in 0..dim {
            let begin = self.column_begin[place.column as usize * dim + c];
            let begin = begin + place.slot as usize * dim;
            let target = &mut self.values[begin..begin + dim];
            for (r, t) in target.iter_mut().enumerate() {
                *t += if place.is_turned {
                    numbers[r * dim + c]
                } else {
                    numbers[c * dim + r]
                };
            }
        }
    }

    /// Entries of the diagonal, in the order of rows.
    pub fn diagonal_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let mut rest = &mut self.values[..];
        let mut passed = 0;
        self.column_begin[1..].iter().map(move |&end| {
            // The last entry of each column of an upper triangle.
            let (head, tail) = core::mem::take(&mut rest).split_at_mut(end - passed);
            passed = end;
            rest = tail;
            head.last_mut().expect("every column has its diagonal")
        })
    }

    /// Factorises the numbers as they are.
    pub fn factorize(&mut self) -> Result<(), SparseError> {
        let scalars = self.column_begin.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(
            scalars,
            scalars,
            &self.column_begin,
            None,
            &self.row_of,
        );
        let matrix = SparseColMatRef::new(pattern, &self.values[..]);
        let outcome = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            matrix,
            Side::Upper,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Spec::default(),
        );
        match outcome {
            Ok(_) => Ok(()),
            Err(LltError::NonPositivePivot { index }) => Err(SparseError::NotPositive {
                block: self.order[index / self.dim] as usize,
            }),
        }
    }

    /// Solves for up to three right-hand sides, one after another in `right`, in place.
    pub fn solve(&mut self, right: &mut [f64]) {
        let scalars = self.column_begin.len() - 1;
        let columns = right.len().checked_div(scalars).unwrap_or(0);
        debug_assert!(columns <= MOST_RIGHT_SIDES);
        if columns == 0 {
            return;
        }
        LltRef::new(&self.symbolic, &self.factor[..]).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, scalars, columns),
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}

const MOST_RIGHT_SIDES: usize = 3;

/// Minimum degree, then post-order of the cliques.
fn ordered(blocks: usize, pairs: &[(u32, u32)]) -> Vec<u32> {
    let mut cliques = Cliques::default();
    let mut unique: Vec<_> = pairs.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
    unique.sort_unstable();
    unique.dedup();
    for (a, b) in unique {
        cliques.push([a, b]);
    }
    let mut order = Vec::new();
    MinimumDegree::default().order(blocks, &cliques, |_| false, &mut order);
    let mut plan = Plan::default();
    plan.make(&order, &cliques);
    plan.post_order()
}

/// Columns and rows of scalars: in each column first the blocks above, then the upper part of the
/// diagonal block.
fn expand(
    blocks: usize,
    dim: usize,
    off_begin: &[usize],
    entries: &[(u32, u32)],
) -> (Vec<usize>, Vec<usize>) {
    let diagonal = dim * (dim + 1) / 2;
    let mut begins = Vec::with_capacity(blocks * dim + 1);
    let mut rows = Vec::with_capacity(entries.len() * dim * dim + blocks * diagonal);
    begins.push(0);
    for j in 0..blocks {
        for c in 0..dim {
            for &(_, row) in &entries[off_begin[j]..off_begin[j + 1]] {
                let begin = row as usize * dim;
                rows.extend(begin..begin + dim);
            }
            rows.extend(j * dim..=j * dim + c);
            begins.push(rows.len());
        }
    }
    (begins, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector, Matrix2};

    #[test]
    fn the_solution_is_that_of_the_dense_system() {
        let pairs = [(0, 1), (2, 1), (3, 2), (3, 0), (1, 0), (4, 3)];
        let (mut system, places) = BlockSystem::new(5, 2, &pairs).unwrap();
        let mut dense = DMatrix::<f64>::identity(10, 10) * 20.0;
        for i in 0..5 {
            system.add_diagonal(i, (Matrix2::identity() * 20.0).as_slice(), 2);
        }
        for (k, (&(a, b), &place)) in pairs.iter().zip(&places).enumerate() {
            let k = k as f64;
            let block = Matrix2::new(1.0 + k, -2.0, 0.5 * k, 3.0 - k);
            system.add_pair(place, block.as_slice(), 2);
            let (a, b) = (2 * a as usize, 2 * b as usize);
            let mut view = dense.view_mut((a, b), (2, 2));
            view += block;
            let mut view = dense.view_mut((b, a), (2, 2));
            view += block.transpose();
        }
        let right = DVector::from_fn(10, |i, _| i as f64 - 4.0);
        let expected = dense.lu().solve(&right).unwrap();
        let mut x = vec![0.0; 10];
        for i in 0..5 {
            for k in 0..2 {
                x[system.row(i) + k] = right[2 * i as usize + k];
            }
        }
        system.factorize().unwrap();
        system.solve(&mut x);
        for i in 0..5 {
            for k in 0..2 {
                let got = x[system.row(i) + k];
                assert!((got - expected[2 * i as usize + k]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_block_without_a_positive_pivot_is_named() {
        let (mut system, _) = BlockSystem::new(3, 2, &[(0, 1)]).unwrap();
        for i in 0..2 {
            system.add_diagonal(i, Matrix2::identity().as_slice(), 2);
        }
        assert_eq!(
            system.factorize(),
            Err(SparseError::NotPositive { block: 2 })
        );
    }
}
