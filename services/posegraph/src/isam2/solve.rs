//! Steps, from the root down, as far as they changed.
//!
//! In: cliques made in this update, and those that earlier updates did not get to. Out: steps of
//! their poses, and of all further down whose separator moved by more than the threshold since it
//! was passed on last. That a change is measured from there, and not from the last update, keeps
//! many small changes from adding up unseen.

use super::relinearise::Limits;
use super::variables::largest;
use super::{Isam2, UpdateOptions};
use crate::dense;
use crate::group::{Dense, Group};
use crate::symbolic::NONE;

/// Solves; how many poses' steps were computed.
pub(super) fn run<G: Group>(
    isam: &mut Isam2<G>,
    options: &UpdateOptions,
    limits: &Limits,
) -> usize {
    next_pass(isam);
    let threshold = options
        .propagate_threshold
        .unwrap_or(isam.config.propagate_threshold);
    let everything = threshold < isam.config.propagate_threshold;
    let pass = isam.work.pass;
    let mut stack = core::mem::take(&mut isam.work.stack);
    stack.clear();
    // Last in, first out: new cliques before those that waited.
    let waiting = core::mem::take(&mut isam.work.waiting);
    for &slot in waiting.iter().rev() {
        let since = isam.tree.cliques[slot as usize].waiting_since;
        if since != 0 {
            stack.push((slot, since));
        }
    }
    isam.work.waiting = waiting;
    isam.work.waiting.clear();
    if everything {
        push_roots(isam, &mut stack);
    } else {
        let fresh = isam.work.fresh.iter();
        let roots = fresh.filter(|&&slot| isam.tree.cliques[slot as usize].parent == NONE);
        stack.extend(roots.map(|&slot| (slot, pass)));
    }
    let (mut solved, mut beyond) = (0, 0);
    while let Some((slot, since)) = stack.pop() {
        let clique = &mut isam.tree.cliques[slot as usize];
        let is_waiting = clique.waiting_since != 0;
        let since = match clique.waiting_since {
            0 => since,
            waiting => since.min(waiting),
        };
        let passed_in = &isam.variables.passed_in;
        let separator = clique.variables[clique.frontals as usize..].iter();
        let is_moved = clique.is_fresh
            || is_waiting
            || everything
            || separator
                .into_iter()
                .any(|&i| passed_in[i as usize] >= since);
        if !is_moved {
            continue;
        }
        if !clique.is_fresh {
            if beyond >= limits.poses_to_solve() {
                clique.waiting_since = since;
                isam.work.waiting.push(slot);
                continue;
            }
            beyond += clique.frontals as usize;
        }
        clique.waiting_since = 0;
        solved += clique.frontals as usize;
        solve(isam, slot, threshold, pass);
        isam.tree.cliques[slot as usize].is_fresh = false;
        stack.extend(isam.tree.children(slot).map(|child| (child, since)));
    }
    isam.work.stack = stack;
    solved
}

fn push_roots<G: Group>(isam: &Isam2<G>, stack: &mut Vec<(u32, u32)>) {
    for (slot, clique) in isam.tree.cliques.iter().enumerate() {
        if clique.parent == NONE && clique.frontals > 0 {
            stack.push((slot as u32, isam.work.pass));
        }
    }
}

/// Passes are numbered from 1; should numbers ever run out, all begin anew.
fn next_pass<G: Group>(isam: &mut Isam2<G>) {
    if isam.work.pass == u32::MAX {
        isam.work.pass = 1;
        let waits = |since: &mut u32| *since = (*since).min(1);
        isam.variables.passed_in.iter_mut().for_each(waits);
        let cliques = isam.tree.cliques.iter_mut();
        cliques.for_each(|clique| waits(&mut clique.waiting_since));
    }
    isam.work.pass += 1;
}

/// Solves one clique for its frontal poses.
fn solve<G: Group>(isam: &mut Isam2<G>, slot: u32, threshold: f64, pass: u32) {
    let d = G::DIM;
    let variables = &mut isam.variables;
    let clique = &isam.tree.cliques[slot as usize];
    let frontals = clique.frontals as usize;
    let x = &mut isam.work.solution;
    x.clear();
    x.resize(frontals * d, 0.0);
    for &pose in clique.separator() {
        x.extend_from_slice(variables.steps[pose as usize].numbers());
    }
    let columns = clique.variables.len() * d;
    dense::back_substitute(&clique.numbers, columns, frontals * d, x);
    let mut any_moved = clique.is_fresh;
    for (k, &pose) in clique.frontal().iter().enumerate() {
        let passed_on = variables.passed_on[pose as usize].numbers();
        let change = x[k * d..(k + 1) * d].iter().zip(passed_on);
        let moved = change.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) > threshold;
        if moved {
            variables.passed_in[pose as usize] = pass;
            any_moved = true;
        }
    }
    if !any_moved {
        return;
    }
    for (k, &pose) in clique.frontal().iter().enumerate() {
        let i = pose as usize;
        let step = &mut variables.steps[i];
        step.numbers_mut().copy_from_slice(&x[k * d..(k + 1) * d]);
        if variables.passed_in[i] == pass {
            variables.passed_on[i] = *step;
        }
        if !variables.is_pending[i] && largest(step) >= isam.config.relinearise_threshold {
            variables.is_pending[i] = true;
            isam.work.pending.push(pose);
        }
    }
}
