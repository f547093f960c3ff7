//! Exact nearest neighbours: a balanced k-d tree with wide leaves.
//!
//! In: positions. Out: indices into them with squared distances. The tree is complete, so that a
//! node's children are found by arithmetic; a leaf is up to 16 points in structure-of-arrays form,
//! whose distances the compiler computes four or eight at a time. Building and searching are
//! iterative. Against kiddo 6.3 (immutable) on one VLP-16 turn this is what made own code worth
//! its lines: see BENCHMARKS.md.

use alloc::vec::Vec;

const LEAF: usize = 16;
/// Depth of a tree over `u32::MAX` points, and so the most entries a search can postpone.
const MAX_DEPTH: usize = 32;

/// A point of the tree and how far it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Position in the slice the tree was built from.
    pub index: u32,
    /// Squared distance, m².
    pub distance_sq: f32,
}

/// The `K` nearest, nearest first.
#[derive(Debug, Clone)]
pub struct NearestK<const K: usize> {
    found: [Neighbour; K],
    len: usize,
}

impl<const K: usize> Default for NearestK<K> {
    fn default() -> Self {
        Self {
            found: [Neighbour {
                index: 0,
                distance_sq: f32::INFINITY,
            }; K],
            len: 0,
        }
    }
}

impl<const K: usize> NearestK<K> {
    /// The neighbours found, nearest first; fewer than `K` if the cloud has fewer.
    pub fn as_slice(&self) -> &[Neighbour] {
        &self.found[..self.len]
    }

    /// Squared distance a point must undercut to be taken.
    fn worst(&self) -> f32 {
        if self.len < K {
            f32::INFINITY
        } else {
            self.found[K - 1].distance_sq
        }
    }

    fn insert(&mut self, new: Neighbour) {
        let mut at = self.len.min(K - 1);
        while at > 0 && self.found[at - 1].distance_sq > new.distance_sq {
            self.found[at] = self.found[at - 1];
            at -= 1;
        }
        self.found[at] = new;
        self.len = (self.len + 1).min(K);
    }
}

#[derive(Debug, Clone, Copy)]
struct Split {
    axis: u32,
    at: f32,
}

#[derive(Debug, Clone)]
#[repr(align(64))]
struct Leaf {
    coordinates: [[f32; LEAF]; 3],
    index: [u32; LEAF],
}

const EMPTY_LEAF: Leaf = Leaf {
    coordinates: [[f32::INFINITY; LEAF]; 3],
    index: [u32::MAX; LEAF],
};

impl Leaf {
    #[inline]
    fn distances_sq(&self, q: [f32; 3]) -> [f32; LEAF] {
        let [x, y, z] = &self.coordinates;
        let mut out = [0.0; LEAF];
        for i in 0..LEAF {
            let (dx, dy, dz) = (x[i] - q[0], y[i] - q[1], z[i] - q[2]);
            out[i] = dx * dx + dy * dy + dz * dz;
        }
        out
    }
}

/// A k-d tree over positions. Non-finite positions are left out of it.
#[derive(Debug, Clone, Default)]
pub struct KdTree {
    splits: Vec<Split>,
    leaves: Vec<Leaf>,
    entries: Vec<([f32; 3], u32)>,
}

/// A subtree put off: its node, and how far the query is from its box along each axis.
#[derive(Clone, Copy)]
struct Postponed {
    node: u32,
    distance_sq: f32,
    offset: [f32; 3],
}

impl KdTree {
    /// Builds the tree over `points`, reusing its memory.
    pub fn build(&mut self, points: &[[f32; 3]]) {
        self.entries.clear();
        // A few more points than last time must not allocate.
        self.entries.reserve(points.len().next_power_of_two());
        self.entries.extend(
            points
                .iter()
                .zip(0u32..)
                .filter(|(p, _)| p.iter().all(|c| c.is_finite()))
                .map(|(&p, i)| (p, i)),
        );
        let n = self.entries.len();
        let leaf_count = n.div_ceil(LEAF).next_power_of_two();
        let depth = leaf_count.trailing_zeros();
        self.splits.clear();
        self.splits.resize(leaf_count, Split { axis: 0, at: 0.0 });
        // Boundary of the j-th of 2^d equal parts; a parent's boundaries are its children's.
        let boundary = |j: usize, d: u32| ((j as u64 * n as u64) >> d) as usize;
        for level in 0..depth {
            for j in 0..1usize << level {
                let (start, end) = (boundary(j, level), boundary(j + 1, level));
                let middle = boundary(2 * j + 1, level + 1);
                let part = &mut self.entries[start..end];
                let axis = widest_axis(part);
                let at = middle - start;
                let split = if at < part.len() {
                    part.select_nth_unstable_by(at, |a, b| a.0[axis].total_cmp(&b.0[axis]));
                    part[at].0[axis]
                } else {
                    f32::INFINITY
                };
                self.splits[(1 << level) + j] = Split {
                    axis: axis as u32,
                    at: split,
                };
            }
        }
        self.leaves.clear();
        self.leaves.resize(leaf_count, EMPTY_LEAF);
        for (j, leaf) in self.leaves.iter_mut().enumerate() {
            let (start, end) = (boundary(j, depth), boundary(j + 1, depth));
            for (slot, (p, index)) in self.entries[start..end].iter().enumerate() {
                for (axis, &coordinate) in p.iter().enumerate() {
                    leaf.coordinates[axis][slot] = coordinate;
                }
                leaf.index[slot] = *index;
            }
        }
    }

    /// How many points the tree holds.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether the tree holds no point.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The nearest point closer than the root of `max_distance_sq`.
    pub fn nearest(&self, query: [f32; 3], max_distance_sq: f32) -> Option<Neighbour> {
        let mut best = Neighbour {
            index: u32::MAX,
            distance_sq: max_distance_sq,
        };
        self.search(query, max_distance_sq, |neighbour| {
            best = neighbour;
            neighbour.distance_sq
        });
        (best.index != u32::MAX).then_some(best)
    }

    /// The `K` nearest points to `query`, into `found`, which is cleared first.
    pub fn k_nearest<const K: usize>(&self, query: [f32; 3], found: &mut NearestK<K>) {
        found.len = 0;
        self.search(query, f32::INFINITY, |neighbour| {
            found.insert(neighbour);
            found.worst()
        });
    }

    /// Offers every point nearer than the bound to `take`, which answers with the new bound.
    #[inline]
    fn search(&self, query: [f32; 3], bound: f32, mut take: impl FnMut(Neighbour) -> f32) {
        if self.leaves.is_empty() || !query.iter().all(|c| c.is_finite()) {
            return;
        }
        let mut bound = bound;
        let leaf_count = self.leaves.len();
        let mut stack = [Postponed {
            node: 0,
            distance_sq: 0.0,
            offset: [0.0; 3],
        }; MAX_DEPTH];
        let mut depth = 1;
        stack[0].node = 1;
        while depth > 0 {
            depth -= 1;
            let Postponed {
                node,
                distance_sq,
                offset,
            } = stack[depth];
            if distance_sq >= bound {
                continue;
            }
            let mut node = node as usize;
            while node < leaf_count {
                let Split { axis, at } = self.splits[node];
                let axis = axis as usize;
                let difference = query[axis] - at;
                let (near, far) = if difference < 0.0 {
                    (2 * node, 2 * node + 1)
                } else {
                    (2 * node + 1, 2 * node)
                };
                let far_sq = distance_sq - offset[axis] * offset[axis] + difference * difference;
                if far_sq < bound {
                    let mut far_offset = offset;
                    far_offset[axis] = difference;
                    stack[depth] = Postponed {
                        node: far as u32,
                        distance_sq: far_sq,
                        offset: far_offset,
                    };
                    depth += 1;
                }
                node = near;
            }
            let leaf = &self.leaves[node - leaf_count];
            let distances = leaf.distances_sq(query);
            for (&distance_sq, &index) in distances.iter().zip(&leaf.index) {
                if distance_sq < bound {
                    bound = take(Neighbour { index, distance_sq });
                }
            }
        }
    }
}

fn widest_axis(part: &[([f32; 3], u32)]) -> usize {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for (p, _) in part {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let extent = |axis: usize| high[axis] - low[axis];
    let widest = if extent(1) > extent(0) { 1 } else { 0 };
    if extent(2) > extent(widest) {
        2
    } else {
        widest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute(points: &[[f32; 3]], q: [f32; 3]) -> Vec<f32> {
        let mut d: Vec<f32> = points
            .iter()
            .map(|p| (0..3).map(|a| (p[a] - q[a]) * (p[a] - q[a])).sum())
            .collect();
        d.sort_by(f32::total_cmp);
        d
    }

    proptest! {
        #[test]
        fn finds_the_same_distances_as_looking_at_every_point(
            points in prop::collection::vec(prop::array::uniform3(-50.0f32..50.0), 0..600),
            query in prop::array::uniform3(-60.0f32..60.0),
        ) {
            let mut tree = KdTree::default();
            tree.build(&points);
            let truth = brute(&points, query);
            let mut found = NearestK::<10>::default();
            tree.k_nearest(query, &mut found);
            prop_assert_eq!(found.as_slice().len(), points.len().min(10));
            for (n, t) in found.as_slice().iter().zip(&truth) {
                prop_assert!((n.distance_sq - t).abs() <= 1e-4 * t.max(1.0));
            }
            let nearest = tree.nearest(query, f32::INFINITY);
            prop_assert_eq!(nearest.is_some(), !points.is_empty());
            if let Some(n) = nearest {
                prop_assert!((n.distance_sq - truth[0]).abs() <= 1e-4 * truth[0].max(1.0));
            }
        }
    }

    #[test]
    fn a_million_equal_points_are_found_without_running_away() {
        let points = vec![[1.0, 2.0, 3.0]; 1_000_000];
        let mut tree = KdTree::default();
        tree.build(&points);
        let mut found = NearestK::<8>::default();
        tree.k_nearest([1.0, 2.0, 3.5], &mut found);
        assert!(found.as_slice().iter().all(|n| n.distance_sq == 0.25));
    }

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let mut tree = KdTree::default();
        tree.build(&[
            [f32::NAN, 0.0, 0.0],
            [f32::INFINITY, 0.0, 0.0],
            [0.0, 0.0, 2.0],
        ]);
        assert_eq!(tree.len(), 1);
        assert_eq!(tree.nearest([0.0; 3], 9.0).map(|n| n.index), Some(2));
        assert_eq!(tree.nearest([0.0; 3], 4.0), None);
        assert_eq!(tree.nearest([f32::NAN; 3], 4.0), None);
    }
}
