//! From an order of elimination to cliques: who depends on whom, before any number is touched.
//!
//! In: an order of poses and the cliques among them (factors; separators of subtrees that stay).
//! Out: a [`Plan`], children before parents. A clique is joined with its parent where they are, or
//! nearly are, about the same poses.

use crate::ordering::Cliques;

/// No clique, no pose.
pub(crate) const NONE: u32 = u32::MAX;

/// One clique to be: a range of [`Plan::variables`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planned {
    pub begin: usize,
    pub frontals: usize,
    pub end: usize,
    /// Index in the plan, or `NONE`.
    pub parent: u32,
    /// Children in the plan, linked by `next_child`.
    pub first_child: u32,
    pub next_child: u32,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Plan {
    pub cliques: Vec<Planned>,
    /// Poses, as they are numbered in the order.
    pub variables: Vec<u32>,
    /// For each pose: the planned clique that eliminates it.
    pub clique_of: Vec<u32>,
    /// For each pose: its place in the order.
    pub place: Vec<u32>,
    // By place:
    first_clique: Vec<u32>,
    next_clique: Vec<u32>,
    first_child: Vec<u32>,
    next_child: Vec<u32>,
    depends: Vec<(usize, usize)>,
    dependencies: Vec<u32>,
    first_frontal: Vec<u32>,
    next_frontal: Vec<u32>,
    frontals: Vec<u32>,
    /// Zeros stored because of joining.
    zeros: Vec<usize>,
    is_joined: Vec<bool>,
    mark: Vec<u32>,
}

/// A clique joins its parent if zeros are at most this share of what its columns then hold,
const ZEROS_SHARE: f64 = 0.05;
/// or, where the joined clique has no more poses than this to eliminate,
const SMALL: usize = 4;
/// at most this: fewer, larger cliques have less overhead.
const SMALL_ZEROS_SHARE: f64 = 0.35;

impl Plan {
    /// Plans the elimination of `order`.
    pub fn make(&mut self, order: &[u32], cliques: &Cliques) {
        let n = order.len();
        self.begin(order, cliques);
        for j in 0..n {
            self.collect(j, cliques);
            self.join_children(j);
        }
        self.write(order);
    }

    fn begin(&mut self, order: &[u32], cliques: &Cliques) {
        let n = order.len();
        for v in [
            &mut self.first_clique,
            &mut self.first_child,
            &mut self.next_child,
            &mut self.next_frontal,
            &mut self.mark,
            &mut self.clique_of,
            &mut self.place,
        ] {
            v.clear();
            v.resize(n, NONE);
        }
        self.next_clique.clear();
        self.next_clique.resize(cliques.len(), NONE);
        self.is_joined.clear();
        self.is_joined.resize(n, false);
        self.first_frontal.clear();
        self.frontals.clear();
        self.zeros.clear();
        self.depends.clear();
        self.dependencies.clear();
        for (place, &i) in order.iter().enumerate() {
            self.place[i as usize] = place as u32;
        }
        for k in 0..cliques.len() {
            let places = cliques.get(k).iter().map(|&i| self.place[i as usize]);
            if let Some(first) = places.min() {
                let list = &mut self.first_clique[first as usize];
                self.next_clique[k] = core::mem::replace(list, k as u32);
            }
        }
    }

    /// What the pose at place `j` depends on: places after it, ascending.
    fn collect(&mut self, j: usize, cliques: &Cliques) {
        let begin = self.dependencies.len();
        let mark = j as u32;
        self.mark[j] = mark;
        let mut k = self.first_clique[j];
        while k != NONE {
            for &i in cliques.get(k as usize) {
                let place = self.place[i as usize];
                if self.mark[place as usize] != mark {
                    self.mark[place as usize] = mark;
                    self.dependencies.push(place);
                }
            }
            k = self.next_clique[k as usize];
        }
        let mut child = self.first_child[j];
        while child != NONE {
            let (from, to) = self.depends[child as usize];
            for at in from..to {
                let place = self.dependencies[at];
                if self.mark[place as usize] != mark {
                    self.mark[place as usize] = mark;
                    self.dependencies.push(place);
                }
            }
            child = self.next_child[child as usize];
        }
        self.dependencies[begin..].sort_unstable();
        let end = self.dependencies.len();
        self.depends.push((begin, end));
        self.first_frontal.push(mark);
        self.frontals.push(1);
        self.zeros.push(0);
        if begin < end {
            let parent = self.dependencies[begin] as usize;
            self.next_child[j] = core::mem::replace(&mut self.first_child[parent], mark);
        }
    }

    fn join_children(&mut self, j: usize) {
        let own = self.depends[j].1 - self.depends[j].0;
        let mut child = self.first_child[j];
        while child != NONE {
            let c = child as usize;
            let frontals = self.frontals[j] as usize;
            let theirs = self.frontals[c] as usize;
            let separator = self.depends[c].1 - self.depends[c].0;
            let zeros = theirs * (frontals + own - separator);
            let joined = theirs + frontals;
            let zeros = self.zeros[c] + zeros;
            let stored = theirs * (theirs + 1) / 2 + theirs * (frontals + own);
            let share = zeros as f64 / stored as f64;
            if share <= ZEROS_SHARE || (joined <= SMALL && share <= SMALL_ZEROS_SHARE) {
                self.zeros[j] += zeros;
                // The child's poses come first.
                self.next_frontal[c] = self.first_frontal[j];
                self.first_frontal[j] = self.first_frontal[c];
                self.frontals[j] += self.frontals[c];
                self.is_joined[c] = true;
            }
            child = self.next_child[c];
        }
    }

    fn write(&mut self, order: &[u32]) {
        self.cliques.clear();
        self.variables.clear();
        for j in 0..order.len() {
            if self.is_joined[j] {
                continue;
            }
            let begin = self.variables.len();
            let number = self.cliques.len() as u32;
            let mut place = self.first_frontal[j];
            while place != NONE {
                let i = order[place as usize];
                self.clique_of[i as usize] = number;
                self.variables.push(i);
                place = if place == j as u32 {
                    NONE
                } else {
                    self.next_frontal[place as usize]
                };
            }
            let (from, to) = self.depends[j];
            let separator = self.dependencies[from..to].iter();
            self.variables
                .extend(separator.map(|&place| order[place as usize]));
            self.cliques.push(Planned {
                begin,
                frontals: self.frontals[j] as usize,
                end: self.variables.len(),
                parent: NONE,
                first_child: NONE,
                next_child: NONE,
            });
        }
        for k in 0..self.cliques.len() {
            let Planned {
                begin,
                frontals,
                end,
                ..
            } = self.cliques[k];
            if begin + frontals < end {
                let next = self.variables[begin + frontals];
                let parent = self.clique_of[next as usize];
                self.cliques[k].parent = parent;
                let list = &mut self.cliques[parent as usize].first_child;
                self.cliques[k].next_child = core::mem::replace(list, k as u32);
            }
        }
    }

    /// The poses so that every clique's descendants come right before it.
    pub fn post_order(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.place.len());
        // From the roots down, then backwards: every clique before its descendants becomes after.
        let mut stack: Vec<u32> = Vec::new();
        for (k, clique) in self.cliques.iter().enumerate() {
            if clique.parent == NONE {
                stack.push(k as u32);
            }
        }
        let mut visited = Vec::with_capacity(self.cliques.len());
        while let Some(k) = stack.pop() {
            visited.push(k);
            let mut child = self.cliques[k as usize].first_child;
            while child != NONE {
                stack.push(child);
                child = self.cliques[child as usize].next_child;
            }
        }
        for &k in visited.iter().rev() {
            let clique = &self.cliques[k as usize];
            order.extend_from_slice(&self.variables[clique.begin..clique.begin + clique.frontals]);
        }
        order
    }
}
