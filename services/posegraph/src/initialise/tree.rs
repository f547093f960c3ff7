//! Poses by following edges outward from the poses that are held.

use std::collections::VecDeque;

use crate::factor::FactorKind;
use crate::graph::Graph;
use crate::group::Group;

/// The factors of each pose, one list after another.
struct Neighbours {
    begin: Vec<usize>,
    /// Index of the factor, in the order of the graph.
    factors: Vec<u32>,
}

impl Neighbours {
    fn of<G: Group>(graph: &Graph<G>) -> Self {
        let mut begin = vec![0; graph.poses.len() + 1];
        let ends = |bound: &crate::slab::Bound<G>| [bound.from as usize, bound.to as usize];
        for (_, bound) in graph.factors.iter() {
            for i in ends(bound) {
                begin[i + 1] += 1;
            }
        }
        for i in 0..graph.poses.len() {
            begin[i + 1] += begin[i];
        }
        let mut next = begin.clone();
        let mut factors = vec![0; begin[graph.poses.len()]];
        for (id, bound) in graph.factors.iter() {
            for i in ends(bound) {
                factors[next[i]] = id.slot;
                next[i] += 1;
            }
        }
        Self { begin, factors }
    }
}

/// Composes poses along a spanning tree, breadth first, from fixed poses, poses with a prior, and, in
/// parts without either, from the pose with the smallest key where it is. Odometry is followed as far
/// as it goes before a loop is.
pub fn spanning_tree<G: Group>(graph: &mut Graph<G>) {
    let mut growth = Growth::new(graph);
    for i in 0..graph.poses.len() {
        if graph.is_fixed[i] {
            growth.place(graph, i as u32, graph.poses[i]);
        }
    }
    let priors: Vec<(u32, G)> = graph
        .factors
        .iter()
        .filter(|(_, bound)| bound.factor.kind() == FactorKind::Prior)
        .map(|(_, bound)| (bound.to, *bound.factor.measured()))
        .collect();
    for (i, pose) in priors {
        growth.place(graph, i, pose);
    }
    growth.finish(graph);
}

/// The same from the first `given` poses, which stay where they are.
pub(crate) fn complete<G: Group>(graph: &mut Graph<G>, given: usize) {
    let mut growth = Growth::new(graph);
    for i in 0..given {
        growth.place(graph, i as u32, graph.poses[i]);
    }
    growth.finish(graph);
}

/// A tree that grows: edges that lead out of it wait in two queues.
struct Growth {
    neighbours: Neighbours,
    is_placed: Vec<bool>,
    odometry: VecDeque<(u32, u32)>,
    loops: VecDeque<(u32, u32)>,
}

impl Growth {
    fn new<G: Group>(graph: &Graph<G>) -> Self {
        Self {
            neighbours: Neighbours::of(graph),
            is_placed: vec![false; graph.poses.len()],
            odometry: VecDeque::new(),
            loops: VecDeque::new(),
        }
    }

    /// Places a pose, unless it has its place.
    fn place<G: Group>(&mut self, graph: &mut Graph<G>, i: u32, pose: G) {
        if core::mem::replace(&mut self.is_placed[i as usize], true) {
            return;
        }
        graph.poses[i as usize] = pose;
        let list = &self.neighbours;
        let range = list.begin[i as usize]..list.begin[i as usize + 1];
        for &slot in &list.factors[range] {
            match graph.factors.at(slot).factor.kind() {
                FactorKind::Prior => {}
                FactorKind::Between => self.odometry.push_back((i, slot)),
                FactorKind::Loop => self.loops.push_back((i, slot)),
            }
        }
    }

    /// Follows all edges; begins new trees where none lead.
    fn finish<G: Group>(mut self, graph: &mut Graph<G>) {
        let mut starts: Vec<u32> = (0..graph.poses.len() as u32).collect();
        starts.sort_unstable_by_key(|&i| graph.keys[i as usize]);
        let mut starts = starts.into_iter();
        loop {
            while let Some((from, slot)) = self.next_edge() {
                let bound = *graph.factors.at(slot);
                let pose = &graph.poses[from as usize];
                let (to, reached) = if bound.from == from {
                    (bound.to, pose.compose(bound.factor.measured()))
                } else {
                    let back = bound.factor.measured().inverse();
                    (bound.from, pose.compose(&back))
                };
                self.place(graph, to, reached);
            }
            let Some(i) = starts.next() else {
                return;
            };
            self.place(graph, i, graph.poses[i as usize]);
        }
    }

    fn next_edge(&mut self) -> Option<(u32, u32)> {
        let odometry = self.odometry.pop_front();
        odometry.or_else(|| self.loops.pop_front())
    }
}
