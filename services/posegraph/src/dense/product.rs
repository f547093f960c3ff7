//! `C -= A B'` in tiles that stay in registers.

use pulp::Simd;

/// Columns of a tile. With three vectors of rows that makes twelve sums, which with their operands
/// fill the sixteen registers of AVX2.
pub(super) const COLUMNS: usize = 4;

/// Columns `begin..end`, from the diagonal down: minus the products of the columns before `begin`.
/// Entries above the diagonal of a tile are written too; nobody reads them.
#[inline(always)]
pub(super) fn subtract<S: Simd>(
    simd: S,
    matrix: &mut [f64],
    rows: usize,
    begin: usize,
    end: usize,
) {
    if begin == 0 {
        return;
    }
    let (done, rest) = matrix.split_at_mut(begin * rows);
    let mut j = begin;
    while j < end {
        let width = (end - j).min(COLUMNS);
        let target = &mut rest[(j - begin) * rows..(j - begin + width) * rows];
        match width {
            4 => block::<S, 4>(simd, target, done, rows, j),
            3 => block::<S, 3>(simd, target, done, rows, j),
            2 => block::<S, 2>(simd, target, done, rows, j),
            _ => block::<S, 1>(simd, target, done, rows, j),
        }
        j += width;
    }
}

/// `C` columns from `j` on, rows from `j` down.
#[inline(always)]
fn block<S: Simd, const C: usize>(
    simd: S,
    target: &mut [f64],
    done: &[f64],
    rows: usize,
    j: usize,
) {
    let lanes = S::F64_LANES;
    let mut i = j;
    while i + 3 * lanes <= rows {
        tile::<S, 3, C>(simd, target, done, rows, i, j);
        i += 3 * lanes;
    }
    if i + 2 * lanes <= rows {
        tile::<S, 2, C>(simd, target, done, rows, i, j);
        i += 2 * lanes;
    }
    if i + lanes <= rows {
        tile::<S, 1, C>(simd, target, done, rows, i, j);
        i += lanes;
    }
    if i < rows {
        if rows - j >= lanes {
            // The last rows once more as part of a whole vector: those before it are done, so only
            // what is new is stored.
            tail::<S, C>(simd, target, done, rows, i, j);
        } else {
            for i in i..rows {
                for c in 0..C {
                    let products = done.chunks_exact(rows).map(|l| l[i] * l[j + c]);
                    target[c * rows + i] -= products.sum::<f64>();
                }
            }
        }
    }
}

#[inline(always)]
fn sums<S: Simd, const R: usize, const C: usize>(
    simd: S,
    done: &[f64],
    rows: usize,
    i: usize,
    j: usize,
) -> [[S::f64s; R]; C] {
    let lanes = S::F64_LANES;
    let mut sums = [[simd.splat_f64s(0.0); R]; C];
    for column in done.chunks_exact(rows) {
        let left = S::as_simd_f64s(&column[i..i + R * lanes]).0;
        let right = &column[j..j + C];
        for c in 0..C {
            let r = simd.splat_f64s(right[c]);
            for k in 0..R {
                sums[c][k] = simd.mul_add_e_f64s(left[k], r, sums[c][k]);
            }
        }
    }
    sums
}

#[inline(always)]
fn tile<S: Simd, const R: usize, const C: usize>(
    simd: S,
    target: &mut [f64],
    done: &[f64],
    rows: usize,
    i: usize,
    j: usize,
) {
    let lanes = S::F64_LANES;
    let sums = sums::<S, R, C>(simd, done, rows, i, j);
    for (c, sums) in sums.iter().enumerate() {
        let begin = c * rows + i;
        let target = S::as_mut_simd_f64s(&mut target[begin..begin + R * lanes]).0;
        for k in 0..R {
            target[k] = simd.sub_f64s(target[k], sums[k]);
        }
    }
}

#[inline(always)]
fn tail<S: Simd, const C: usize>(
    simd: S,
    target: &mut [f64],
    done: &[f64],
    rows: usize,
    i: usize,
    j: usize,
) {
    let lanes = S::F64_LANES;
    let from = rows - lanes;
    let sums = sums::<S, 1, C>(simd, done, rows, from, j);
    let mut numbers = [0.0; 16];
    for c in 0..C {
        S::as_mut_simd_f64s(&mut numbers[..lanes]).0[0] = sums[c][0];
        let target = &mut target[c * rows..(c + 1) * rows];
        for i in i..rows {
            target[i] -= numbers[i - from];
        }
    }
}

#[inline(always)]
pub(super) fn dot<S: Simd>(simd: S, a: &[f64], b: &[f64]) -> f64 {
    let (a, a_tail) = S::as_simd_f64s(a);
    let (b, b_tail) = S::as_simd_f64s(b);
    let mut sums = [simd.splat_f64s(0.0); 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    for (a, b) in a4.remainder().iter().zip(b4.remainder()) {
        sums[0] = simd.mul_add_e_f64s(*a, *b, sums[0]);
    }
    for (a, b) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] = simd.mul_add_e_f64s(a[k], b[k], sums[k]);
        }
    }
    let sum = simd.add_f64s(
        simd.add_f64s(sums[0], sums[1]),
        simd.add_f64s(sums[2], sums[3]),
    );
    let tail = a_tail.iter().zip(b_tail).map(|(a, b)| a * b);
    simd.reduce_sum_f64s(sum) + tail.sum::<f64>()
}
