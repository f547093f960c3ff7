//! Cholesky of the first columns of a small dense matrix, and what that leaves of the others.
//!
//! In: the lower triangle of a symmetric matrix, column by column, with one row more below: the
//! right-hand side. Out, in the same place: for the first columns the factor `L` and, in the last
//! row, `L^-1 b`; for the others the Schur complement and its right-hand side. Elsewhere: what the
//! rows and columns mean (`isam2`).

/// Why a pivot can't be divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PivotFailure {
    /// Its column.
    pub column: usize,
    /// False if it is no number at all.
    pub finite: bool,
}

/// Columns that are finished before the next ones are touched.
const PANEL: usize = 12;
/// Rows and columns of the matrix product that stay in registers.
const TILE_ROWS: usize = 8;
const TILE_COLUMNS: usize = 4;

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
    mut weak: impl FnMut(usize) -> bool,
) -> Result<(), PivotFailure> {
    let rows = columns + 1;
    let mut begin = 0;
    while begin < pivots {
        let end = (begin + PANEL).min(pivots);
        subtract_products(matrix, rows, begin, end, 0);
        for k in begin..end {
            let (before, rest) = matrix.split_at_mut(k * rows);
            let column = &mut rest[k..rows];
            for j in begin..k {
                let other = &before[j * rows + k..(j + 1) * rows];
                let factor = other[0];
                for (a, b) in column.iter_mut().zip(other) {
                    *a -= factor * b;
                }
            }
            let mut pivot = column[0];
            // Also true for NaN.
            if !(pivot > least[k]) || pivot == f64::INFINITY {
                let finite = pivot.is_finite();
                if !finite || !weak(k) {
                    return Err(PivotFailure { column: k, finite });
                }
                pivot = least[k];
            }
            let root = pivot.sqrt();
            column[0] = root;
            let inverse = 1.0 / root;
            column[1..].iter_mut().for_each(|v| *v *= inverse);
        }
        begin = end;
    }
    subtract_products(matrix, rows, pivots, columns, 0);
    Ok(())
}

/// Columns `begin..end`, from the diagonal down: minus the products of columns `from..begin`.
fn subtract_products(matrix: &mut [f64], rows: usize, begin: usize, end: usize, from: usize) {
    if from >= begin {
        return;
    }
    let (done, rest) = matrix.split_at_mut(begin * rows);
    let done = &done[from * rows..];
    let mut j = begin;
    while j < end {
        let width = (end - j).min(TILE_COLUMNS);
        let target = &mut rest[(j - begin) * rows..(j - begin + width) * rows];
        if width == TILE_COLUMNS {
            let mut i = j;
            while i + TILE_ROWS <= rows {
                tile(target, done, rows, i, j);
                i += TILE_ROWS;
            }
            edge(target, done, rows, i, j, width);
        } else {
            edge(target, done, rows, j, j, width);
        }
        j += width;
    }
}

/// Rows `i..i + TILE_ROWS` of the four columns from `j` on. Entries above the diagonal of the
/// first tile are written too; nobody reads them.
#[inline(always)]
fn tile(target: &mut [f64], done: &[f64], rows: usize, i: usize, j: usize) {
    let mut sums = [[0.0; TILE_ROWS]; TILE_COLUMNS];
    for column in done.chunks_exact(rows) {
        let left: &[f64; TILE_ROWS] = column[i..i + TILE_ROWS].try_into().expect("a whole tile");
        let right: &[f64; TILE_COLUMNS] = column[j..j + TILE_COLUMNS]
            .try_into()
            .expect("a whole tile");
        for (sums, r) in sums.iter_mut().zip(right) {
            for (sum, l) in sums.iter_mut().zip(left) {
                *sum += l * r;
            }
        }
    }
    for (c, sums) in sums.iter().enumerate() {
        let target = &mut target[c * rows + i..c * rows + i + TILE_ROWS];
        for (t, s) in target.iter_mut().zip(sums) {
            *t -= s;
        }
    }
}

/// Rows from `i` on of `width` columns from `j` on.
fn edge(target: &mut [f64], done: &[f64], rows: usize, i: usize, j: usize, width: usize) {
    for c in 0..width {
        let i = i.max(j + c);
        let target = &mut target[c * rows + i..(c + 1) * rows];
        for column in done.chunks_exact(rows) {
            let factor = column[j + c];
            for (t, l) in target.iter_mut().zip(&column[i..]) {
                *t -= factor * l;
            }
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
    let rows = columns + 1;
    for k in (0..pivots).rev() {
        let column = &matrix[k * rows..(k + 1) * rows];
        let (head, tail) = x[k..columns].split_at_mut(1);
        head[0] = (head[0] - dot(&column[k + 1..columns], tail)) / column[k];
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

/// In four strands, so that the processor need not wait for each sum.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
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
