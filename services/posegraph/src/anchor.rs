//! Which poses are tied to a prior by factors that leave no direction open.
//!
//! Such a pose can't be free, whatever rounding makes of its pivot: at the end of a very long chain
//! what is known of the last pose is below the rounding of what its last factor says.
//! In: factors as they are added. Out: [`Anchors::is_held`]. Sets are joined by size, so a look-up
//! takes logarithmically many steps; removing a factor makes the next question build them anew.

use crate::factor::FactorKind;
use crate::group::Group;
use crate::slab::{Bound, Slab};

#[derive(Debug, Clone, Default)]
pub(crate) struct Anchors {
    parent: Vec<u32>,
    size: Vec<u32>,
    held: Vec<bool>,
    stale: bool,
}

impl Anchors {
    /// Factors were removed, or an update taken back.
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    pub fn resize(&mut self, poses: usize) {
        self.parent.truncate(poses);
        self.size.truncate(poses);
        self.held.truncate(poses);
        for i in self.parent.len()..poses {
            self.parent.push(i as u32);
            self.size.push(1);
            self.held.push(false);
        }
    }

    pub fn add<G: Group>(&mut self, bound: &Bound<G>) {
        if !bound.definite {
            return;
        }
        let a = self.root(bound.from);
        if bound.factor.kind() == FactorKind::Prior {
            self.held[a] = true;
            return;
        }
        let b = self.root(bound.to);
        if a == b {
            return;
        }
        let (large, small) = if self.size[a] < self.size[b] {
            (b, a)
        } else {
            (a, b)
        };
        self.parent[small] = large as u32;
        self.size[large] += self.size[small];
        self.held[large] |= self.held[small];
    }

    /// Ties a pose itself.
    pub fn hold(&mut self, pose: u32) {
        let root = self.root(pose);
        self.held[root] = true;
    }

    /// Whether the pose is tied, by what was added since the last question.
    pub fn holds(&self, pose: u32) -> bool {
        self.held[self.root(pose)]
    }

    fn root(&self, pose: u32) -> usize {
        let mut i = pose as usize;
        while self.parent[i] as usize != i {
            i = self.parent[i] as usize;
        }
        i
    }

    /// Whether the pose is tied to a prior.
    pub fn is_held<G: Group>(&mut self, pose: u32, factors: &Slab<Bound<G>>) -> bool {
        if self.stale {
            let poses = self.parent.len();
            self.resize(0);
            self.resize(poses);
            factors.iter().for_each(|(_, bound)| self.add(bound));
            self.stale = false;
        }
        self.holds(pose)
    }
}
