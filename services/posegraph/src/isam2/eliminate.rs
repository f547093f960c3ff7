//! Numbers into planned cliques: assemble a front, eliminate its frontal poses, keep the rest.

use super::Isam2;
use super::tree::Clique;
use crate::dense;
use crate::group::{Dense, Group};
use crate::symbolic::NONE;

/// A pose whose pivot is no good.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weak {
    pub pose: u32,
    pub finite: bool,
}

/// A pivot this small a share of its factors' diagonal is rounding.
const WEAK_SHARE: f64 = 1e-11;

/// The matrix of one clique before it is kept.
#[derive(Debug, Clone, Default)]
pub(crate) struct Front {
    numbers: Vec<f64>,
    least: Vec<f64>,
    /// For each pose of the clique at hand: the row at which its block begins.
    row: Vec<u32>,
    runs: Vec<Run>,
}

/// Rows of a child that are neighbours in its parent too.
#[derive(Debug, Clone, Copy)]
struct Run {
    from: usize,
    row: usize,
    len: usize,
}

impl Front {
    /// Adds a block at the rows of one pose and the columns of another, in the lower triangle.
    #[inline(always)]
    fn add<const TRANSPOSED: bool>(
        &mut self,
        rows: usize,
        row: usize,
        column: usize,
        block: &[f64],
        dim: usize,
    ) {
        for c in 0..dim {
            let begin = (column + c) * rows + row;
            let target = &mut self.numbers[begin..begin + dim];
            for (r, t) in target.iter_mut().enumerate() {
                *t += if TRANSPOSED {
                    block[r * dim + c]
                } else {
                    block[c * dim + r]
                };
            }
        }
    }

    #[inline(always)]
    fn add_right(&mut self, rows: usize, column: usize, numbers: impl Iterator<Item = f64>) {
        for (c, v) in numbers.enumerate() {
            self.numbers[(column + c) * rows + rows - 1] += v;
        }
    }
}

/// Eliminates all planned cliques, children first. The new cliques are in `work.fresh`, not yet in
/// the tree.
///
/// # Errors
/// The first pose that is held by nothing.
pub(super) fn run<G: Group>(isam: &mut Isam2<G>) -> Result<(), Weak> {
    isam.work.fresh.clear();
    isam.work.weak.clear();
    bucket_orphans(isam);
    for k in 0..isam.work.plan.cliques.len() {
        let slot = isam.tree.add();
        isam.work.fresh.push(slot);
        let planned = isam.work.plan.cliques[k];
        let affected = &isam.work.affected;
        let variables = isam.work.plan.variables[planned.begin..planned.end].iter();
        let clique = &mut isam.tree.cliques[slot as usize];
        clique.frontals = planned.frontals as u32;
        clique
            .variables
            .extend(variables.map(|&local| affected[local as usize]));
        assemble(isam, slot, k);
        eliminate(isam, slot)?;
    }
    Ok(())
}

/// Lists subtrees that stay by the planned clique they hang under.
fn bucket_orphans<G: Group>(isam: &mut Isam2<G>) {
    let work = &mut isam.work;
    work.first_orphan.clear();
    work.first_orphan.resize(work.plan.cliques.len(), NONE);
    work.next_orphan.clear();
    work.next_orphan.resize(work.orphans.len(), NONE);
    work.orphan_parent.clear();
    for (k, &slot) in work.orphans.iter().enumerate() {
        let separator = isam.tree.cliques[slot as usize].separator().iter();
        let first = separator
            .map(|&pose| work.local[pose as usize])
            .min_by_key(|&local| work.plan.place[local as usize])
            .expect("a clique with a parent has a separator");
        let parent = work.plan.clique_of[first as usize];
        work.orphan_parent.push(parent);
        let list = &mut work.first_orphan[parent as usize];
        work.next_orphan[k] = core::mem::replace(list, k as u32);
    }
}

fn assemble<G: Group>(isam: &mut Isam2<G>, slot: u32, planned: usize) {
    let Isam2 {
        variables,
        factors,
        tree,
        work,
        ..
    } = isam;
    let columns = tree.cliques[slot as usize].variables.len() * G::DIM;
    let rows = columns + 1;
    let front = &mut work.front;
    tree.pool.give(core::mem::take(&mut front.numbers));
    front.numbers = tree.pool.take(rows * columns);
    for c in 0..columns {
        front.numbers[c * rows + c..(c + 1) * rows].fill(0.0);
    }
    let clique = &tree.cliques[slot as usize];
    front.row.resize(variables.len(), 0);
    front.least.clear();
    for (k, &pose) in clique.variables.iter().enumerate() {
        front.row[pose as usize] = (k * G::DIM) as u32;
        if k < clique.frontals as usize {
            let scale = variables.scale[pose as usize];
            front
                .least
                .extend(scale.numbers().iter().map(|s| s * WEAK_SHARE));
        }
    }
    for &pose in clique.frontal() {
        let place = work.plan.place[work.local[pose as usize] as usize];
        for &slot in &variables.factors[pose as usize] {
            let bound = factors.at(slot);
            let other = bound.from ^ bound.to ^ pose;
            let binary = bound.from != bound.to;
            if binary {
                let local = work.local[other as usize];
                // Factors belong to the first of their poses.
                if local == NONE || work.plan.place[local as usize] < place {
                    continue;
                }
            }
            let point = |i: u32| &variables.points[i as usize];
            let linear = bound.factor.linearize(point(bound.from), point(bound.to));
            let to = front.row[bound.to as usize] as usize;
            front.add::<false>(rows, to, to, linear.to_to.numbers(), G::DIM);
            front.add_right(rows, to, linear.to_gradient.numbers().iter().map(|g| -g));
            if binary {
                let from = front.row[bound.from as usize] as usize;
                let numbers = linear.from_from.numbers();
                front.add::<false>(rows, from, from, numbers, G::DIM);
                front.add_right(
                    rows,
                    from,
                    linear.from_gradient.numbers().iter().map(|g| -g),
                );
                let numbers = linear.from_to.numbers();
                if from > to {
                    front.add::<false>(rows, from, to, numbers, G::DIM);
                } else {
                    front.add::<true>(rows, to, from, numbers, G::DIM);
                }
            }
        }
    }
    let mut child = work.plan.cliques[planned].first_child;
    while child != NONE {
        extend_add::<G>(
            front,
            rows,
            &tree.cliques[work.fresh[child as usize] as usize],
        );
        child = work.plan.cliques[child as usize].next_child;
    }
    let mut orphan = work.first_orphan[planned];
    while orphan != NONE {
        let slot = work.orphans[orphan as usize];
        extend_add::<G>(front, rows, &tree.cliques[slot as usize]);
        orphan = work.next_orphan[orphan as usize];
    }
}

/// Adds what a child left to its separator.
fn extend_add<G: Group>(front: &mut Front, rows: usize, child: &Clique) {
    let d = G::DIM;
    let first = child.frontals as usize;
    let stride = child.variables.len() * d + 1;
    // Most of a separator stands in the same order in the parent: whole stretches are added.
    front.runs.clear();
    for (k, pose) in child.variables.iter().enumerate().skip(first) {
        let row = front.row[*pose as usize] as usize;
        match front.runs.last_mut() {
            Some(run) if run.row + run.len == row => run.len += d,
            _ => front.runs.push(Run {
                from: k * d,
                row,
                len: d,
            }),
        }
    }
    let Front { numbers, runs, .. } = front;
    for (k, own) in runs.iter().enumerate() {
        for c in 0..own.len {
            let column = &child.numbers[(own.from + c) * stride..(own.from + c + 1) * stride];
            let at = own.row + c;
            let target = &mut numbers[at * rows..(at + 1) * rows];
            add(&mut target[at..own.row + own.len], &column[own.from + c..]);
            target[rows - 1] += column[stride - 1];
            for run in &runs[k + 1..] {
                let source = &column[run.from..run.from + run.len];
                if run.row > at {
                    add(&mut numbers[at * rows + run.row..][..run.len], source);
                } else {
                    for (r, v) in source.iter().enumerate() {
                        numbers[(run.row + r) * rows + at] += v;
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn add(target: &mut [f64], source: &[f64]) {
    for (t, s) in target.iter_mut().zip(source) {
        *t += s;
    }
}

fn eliminate<G: Group>(isam: &mut Isam2<G>, slot: u32) -> Result<(), Weak> {
    let Isam2 {
        factors,
        anchors,
        tree,
        work,
        ..
    } = isam;
    let clique = &mut tree.cliques[slot as usize];
    let columns = clique.variables.len() * G::DIM;
    let pivots = clique.frontals as usize * G::DIM;
    let rows = columns + 1;
    let pose_of = |column: usize| clique.variables[column / G::DIM];
    let weak = &mut work.weak;
    let front = &mut work.front;
    dense::eliminate(
        &mut front.numbers,
        columns,
        pivots,
        &front.least,
        |column| {
            let pose = pose_of(column);
            // Without a factor there is nothing to take a share of.
            let held = front.least[column] > 0.0 && anchors.is_held(pose, factors);
            if held && weak.last() != Some(&pose) {
                weak.push(pose);
            }
            held
        },
    )
    .map_err(|failure| Weak {
        pose: pose_of(failure.column),
        finite: failure.finite,
    })?;
    let right = (0..pivots).map(|c| front.numbers[(c + 1) * rows - 1].abs());
    if !right.sum::<f64>().is_finite() {
        return Err(Weak {
            pose: pose_of(0),
            finite: false,
        });
    }
    clique.numbers = core::mem::take(&mut front.numbers);
    Ok(())
}
