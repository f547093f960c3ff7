//! The Bayes tree: cliques in slots, linked by index.

use super::pool::Pool;
use crate::symbolic::NONE;

/// Poses that are eliminated together (frontal), given those they depend on (separator).
#[derive(Debug, Clone)]
pub(crate) struct Clique {
    pub parent: u32,
    pub first_child: u32,
    pub next_sibling: u32,
    /// How many of `variables` are frontal; they come first.
    pub frontals: u32,
    pub variables: Vec<u32>,
    /// A column for every number of every pose, each with a row for every number and one for the
    /// right-hand side. Those of frontal poses are Cholesky's factor, those of the separator what is
    /// left to it. Only the lower triangle means anything.
    pub numbers: Vec<f64>,
    /// The pass since which steps of its separator were not passed on to it; 0 if they were.
    pub waiting_since: u32,
    /// Made in this update.
    pub is_fresh: bool,
    /// To be replaced in this update.
    pub is_marked: bool,
}

impl Clique {
    pub fn frontal(&self) -> &[u32] {
        &self.variables[..self.frontals as usize]
    }

    pub fn separator(&self) -> &[u32] {
        &self.variables[self.frontals as usize..]
    }
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    pub cliques: Vec<Clique>,
    free: Vec<u32>,
    pub pool: Pool,
}

impl Tree {
    /// A fresh clique without poses.
    pub fn add(&mut self) -> u32 {
        if let Some(slot) = self.free.pop() {
            self.cliques[slot as usize].is_fresh = true;
            return slot;
        }
        self.cliques.push(Clique {
            parent: NONE,
            first_child: NONE,
            next_sibling: NONE,
            frontals: 0,
            variables: Vec::new(),
            numbers: Vec::new(),
            waiting_since: 0,
            is_fresh: true,
            is_marked: false,
        });
        self.cliques.len() as u32 - 1
    }

    /// Frees a slot.
    pub fn remove(&mut self, slot: u32) {
        let clique = &mut self.cliques[slot as usize];
        self.pool.give(core::mem::take(&mut clique.numbers));
        clique.variables.clear();
        clique.frontals = 0;
        clique.parent = NONE;
        clique.first_child = NONE;
        clique.next_sibling = NONE;
        clique.waiting_since = 0;
        clique.is_fresh = false;
        clique.is_marked = false;
        self.free.push(slot);
    }

    /// Hangs a clique under another, or nowhere.
    pub fn attach(&mut self, child: u32, parent: u32) {
        let next = match parent {
            NONE => NONE,
            parent => {
                let first = &mut self.cliques[parent as usize].first_child;
                core::mem::replace(first, child)
            }
        };
        let clique = &mut self.cliques[child as usize];
        clique.parent = parent;
        clique.next_sibling = next;
    }

    /// The children of a clique.
    pub fn children(&self, of: u32) -> Children<'_> {
        Children {
            tree: self,
            next: self.cliques[of as usize].first_child,
        }
    }
}

/// Iterates over children.
pub(crate) struct Children<'a> {
    tree: &'a Tree,
    next: u32,
}

impl Iterator for Children<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let slot = self.next;
        if slot == NONE {
            return None;
        }
        self.next = self.tree.cliques[slot as usize].next_sibling;
        Some(slot)
    }
}
