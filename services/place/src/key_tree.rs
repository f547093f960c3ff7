//! Nearest ring keys: k-d trees that grow.
//!
//! In: keys of whole numbers, one a place. Out: the places with the nearest keys. A static tree
//! can't take one more key, so there are several, each at least twice as large as the next (the
//! logarithmic method of Bentley and Saxe, 1980): a key is built into a tree about log2(n / 64)
//! times in its life, and most insertions only append. Each node knows the box around its keys,
//! which in twenty dimensions keeps far more of the tree out of a search than the splitting planes
//! alone. Distances are whole numbers: the answer does not depend on the trees' shape. No recursion.

/// Keys of a leaf.
const LEAF: usize = 16;
/// Keys that wait for a tree.
const WAITING: usize = 64;

/// A place and how far its key is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Near {
    pub(crate) distance_sq: u32,
    pub(crate) slot: u32,
}

/// All keys, and trees over them. Slots count from 0 in the order of insertion.
#[derive(Debug, Clone, Default)]
pub(crate) struct KeyForest {
    dimensions: usize,
    /// Key after key.
    keys: Vec<u16>,
    /// Largest first; the slots after the last tree's wait.
    trees: Vec<KeyTree>,
    treed: usize,
}

impl KeyForest {
    pub(crate) fn new(dimensions: usize) -> Self {
        Self {
            dimensions,
            ..Self::default()
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.keys.len().checked_div(self.dimensions).unwrap_or(0)
    }

    pub(crate) fn key(&self, slot: usize) -> &[u16] {
        &self.keys[slot * self.dimensions..][..self.dimensions]
    }

    /// Appends the key of the next slot.
    pub(crate) fn push(&mut self, key: &[u16]) {
        debug_assert_eq!(key.len(), self.dimensions);
        self.keys.extend_from_slice(key);
        if self.len() - self.treed < WAITING {
            return;
        }
        // Slots of the trees are consecutive, so the new one takes in its smaller neighbours.
        let mut first = self.treed;
        while let Some(last) = self.trees.last() {
            if last.len > self.len() - first {
                break;
            }
            first = last.first;
            self.trees.pop();
        }
        let slots = first..self.len();
        self.trees
            .push(KeyTree::build(&self.keys, self.dimensions, slots));
        self.treed = self.len();
    }

    /// The `count` nearest keys of slots that `accept` takes, nearest first; of equally near ones
    /// the earlier slot.
    pub(crate) fn nearest(
        &self,
        key: &[u16],
        count: usize,
        mut accept: impl FnMut(u32) -> bool,
        found: &mut Vec<Near>,
    ) {
        found.clear();
        if count == 0 || key.len() != self.dimensions {
            return;
        }
        let mut offer = |near: Near, found: &mut Vec<Near>| {
            if found.len() == count && found.last().is_some_and(|worst| near > *worst)
                || !accept(near.slot)
            {
                return;
            }
            if found.len() == count {
                found.pop();
            }
            let at = found.partition_point(|f| *f < near);
            found.insert(at, near);
        };
        for slot in self.treed..self.len() {
            let distance_sq = distance_sq(key, self.key(slot));
            let slot = slot as u32;
            offer(Near { distance_sq, slot }, found);
        }
        for tree in &self.trees {
            tree.search(key, count, found, &mut offer);
        }
    }
}

fn distance_sq(a: &[u16], b: &[u16]) -> u32 {
    let difference = |(a, b): (&u16, &u16)| u32::from(a.abs_diff(*b));
    a.iter().zip(b).map(difference).map(|d| d * d).sum()
}

/// A complete tree over consecutive slots.
#[derive(Debug, Clone)]
struct KeyTree {
    first: usize,
    len: usize,
    /// Leaves; a power of two.
    leaves: usize,
    /// For node `n` from 1, the root: least and greatest of each dimension.
    boxes: Vec<u16>,
    /// Slots in the order of the leaves.
    slots: Vec<u32>,
    /// For each leaf its keys, dimension by dimension.
    keys: Vec<u16>,
}

impl KeyTree {
    fn build(all: &[u16], dimensions: usize, range: std::ops::Range<usize>) -> Self {
        let len = range.len();
        let leaves = len.div_ceil(LEAF).next_power_of_two();
        let depth = leaves.trailing_zeros();
        let key = |slot: u32| &all[slot as usize * dimensions..][..dimensions];
        let mut slots: Vec<u32> = range.clone().map(|slot| slot as u32).collect();
        let mut boxes = vec![0; 2 * leaves * 2 * dimensions];
        // Boundary of the j-th of 2^d equal parts; a parent's boundaries are its children's.
        let boundary = |j: usize, d: u32| ((j as u64 * len as u64) >> d) as usize;
        for level in 0..=depth {
            for j in 0..1usize << level {
                let part = &mut slots[boundary(j, level)..boundary(j + 1, level)];
                let node = (1 << level) + j;
                let (low, high) =
                    boxes[node * 2 * dimensions..][..2 * dimensions].split_at_mut(dimensions);
                low.fill(u16::MAX);
                for slot in part.iter() {
                    for (d, k) in key(*slot).iter().enumerate() {
                        low[d] = low[d].min(*k);
                        high[d] = high[d].max(*k);
                    }
                }
                if level < depth {
                    let widest = (0..dimensions)
                        .max_by_key(|d| high[*d].saturating_sub(low[*d]))
                        .unwrap_or(0);
                    let at = boundary(2 * j + 1, level + 1) - boundary(j, level);
                    if at < part.len() {
                        part.select_nth_unstable_by_key(at, |slot| (key(*slot)[widest], *slot));
                    }
                }
            }
        }
        let mut keys = vec![0; leaves * LEAF * dimensions];
        for (j, leaf) in keys.chunks_exact_mut(LEAF * dimensions).enumerate() {
            let part = &slots[boundary(j, depth)..boundary(j + 1, depth)];
            for (i, slot) in part.iter().enumerate() {
                for (d, k) in key(*slot).iter().enumerate() {
                    leaf[d * LEAF + i] = *k;
                }
            }
        }
        Self {
            first: range.start,
            len,
            leaves,
            boxes,
            slots,
            keys,
        }
    }

    fn search(
        &self,
        key: &[u16],
        count: usize,
        found: &mut Vec<Near>,
        offer: &mut impl FnMut(Near, &mut Vec<Near>),
    ) {
        let depth = self.leaves.trailing_zeros();
        // Each level postpones one node, and the last one two: 32 levels hold every slot.
        let mut stack = [(0u32, 0u32); 64];
        stack[0] = (self.box_distance_sq(1, key), 1);
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (distance, node) = stack[waiting];
            // An equally near key of an earlier slot may still be wanted.
            if found.len() == count && found.last().is_some_and(|f| distance > f.distance_sq) {
                continue;
            }
            let node = node as usize;
            if node < self.leaves {
                let children = [2 * node, 2 * node + 1]
                    .map(|child| (self.box_distance_sq(child, key), child as u32));
                let [near, far] = match children[1].0 < children[0].0 {
                    true => [children[1], children[0]],
                    false => children,
                };
                stack[waiting] = far;
                stack[waiting + 1] = near;
                waiting += 2;
                continue;
            }
            let leaf = node - self.leaves;
            let boundary = |j: usize| ((j as u64 * self.len as u64) >> depth) as usize;
            let slots = &self.slots[boundary(leaf)..boundary(leaf + 1)];
            for (slot, distance_sq) in slots.iter().zip(self.leaf_distances_sq(leaf, key)) {
                let slot = *slot;
                offer(Near { distance_sq, slot }, found);
            }
        }
    }

    fn leaf_distances_sq(&self, leaf: usize, key: &[u16]) -> [u32; LEAF] {
        let keys = &self.keys[leaf * LEAF * key.len()..][..LEAF * key.len()];
        let mut out = [0; LEAF];
        for (row, k) in keys.chunks_exact(LEAF).zip(key) {
            for (out, value) in out.iter_mut().zip(row) {
                let difference = i32::from(*value) - i32::from(*k);
                *out += (difference * difference) as u32;
            }
        }
        out
    }

    /// From the key to the nearest corner or side of a node's box.
    fn box_distance_sq(&self, node: usize, key: &[u16]) -> u32 {
        let dimensions = key.len();
        let (low, high) =
            self.boxes[node * 2 * dimensions..][..2 * dimensions].split_at(dimensions);
        let mut sum = 0u32;
        for ((k, low), high) in key.iter().zip(low).zip(high) {
            let d = u32::from(low.saturating_sub(*k).max(k.saturating_sub(*high)));
            sum += d * d;
        }
        sum
    }
}
