//! Cholesky of the first columns of a small dense matrix, and what that leaves of the others.
//!
//! In: the lower triangle of a symmetric matrix, column by column, with one row more below: the
//! right-hand side. Out, in the same place: for the first columns the factor `L` and, in the last
//! row, `L^-1 b`; for the others the Schur complement and its right-hand side. Elsewhere: what the
//! rows and columns mean (`isam2`), products (`product`).
//!
//! faer's routines are made for matrices of hundreds of rows; most of these have six to sixty, where
//! a call costs more than the work. So these are our own, on pulp's vectors, faer's own basis.

mod product;

use pulp::{Arch, Simd, WithSimd};

/// Why a pivot can't be divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PivotFailure {
    /// Its column.
    pub column: usize,
    /// False if it is no number at all.
    pub finite: bool,
}

/// Eliminates the first `pivots` of `columns` columns, each of `columns + 1` rows.
///
/// A pivot that is not larger than its entry in `least` is given to `weak`: replaced by that entry
/// if it says so.
///
/// # Errors
/// The first pivot that is too small, or no number.
pub(crate) fn eliminate(
    matrix: &mut [f64],
    columns: usize,
    pivots: usize,
    least: &[f64],
    weak: impl FnMut(usize) -> bool,
) -> Result<(), PivotFailure> {
    Arch::new().dispatch(Elimination {
        matrix,
        columns,
        pivots,
        least,
        weak,
    })
}

/// Columns that are finished before the next ones are touched: as many as a tile is wide.
const PANEL: usize = product::COLUMNS;

struct Elimination<'a, F> {
    matrix: &'a mut [f64],
    columns: usize,
    pivots: usize,
    least: &'a [f64],
    weak: F,
}

impl<F: FnMut(usize) -> bool> WithSimd for Elimination<'_, F> {
    type Output = Result<(), PivotFailure>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> Self::Output {
        let rows = self.columns + 1;
        let mut begin = 0;
        while begin < self.pivots {
            let end = (begin + PANEL).min(self.pivots);
            product::subtract(simd, self.matrix, rows, begin, end);
            self.factor_diagonal(begin, end)?;
            let panel = &mut self.matrix[begin * rows..end * rows];
            match end - begin {
                4 => finish_panel::<S, 4>(simd, panel, rows, begin),
                3 => finish_panel::<S, 3>(simd, panel, rows, begin),
                2 => finish_panel::<S, 2>(simd, panel, rows, begin),
                _ => finish_panel::<S, 1>(simd, panel, rows, begin),
            }
            begin = end;
        }
        if self.pivots > 0 {
            product::subtract(simd, self.matrix, rows, self.pivots, self.columns);
        }
        Ok(())
    }
}

impl<F: FnMut(usize) -> bool> Elimination<'_, F> {
    /// Cholesky of the panel's diagonal block.
    #[inline(always)]
    fn factor_diagonal(&mut self, begin: usize, end: usize) -> Result<(), PivotFailure> {
        let rows = self.columns + 1;
        for k in begin..end {
            let mut pivot = self.matrix[k * rows + k];
            for j in begin..k {
                pivot -= self.matrix[j * rows + k].powi(2);
            }
            if pivot.is_nan() || pivot <= self.least[k] || pivot == f64::INFINITY {
                let finite = pivot.is_finite();
                if !finite || !(self.weak)(k) {
                    return Err(PivotFailure { column: k, finite });
                }
                pivot = self.least[k];
            }
            let root = pivot.sqrt();
            self.matrix[k * rows + k] = root;
            for i in k + 1..end {
                let mut v = self.matrix[k * rows + i];
                for j in begin..k {
                    v -= self.matrix[j * rows + i] * self.matrix[j * rows + k];
                }
                self.matrix[k * rows + i] = v / root;
            }
        }
        Ok(())
    }
}

/// The rows below the diagonal block of `C` columns: solved with that block from the right.
#[inline(always)]
fn finish_panel<S: Simd, const C: usize>(simd: S, panel: &mut [f64], rows: usize, begin: usize) {
    let mut factor = [[0.0; C]; C];
    let mut inverse = [0.0; C];
    for c in 0..C {
        for j in 0..c {
            factor[c][j] = panel[j * rows + begin + c];
        }
        inverse[c] = 1.0 / panel[c * rows + begin + c];
    }
    let mut rest = panel;
    let columns: [&mut [f64]; C] = core::array::from_fn(|_| {
        let (column, after) = core::mem::take(&mut rest).split_at_mut(rows);
        rest = after;
        &mut column[begin + C..]
    });
    let length = rows - begin - C;
    let lanes = S::F64_LANES;
    let whole = length - length % lanes;
    let mut i = 0;
    while i < whole {
        let mut x = [simd.splat_f64s(0.0); C];
        for c in 0..C {
            let mut v = S::as_simd_f64s(&columns[c][i..i + lanes]).0[0];
            for j in 0..c {
                v = simd.negate_mul_add_e_f64s(simd.splat_f64s(factor[c][j]), x[j], v);
            }
            x[c] = simd.mul_f64s(v, simd.splat_f64s(inverse[c]));
            S::as_mut_simd_f64s(&mut columns[c][i..i + lanes]).0[0] = x[c];
        }
        i += lanes;
    }
    #[expect(
        clippy::needless_range_loop,
        reason = "row i of every column, each of which needs the ones before it"
    )]
    for i in whole..length {
        for c in 0..C {
            let mut v = columns[c][i];
            for j in 0..c {
                v -= factor[c][j] * columns[j][i];
            }
            columns[c][i] = v * inverse[c];
        }
    }
}

/// Solves `L' x = y - B' s` for the first `pivots` columns of an eliminated matrix, `y` its last
/// row: `x` holds `s` behind the first `pivots` entries, and the solution in them afterwards.
pub(crate) fn back_substitute(matrix: &[f64], columns: usize, pivots: usize, x: &mut [f64]) {
    let rows = columns + 1;
    for (k, x) in x[..pivots].iter_mut().enumerate() {
        *x = matrix[k * rows + columns];
    }
    back_substitute_in_place(matrix, columns, pivots, x);
}

/// The same with `y` in the first `pivots` entries of `x`.
pub(crate) fn back_substitute_in_place(
    matrix: &[f64],
    columns: usize,
    pivots: usize,
    x: &mut [f64],
) {
    Arch::new().dispatch(BackSubstitution {
        matrix,
        columns,
        pivots,
        x,
    });
}

struct BackSubstitution<'a> {
    matrix: &'a [f64],
    columns: usize,
    pivots: usize,
    x: &'a mut [f64],
}

impl WithSimd for BackSubstitution<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let rows = self.columns + 1;
        for k in (0..self.pivots).rev() {
            let column = &self.matrix[k * rows..(k + 1) * rows];
            let (head, tail) = self.x[k..self.columns].split_at_mut(1);
            let sum = product::dot(simd, &column[k + 1..self.columns], tail);
            head[0] = (head[0] - sum) / column[k];
        }
    }
}

/// Solves `L y = x` for the first `pivots` columns of an eliminated matrix, and takes `B y` from the
/// entries behind.
pub(crate) fn forward_substitute(matrix: &[f64], columns: usize, pivots: usize, x: &mut [f64]) {
    let rows = columns + 1;
    for k in 0..pivots {
        let column = &matrix[k * rows..(k + 1) * rows];
        let (head, tail) = x[k..columns].split_at_mut(1);
        head[0] /= column[k];
        for (x, l) in tail.iter_mut().zip(&column[k + 1..columns]) {
            *x -= head[0] * l;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A positive definite matrix and a right-hand side from a simple generator.
    fn system(n: usize) -> (DMatrix<f64>, DVector<f64>) {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let root = DMatrix::from_fn(n, n, |_, _| next());
        let matrix = &root * root.transpose() + DMatrix::identity(n, n);
        (matrix, DVector::from_fn(n, |_, _| next()))
    }

    fn stacked(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Vec<f64> {
        let n = right.len();
        let mut numbers = Vec::new();
        for c in 0..n {
            numbers.extend(matrix.column(c).iter());
            numbers.push(right[c]);
        }
        numbers
    }

    #[test]
    fn what_is_left_is_the_schur_complement_and_what_is_solved_the_solution() {
        for n in [1, 2, 5, 6, 12, 13, 29, 61] {
            let (matrix, right) = system(n);
            let solution = matrix.clone().lu().solve(&right).unwrap();
            for pivots in [1, n / 2, n] {
                let mut numbers = stacked(&matrix, &right);
                eliminate(&mut numbers, n, pivots, &vec![0.0; n], |_| false).unwrap();
                let rest = n - pivots;
                let inverse = matrix
                    .view((0, 0), (pivots, pivots))
                    .into_owned()
                    .try_inverse()
                    .unwrap();
                let below = matrix.view((pivots, 0), (rest, pivots));
                let schur = matrix.view((pivots, pivots), (rest, rest))
                    - below * &inverse * below.transpose();
                for c in 0..rest {
                    for r in c..rest {
                        let got = numbers[(pivots + c) * (n + 1) + pivots + r];
                        assert!((got - schur[(r, c)]).abs() < 1e-9, "{n} {pivots} {r} {c}");
                    }
                }
                let mut x: Vec<f64> = solution.iter().copied().collect();
                x[..pivots].fill(f64::NAN);
                back_substitute(&numbers, n, pivots, &mut x);
                for k in 0..pivots {
                    assert!((x[k] - solution[k]).abs() < 1e-9, "{n} {pivots} {k}");
                }
            }
        }
    }

    #[test]
    fn a_pivot_that_is_too_small_is_named_or_replaced() {
        let matrix = DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 1.0]);
        let right = DVector::from_row_slice(&[1.0, 1.0]);
        let least = [1e-9, 1e-9];
        let mut numbers = stacked(&matrix, &right);
        let failure = eliminate(&mut numbers, 2, 2, &least, |_| false).unwrap_err();
        assert_eq!((failure.column, failure.finite), (1, true));
        let mut numbers = stacked(&matrix, &right);
        eliminate(&mut numbers, 2, 2, &least, |k| k == 1).unwrap();
        assert!((numbers[4] - 1e-9f64.sqrt()).abs() < 1e-12);
        let mut numbers = stacked(&(matrix * f64::NAN), &right);
        let failure = eliminate(&mut numbers, 2, 2, &least, |_| true).unwrap_err();
        assert_eq!((failure.column, failure.finite), (0, false));
    }
}
