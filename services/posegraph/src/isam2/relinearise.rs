//! Which poses are linearised anew in this update.
//!
//! In: poses whose step is over the threshold, the poses of removed factors, and how much work is
//! allowed. Out: marked cliques, and moved linearisation points. Moving a point changes all factors
//! of the pose, so the cliques of its neighbours are eliminated anew too.

use super::update::mark_up;
use super::variables::largest;
use super::{Isam2, UpdateOptions};
use crate::group::{Dense, Group};
use crate::symbolic::NONE;

/// A pose that is linearised anew, as it was.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moved<G: Group> {
    pub pose: u32,
    pub point: G,
    pub step: G::Tangent,
    pub passed_on: G::Tangent,
}

/// How much this update may do beyond what its factors make necessary, in poses.
pub(super) struct Limits {
    threshold: f64,
    scans_all: bool,
    allowed: usize,
    limit: Option<usize>,
}

/// What updates leave unused adds up to so many times the limit.
const MOST_CREDIT: usize = 1000;

impl Limits {
    pub fn new<G: Group>(isam: &Isam2<G>, options: &UpdateOptions) -> Self {
        let usual = isam.config.relinearise_threshold;
        let threshold = options.relinearise_threshold.unwrap_or(usual);
        let limit = isam.config.work_limit.filter(|_| !options.unlimited);
        Self {
            threshold,
            scans_all: threshold < usual,
            allowed: match limit {
                Some(limit) => isam.work.credit.saturating_add(limit),
                None => usize::MAX,
            },
            limit,
        }
    }

    /// How many poses below the new cliques may be solved.
    pub fn poses_to_solve(&self) -> usize {
        self.limit.unwrap_or(usize::MAX)
    }

    /// What the next update may do more.
    pub fn left<G: Group>(&self, isam: &Isam2<G>) -> usize {
        match self.limit {
            Some(limit) => {
                let spent = isam.work.relinearise_work;
                let most = limit.saturating_mul(MOST_CREDIT);
                self.allowed.saturating_sub(spent).min(most)
            }
            None => 0,
        }
    }
}

/// Chooses poses and marks their cliques; how many were left waiting.
pub(super) fn choose<G: Group>(isam: &mut Isam2<G>, limits: &Limits, forced: &[u32]) -> usize {
    isam.work.moved.clear();
    isam.work.relinearise_work = 0;
    for &pose in forced {
        take(isam, pose);
    }
    let mut candidates = core::mem::take(&mut isam.work.pending);
    let variables = &mut isam.variables;
    if limits.scans_all {
        candidates.clear();
        candidates.extend(0..variables.len() as u32);
    }
    candidates.retain(|&pose| {
        let i = pose as usize;
        let stays = variables.clique[i] != NONE && largest(&variables.steps[i]) >= limits.threshold;
        if !stays {
            variables.is_pending[i] = false;
        }
        stays
    });
    if limits.allowed < usize::MAX {
        // The most urgent first; the earlier pose where two are equally so.
        let steps = &isam.variables.steps;
        candidates.sort_by(|&a, &b| {
            let size = |pose: u32| largest(&steps[pose as usize]);
            size(b).total_cmp(&size(a)).then(a.cmp(&b))
        });
    } else {
        candidates.sort_unstable();
    }
    candidates.retain(|&pose| {
        if forced.binary_search(&pose).is_ok() {
            isam.variables.is_pending[pose as usize] = false;
            return false;
        }
        let spent = isam.work.relinearise_work;
        if limits.allowed < usize::MAX {
            let cost = cost(isam, pose, limits.allowed - spent);
            if cost > limits.allowed - spent {
                isam.variables.is_pending[pose as usize] = true;
                return true;
            }
            isam.work.relinearise_work += cost;
        }
        isam.variables.is_pending[pose as usize] = false;
        take(isam, pose);
        false
    });
    let waiting = candidates.len();
    isam.work.pending = candidates;
    waiting
}

fn take<G: Group>(isam: &mut Isam2<G>, pose: u32) {
    let variables = &isam.variables;
    let i = pose as usize;
    isam.work.moved.push(Moved {
        pose,
        point: variables.points[i],
        step: variables.steps[i],
        passed_on: variables.passed_on[i],
    });
    for k in 0..isam.variables.factors[i].len() {
        let bound = isam.factors.at(isam.variables.factors[i][k]);
        let (from, to) = (bound.from, bound.to);
        mark_up(isam, from);
        mark_up(isam, to);
    }
    mark_up(isam, pose);
}

/// How many poses would be eliminated anew besides those that are already; stops counting beyond
/// `most`.
fn cost<G: Group>(isam: &mut Isam2<G>, pose: u32, most: usize) -> usize {
    let mut counted = core::mem::take(&mut isam.work.counted);
    counted.clear();
    let mut cost = 0;
    let list = &isam.variables.factors[pose as usize];
    'neighbours: for &slot in list {
        let bound = isam.factors.at(slot);
        for end in [bound.from, bound.to] {
            let mut slot = isam.variables.clique[end as usize];
            while slot != NONE {
                let clique = &mut isam.tree.cliques[slot as usize];
                if clique.is_marked {
                    break;
                }
                clique.is_marked = true;
                counted.push(slot);
                cost += clique.frontals as usize;
                if cost > most {
                    break 'neighbours;
                }
                slot = clique.parent;
            }
        }
    }
    for &slot in &counted {
        isam.tree.cliques[slot as usize].is_marked = false;
    }
    isam.work.counted = counted;
    cost
}

/// Moves the linearisation points of the chosen poses to their estimates.
pub(super) fn move_points<G: Group>(isam: &mut Isam2<G>) {
    for moved in &isam.work.moved {
        let i = moved.pose as usize;
        let variables = &mut isam.variables;
        variables.points[i] = variables.estimate(i);
        variables.steps[i] = G::Tangent::zeros();
        variables.passed_on[i] = G::Tangent::zeros();
    }
}
