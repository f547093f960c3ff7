//! One update, from top to bottom as the data flows.

use super::eliminate::{self, Weak};
use super::relinearise::{self, Moved};
use super::solve;
use super::{Isam2, UpdateOptions, UpdateReport};
use crate::error::Error;
use crate::factor::{Factor, FactorId, Key};
use crate::group::{Dense, Group};
use crate::ordering::{Cliques, MinimumDegree};
use crate::slab::{Bound, MOST};
use crate::symbolic::{NONE, Plan};

/// Buffers that updates share, and what one update leaves for the next.
#[derive(Debug, Clone)]
pub(crate) struct Workspace<G: Group> {
    /// Poses whose step is over the threshold.
    pub pending: Vec<u32>,
    /// Cliques to which steps were not passed on yet.
    pub waiting: Vec<u32>,
    /// Work that updates left unused.
    pub credit: usize,
    /// Counts passes of steps down the tree.
    pub pass: u32,
    /// Cliques to replace.
    pub marked: Vec<u32>,
    /// Subtrees that stay, below marked cliques.
    pub orphans: Vec<u32>,
    /// For each orphan: the planned clique it will hang under.
    pub orphan_parent: Vec<u32>,
    /// The same, as lists by planned clique.
    pub first_orphan: Vec<u32>,
    pub next_orphan: Vec<u32>,
    /// Poses to eliminate: frontal ones of marked cliques, and new ones.
    pub affected: Vec<u32>,
    /// Each pose's index in `affected`, or `NONE`.
    pub local: Vec<u32>,
    pub late: Vec<bool>,
    pub cliques: Cliques,
    pub minimum_degree: MinimumDegree,
    pub order: Vec<u32>,
    pub plan: Plan,
    /// Slots of new cliques, children before parents.
    pub fresh: Vec<u32>,
    pub front: eliminate::Front,
    pub moved: Vec<Moved<G>>,
    /// Poses eliminated anew only to linearise some anew.
    pub relinearise_work: usize,
    pub counted: Vec<u32>,
    pub stack: Vec<(u32, u32)>,
    pub solution: Vec<f64>,
    pub weak: Vec<u32>,
}

impl<G: Group> Default for Workspace<G> {
    fn default() -> Self {
        Self {
            pending: Vec::new(),
            waiting: Vec::new(),
            credit: 0,
            pass: 0,
            marked: Vec::new(),
            orphans: Vec::new(),
            orphan_parent: Vec::new(),
            first_orphan: Vec::new(),
            next_orphan: Vec::new(),
            affected: Vec::new(),
            local: Vec::new(),
            late: Vec::new(),
            cliques: Cliques::default(),
            minimum_degree: MinimumDegree::default(),
            order: Vec::new(),
            plan: Plan::default(),
            fresh: Vec::new(),
            front: eliminate::Front::default(),
            moved: Vec::new(),
            relinearise_work: 0,
            counted: Vec::new(),
            stack: Vec::new(),
            solution: Vec::new(),
            weak: Vec::new(),
        }
    }
}

/// A factor that was taken out, with its places in the lists of its poses.
struct Removed<G: Group> {
    id: FactorId,
    bound: Bound<G>,
    place_from: usize,
    place_to: usize,
}

/// Adds, removes, linearises, eliminates, solves.
pub(super) fn run<G: Group>(
    isam: &mut Isam2<G>,
    new_factors: &[Factor<G>],
    new_poses: &[(Key, G)],
    removed: &[FactorId],
    options: &UpdateOptions,
) -> Result<UpdateReport, Error> {
    let poses_before = isam.variables.len();
    let definite = check(isam, new_factors, new_poses, removed)?;

    let taken = take_factors(isam, removed);
    let factor_ids = match add(isam, new_factors, new_poses, &definite) {
        Ok(ids) => ids,
        Err(error) => {
            put_back(isam, taken);
            return Err(error);
        }
    };
    mark_changed(isam, &factor_ids, &taken);
    let limits = relinearise::Limits::new(isam, options);
    let waiting = relinearise::choose(isam, &limits, &taken_poses(&taken));
    relinearise::move_points(isam);
    gather(isam, poses_before);
    order(isam, &factor_ids);
    let outcome = eliminate::run(isam);
    release_local(isam);
    if let Err(weak) = outcome {
        let error = describe(isam, &weak);
        undo(isam, poses_before, &factor_ids, taken);
        return Err(error);
    }
    let cliques = isam.work.fresh.len();
    commit(isam, &taken);
    let solved = solve::run(isam, options, &limits);

    isam.work.credit = limits.left(isam);
    Ok(UpdateReport {
        factor_ids,
        relinearised: isam.work.moved.len(),
        affected: isam.work.affected.len(),
        cliques,
        solved,
        waiting,
        weak: isam.work.weak.len(),
    })
}

/// Everything that can be refused without changing anything. Which new factors are definite.
fn check<G: Group>(
    isam: &Isam2<G>,
    new_factors: &[Factor<G>],
    new_poses: &[(Key, G)],
    removed: &[FactorId],
) -> Result<Vec<bool>, Error> {
    isam.factors.check_room(new_factors.len())?;
    if isam.variables.len().saturating_add(new_poses.len()) > MOST {
        return Err(Error::TooLarge { limit: MOST });
    }
    for &(key, pose) in new_poses {
        if isam.variables.index_of(key).is_some() {
            return Err(Error::DuplicateKey { key });
        }
        if !pose.is_finite() {
            return Err(Error::PoseNotFinite { key });
        }
    }
    for &id in removed {
        if isam.factors.get(id).is_none() {
            return Err(Error::UnknownFactor { id });
        }
    }
    new_factors.iter().map(Factor::validate).collect()
}

fn take_factors<G: Group>(isam: &mut Isam2<G>, removed: &[FactorId]) -> Vec<Removed<G>> {
    let mut taken = Vec::with_capacity(removed.len());
    for &id in removed {
        // The same identifier twice in one call is one removal.
        let Some(bound) = isam.factors.take(id) else {
            continue;
        };
        let mut unlist = |pose: u32| {
            let list = &mut isam.variables.factors[pose as usize];
            let place = list.iter().position(|&slot| slot == id.slot);
            let place = place.expect("a factor stands in the lists of its poses");
            list.remove(place);
            place
        };
        let place_from = unlist(bound.from);
        let place_to = if bound.to == bound.from {
            place_from
        } else {
            unlist(bound.to)
        };
        taken.push(Removed {
            id,
            bound,
            place_from,
            place_to,
        });
    }
    if !taken.is_empty() {
        isam.anchors.invalidate();
    }
    taken
}

fn put_back<G: Group>(isam: &mut Isam2<G>, taken: Vec<Removed<G>>) {
    for one in taken.into_iter().rev() {
        isam.factors.restore(one.id, one.bound);
        let lists = &mut isam.variables.factors;
        let Bound { from, to, .. } = one.bound;
        if from != to {
            lists[to as usize].insert(one.place_to, one.id.slot);
        }
        lists[from as usize].insert(one.place_from, one.id.slot);
    }
    isam.anchors.invalidate();
}

fn add<G: Group>(
    isam: &mut Isam2<G>,
    new_factors: &[Factor<G>],
    new_poses: &[(Key, G)],
    definite: &[bool],
) -> Result<Vec<FactorId>, Error> {
    let before = isam.variables.len();
    for &(key, pose) in new_poses {
        if isam.variables.index_of(key).is_some() {
            isam.variables.truncate(before);
            return Err(Error::DuplicateKey { key });
        }
        isam.variables.push(key, pose);
    }
    let mut bounds = Vec::with_capacity(new_factors.len());
    for (factor, &definite) in new_factors.iter().zip(definite) {
        let ends = [factor.from(), factor.to()];
        match ends.map(|key| isam.variables.index_of(key)) {
            [Some(from), Some(to)] => {
                let at = |i: u32| isam.variables.estimate(i as usize);
                if !factor.cost(&at(from), &at(to)).is_finite() {
                    isam.variables.truncate(before);
                    let factor = factor.description();
                    return Err(Error::Overflow { factor });
                }
                bounds.push(Bound {
                    factor: *factor,
                    from,
                    to,
                    definite,
                });
            }
            found => {
                isam.variables.truncate(before);
                let key = ends[usize::from(found[0].is_some())];
                return Err(Error::UnknownKey { key });
            }
        }
    }
    isam.anchors.resize(isam.variables.len());
    isam.work.local.resize(isam.variables.len(), NONE);
    let mut ids = Vec::with_capacity(bounds.len());
    for bound in bounds {
        isam.anchors.add(&bound);
        let id = isam.factors.insert(bound);
        isam.variables.factors[bound.from as usize].push(id.slot);
        if bound.from != bound.to {
            isam.variables.factors[bound.to as usize].push(id.slot);
        }
        remember_scale(isam, &bound);
        ids.push(id);
    }
    Ok(ids)
}

fn remember_scale<G: Group>(isam: &mut Isam2<G>, bound: &Bound<G>) {
    let points = &isam.variables.points;
    let linear = bound
        .factor
        .linearize(&points[bound.from as usize], &points[bound.to as usize]);
    let scale = &mut isam.variables.scale;
    let mut raise = |pose: u32, block: &G::Matrix| {
        let scale = scale[pose as usize].numbers_mut();
        for (k, scale) in scale.iter_mut().enumerate() {
            *scale = scale.max(block.numbers()[k * (G::DIM + 1)]);
        }
    };
    raise(bound.to, &linear.to_to);
    if bound.from != bound.to {
        raise(bound.from, &linear.from_from);
    }
}

/// Marks the cliques of all poses whose factors are new or gone.
fn mark_changed<G: Group>(isam: &mut Isam2<G>, new: &[FactorId], taken: &[Removed<G>]) {
    isam.work.marked.clear();
    let gone = taken.iter().map(|one| (one.bound.from, one.bound.to));
    let come = new.iter().map(|id| {
        let bound = isam.factors.at(id.slot);
        (bound.from, bound.to)
    });
    let mut ends: Vec<u32> = gone.chain(come).flat_map(|(a, b)| [a, b]).collect();
    ends.sort_unstable();
    ends.dedup();
    for pose in ends {
        mark_up(isam, pose);
    }
}

/// Marks the clique of a pose and all above it.
pub(super) fn mark_up<G: Group>(isam: &mut Isam2<G>, pose: u32) {
    let mut slot = isam.variables.clique[pose as usize];
    while slot != NONE {
        let clique = &mut isam.tree.cliques[slot as usize];
        if clique.is_marked {
            return;
        }
        clique.is_marked = true;
        isam.work.marked.push(slot);
        slot = clique.parent;
    }
}

fn taken_poses<G: Group>(taken: &[Removed<G>]) -> Vec<u32> {
    let mut poses: Vec<u32> = taken
        .iter()
        .flat_map(|one| [one.bound.from, one.bound.to])
        .collect();
    poses.sort_unstable();
    poses.dedup();
    poses
}

/// Poses of the marked cliques, subtrees below them, and new poses.
fn gather<G: Group>(isam: &mut Isam2<G>, poses_before: usize) {
    let work = &mut isam.work;
    work.affected.clear();
    work.orphans.clear();
    for &slot in &work.marked {
        let clique = &isam.tree.cliques[slot as usize];
        work.affected.extend_from_slice(clique.frontal());
        for child in isam.tree.children(slot) {
            if !isam.tree.cliques[child as usize].is_marked {
                work.orphans.push(child);
            }
        }
    }
    work.affected
        .extend(poses_before as u32..isam.variables.len() as u32);
    work.affected.sort_unstable();
    for (at, &pose) in work.affected.iter().enumerate() {
        work.local[pose as usize] = at as u32;
    }
}

fn release_local<G: Group>(isam: &mut Isam2<G>) {
    for &pose in &isam.work.affected {
        isam.work.local[pose as usize] = NONE;
    }
}

/// Orders the affected poses, those of new factors last, and plans their cliques.
fn order<G: Group>(isam: &mut Isam2<G>, new: &[FactorId]) {
    let work = &mut isam.work;
    work.late.clear();
    work.late.resize(work.affected.len(), false);
    for id in new {
        let bound = isam.factors.at(id.slot);
        for pose in [bound.from, bound.to] {
            work.late[work.local[pose as usize] as usize] = true;
        }
    }
    work.cliques.clear();
    for &slot in &work.orphans {
        let separator = isam.tree.cliques[slot as usize].separator().iter();
        work.cliques
            .push(separator.map(|&pose| work.local[pose as usize]));
    }
    for (at, &pose) in work.affected.iter().enumerate() {
        let at = at as u32;
        for &slot in &isam.variables.factors[pose as usize] {
            let bound = isam.factors.at(slot);
            let other = bound.from ^ bound.to ^ pose;
            // Once for each pair, and for none that reaches into a subtree that stays.
            if bound.from != bound.to {
                let other = work.local[other as usize];
                if other != NONE && other > at {
                    work.cliques.push([at, other]);
                }
            }
        }
    }
    let late = &work.late;
    work.minimum_degree.order(
        work.affected.len(),
        &work.cliques,
        |i| late[i],
        &mut work.order,
    );
    work.plan.make(&work.order, &work.cliques);
}

fn describe<G: Group>(isam: &Isam2<G>, weak: &Weak) -> Error {
    let pose = weak.pose as usize;
    let last = isam.variables.factors[pose].last();
    let last_factor = last.map(|&slot| isam.factors.at(slot).factor.description());
    match (weak.finite, last_factor) {
        (false, Some(factor)) => Error::Overflow { factor },
        _ => Error::Unconstrained {
            key: isam.variables.keys[pose],
            last_factor,
        },
    }
}

/// Everything as it was before the update.
fn undo<G: Group>(
    isam: &mut Isam2<G>,
    poses_before: usize,
    new: &[FactorId],
    taken: Vec<Removed<G>>,
) {
    for slot in isam.work.fresh.drain(..) {
        isam.tree.remove(slot);
    }
    for &slot in &isam.work.marked {
        isam.tree.cliques[slot as usize].is_marked = false;
    }
    for moved in isam.work.moved.drain(..).rev() {
        let pose = moved.pose as usize;
        isam.variables.points[pose] = moved.point;
        isam.variables.steps[pose] = moved.step;
        isam.variables.passed_on[pose] = moved.passed_on;
        if !isam.variables.is_pending[pose] {
            // It was taken from the list; whether it is over the threshold is looked at again.
            isam.variables.is_pending[pose] = true;
            isam.work.pending.push(moved.pose);
        }
    }
    for id in new.iter().rev() {
        if let Some(bound) = isam.factors.remove(*id) {
            isam.variables.factors[bound.from as usize].pop();
            if bound.from != bound.to {
                isam.variables.factors[bound.to as usize].pop();
            }
        }
    }
    put_back(isam, taken);
    isam.variables.truncate(poses_before);
    isam.work.local.truncate(poses_before);
    isam.anchors.resize(poses_before);
    isam.anchors.invalidate();
}

/// Puts the new cliques into the place of the marked ones.
fn commit<G: Group>(isam: &mut Isam2<G>, taken: &[Removed<G>]) {
    for one in taken {
        isam.factors.release(one.id);
    }
    let work = &mut isam.work;
    let tree = &mut isam.tree;
    for (&slot, &parent) in work.orphans.iter().zip(&work.orphan_parent) {
        let parent = work.fresh[parent as usize];
        // A subtree below a clique that waited for steps waits for them now.
        let above = tree.cliques[slot as usize].parent;
        let since = tree.cliques[above as usize].waiting_since;
        if since != 0 {
            let orphan = &mut tree.cliques[slot as usize];
            if orphan.waiting_since == 0 {
                work.waiting.push(slot);
                orphan.waiting_since = since;
            } else {
                orphan.waiting_since = orphan.waiting_since.min(since);
            }
        }
        tree.attach(slot, parent);
    }
    for &slot in &work.marked {
        tree.remove(slot);
    }
    for (planned, &slot) in work.plan.cliques.iter().zip(&work.fresh) {
        let parent = match planned.parent {
            NONE => NONE,
            parent => work.fresh[parent as usize],
        };
        tree.attach(slot, parent);
        for &pose in tree.cliques[slot as usize].frontal() {
            isam.variables.clique[pose as usize] = slot;
        }
    }
}
