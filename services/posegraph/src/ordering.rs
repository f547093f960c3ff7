//! In which order to eliminate poses so that few new entries arise: approximate minimum degree.
//!
//! In: poses 0 to n, and cliques among them (an edge is a clique of two, a prior of one). Out: an
//! order; poses marked *late* come after all others. Amestoy, Davis, Duff, *An approximate minimum
//! degree ordering algorithm* (1996), on a quotient graph in which every clique is an element from
//! the start, as in Davis et al., *A column approximate minimum degree ordering algorithm* (2004).
//! Ties go to the pose that came to its degree first, so the order depends on nothing but the input.

/// Sets of poses, one after another.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cliques {
    begins: Vec<usize>,
    members: Vec<u32>,
}

impl Cliques {
    pub fn clear(&mut self) {
        self.begins.clear();
        self.members.clear();
    }

    /// Adds a set; a pose may stand in it once.
    pub fn push(&mut self, members: impl IntoIterator<Item = u32>) {
        self.begins.push(self.members.len());
        self.members.extend(members);
    }

    pub fn len(&self) -> usize {
        self.begins.len()
    }

    pub fn get(&self, k: usize) -> &[u32] {
        let end = self.begins.get(k + 1).copied();
        &self.members[self.begins[k]..end.unwrap_or(self.members.len())]
    }
}

const NONE: u32 = u32::MAX;

/// The state of an ordering, kept to be used again.
#[derive(Debug, Clone, Default)]
pub(crate) struct MinimumDegree {
    /// Elements of each pose: a range of `element_lists` each, which only ever shrinks.
    list_begin: Vec<usize>,
    list_len: Vec<u32>,
    element_lists: Vec<u32>,
    /// Poses of each element: a range of `member_lists`. Elements 0..m are the given cliques,
    /// element m + k is what pivot k leaves.
    member_begin: Vec<usize>,
    member_len: Vec<u32>,
    member_lists: Vec<u32>,
    /// Weight of each element, or 0 once it is absorbed.
    weight: Vec<u32>,
    /// How many poses each pose stands for; 0 once it is absorbed or eliminated.
    count: Vec<u32>,
    degree: Vec<u32>,
    /// Poses that one stands for, as a list: next, and the last of the list.
    next_alike: Vec<u32>,
    last_alike: Vec<u32>,
    /// First and last pose of each degree.
    buckets: Vec<u32>,
    bucket_ends: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    pose_mark: Vec<u32>,
    outside: Vec<u32>,
    element_mark: Vec<u32>,
    hashes: Vec<(u64, u32)>,
    pivot_members: Vec<u32>,
}

impl MinimumDegree {
    /// Writes the order of poses `0..n` to `order`.
    pub fn order(
        &mut self,
        n: usize,
        cliques: &Cliques,
        late: impl Fn(usize) -> bool,
        order: &mut Vec<u32>,
    ) {
        self.begin(n, cliques);
        order.clear();
        let mut least = 0;
        for stage in [false, true] {
            for i in 0..n {
                if self.count[i] > 0 && late(i) == stage {
                    self.insert(i as u32);
                    least = least.min(self.degree[i] as usize);
                }
            }
            while let Some(pivot) = self.take_least(&mut least) {
                self.eliminate(pivot, n, &late, stage, order, &mut least);
            }
        }
        debug_assert_eq!(order.len(), n);
    }

    fn begin(&mut self, n: usize, cliques: &Cliques) {
        let m = cliques.len();
        let refill = |v: &mut Vec<u32>, len, value| {
            v.clear();
            v.resize(len, value);
        };
        for v in [&mut self.count, &mut self.list_len] {
            refill(v, n, 0);
        }
        self.count.fill(1);
        for v in [&mut self.degree, &mut self.pose_mark] {
            refill(v, n, 0);
        }
        for v in [&mut self.next_alike, &mut self.next, &mut self.previous] {
            refill(v, n, NONE);
        }
        self.last_alike.clear();
        self.last_alike.extend(0..n as u32);
        refill(&mut self.buckets, n + 1, NONE);
        refill(&mut self.bucket_ends, n + 1, NONE);
        for v in [&mut self.weight, &mut self.element_mark, &mut self.outside] {
            refill(v, m, 0);
        }
        self.member_begin.clear();
        self.member_len.clear();
        self.member_lists.clear();
        self.member_lists.extend_from_slice(&cliques.members);
        self.member_begin.extend_from_slice(&cliques.begins);
        for k in 0..m {
            let members = cliques.get(k);
            self.member_len.push(members.len() as u32);
            self.weight[k] = members.len() as u32;
            for &i in members {
                self.list_len[i as usize] += 1;
                // An upper bound, as sets may overlap.
                self.degree[i as usize] += members.len() as u32 - 1;
            }
        }
        self.list_begin.clear();
        let mut begin = 0;
        for (len, degree) in self.list_len.iter_mut().zip(&mut self.degree) {
            self.list_begin.push(begin);
            begin += *len as usize;
            *len = 0;
            *degree = (*degree).min(n as u32 - 1);
        }
        refill(&mut self.element_lists, begin, 0);
        for k in 0..m {
            for &i in cliques.get(k) {
                let i = i as usize;
                self.element_lists[self.list_begin[i] + self.list_len[i] as usize] = k as u32;
                self.list_len[i] += 1;
            }
        }
    }

    /// Behind all others of its degree: along a chain every second pose goes first, then every second
    /// of what is left, so that the tree of what depends on what is shallow.
    fn insert(&mut self, i: u32) {
        let degree = self.degree[i as usize] as usize;
        let last = core::mem::replace(&mut self.bucket_ends[degree], i);
        self.previous[i as usize] = last;
        self.next[i as usize] = NONE;
        match last {
            NONE => self.buckets[degree] = i,
            last => self.next[last as usize] = i,
        }
    }

    fn unlink(&mut self, i: u32) {
        let degree = self.degree[i as usize] as usize;
        let (before, after) = (self.previous[i as usize], self.next[i as usize]);
        match before {
            NONE => self.buckets[degree] = after,
            before => self.next[before as usize] = after,
        }
        match after {
            NONE => self.bucket_ends[degree] = before,
            after => self.previous[after as usize] = before,
        }
    }

    fn take_least(&mut self, least: &mut usize) -> Option<u32> {
        while *least < self.buckets.len() {
            let i = self.buckets[*least];
            if i != NONE {
                self.unlink(i);
                return Some(i);
            }
            *least += 1;
        }
        *least = 0;
        None
    }

    fn emit(&mut self, i: u32, order: &mut Vec<u32>) {
        self.count[i as usize] = 0;
        let mut k = i;
        while k != NONE {
            order.push(k);
            k = self.next_alike[k as usize];
        }
    }

    /// Members of the element that eliminating `pivot` makes; its elements are absorbed.
    fn absorb(&mut self, pivot: u32) -> u32 {
        let mut members = core::mem::take(&mut self.pivot_members);
        members.clear();
        let begin = self.list_begin[pivot as usize];
        let mut weight = 0;
        for at in begin..begin + self.list_len[pivot as usize] as usize {
            let e = self.element_lists[at] as usize;
            if self.weight[e] == 0 {
                continue;
            }
            self.weight[e] = 0;
            for at in self.member_begin[e]..self.member_begin[e] + self.member_len[e] as usize {
                let i = self.member_lists[at];
                let (count, mark) = (self.count[i as usize], &mut self.pose_mark[i as usize]);
                if count > 0 && *mark == 0 && i != pivot {
                    *mark = 1;
                    weight += count;
                    members.push(i);
                }
            }
        }
        self.pivot_members = members;
        weight
    }

    fn eliminate(
        &mut self,
        pivot: u32,
        n: usize,
        late: &impl Fn(usize) -> bool,
        stage: bool,
        order: &mut Vec<u32>,
        least: &mut usize,
    ) {
        let mut weight = self.absorb(pivot);
        self.emit(pivot, order);
        let members = core::mem::take(&mut self.pivot_members);
        for &i in &members {
            self.pose_mark[i as usize] = 0;
        }
        self.weigh_outside(&members, pivot);
        let element = self.weight.len() as u32;
        self.hashes.clear();
        for &i in &members {
            if late(i as usize) == stage {
                self.unlink(i);
            }
            let k = i as usize;
            let (begin, len) = (self.list_begin[k], self.list_len[k] as usize);
            let (mut kept, mut outside, mut hash) = (0, 0u32, 0u64);
            for at in begin..begin + len {
                let e = self.element_lists[at];
                if self.weight[e as usize] == 0 {
                    continue;
                }
                if self.outside[e as usize] == 0 {
                    // All its poses are in the new element: it says nothing more.
                    self.weight[e as usize] = 0;
                    continue;
                }
                outside = outside.saturating_add(self.outside[e as usize]);
                hash = hash.wrapping_add(u64::from(e));
                self.element_lists[begin + kept] = e;
                kept += 1;
            }
            if kept == 0 && late(k) == stage {
                // It hangs on nothing else: to eliminate it next costs nothing.
                weight -= self.count[k];
                self.list_len[k] = 0;
                self.emit(i, order);
                continue;
            }
            // One of its elements was absorbed, so there is room for the new one.
            self.element_lists[begin + kept] = element;
            self.list_len[k] = kept as u32 + 1;
            self.degree[k] = outside;
            self.hashes.push((hash, i));
        }
        self.merge_alike(late);
        let remaining = (n - order.len()) as u32;
        self.member_begin.push(self.member_lists.len());
        for &i in &members {
            let k = i as usize;
            let count = self.count[k];
            if count == 0 {
                continue;
            }
            self.member_lists.push(i);
            let degree = self.degree[k].saturating_add(weight - count);
            self.degree[k] = degree.min(remaining - count);
            if late(k) == stage {
                self.insert(i);
                *least = (*least).min(self.degree[k] as usize);
            }
        }
        let begin = self.member_begin[element as usize];
        self.member_len
            .push((self.member_lists.len() - begin) as u32);
        self.weight.push(weight);
        self.element_mark.push(0);
        self.outside.push(0);
        self.pivot_members = members;
    }

    /// For every element that touches the new one: the weight of its poses outside.
    fn weigh_outside(&mut self, members: &[u32], pivot: u32) {
        let mark = pivot + 1;
        for &i in members {
            let begin = self.list_begin[i as usize];
            for at in begin..begin + self.list_len[i as usize] as usize {
                let e = self.element_lists[at] as usize;
                if self.weight[e] == 0 {
                    continue;
                }
                if self.element_mark[e] != mark {
                    self.element_mark[e] = mark;
                    self.outside[e] = self.weight[e];
                }
                self.outside[e] -= self.count[i as usize];
            }
        }
    }

    /// Poses with the same elements are eliminated together from now on.
    fn merge_alike(&mut self, late: &impl Fn(usize) -> bool) {
        let mut hashes = core::mem::take(&mut self.hashes);
        hashes.sort_unstable();
        for run in hashes.chunk_by(|a, b| a.0 == b.0) {
            for a in 0..run.len() {
                let i = run[a].1;
                if self.count[i as usize] == 0 {
                    continue;
                }
                for &(_, j) in &run[a + 1..] {
                    if self.count[j as usize] > 0
                        && late(i as usize) == late(j as usize)
                        && self.elements(i) == self.elements(j)
                    {
                        self.count[i as usize] += self.count[j as usize];
                        self.count[j as usize] = 0;
                        let last = self.last_alike[i as usize];
                        self.next_alike[last as usize] = j;
                        self.last_alike[i as usize] = self.last_alike[j as usize];
                    }
                }
            }
        }
        self.hashes = hashes;
    }

    fn elements(&self, i: u32) -> &[u32] {
        let begin = self.list_begin[i as usize];
        &self.element_lists[begin..begin + self.list_len[i as usize] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn edges(list: &[(u32, u32)]) -> Cliques {
        let mut cliques = Cliques::default();
        list.iter().for_each(|&(a, b)| cliques.push([a, b]));
        cliques
    }

    fn ordered(n: usize, cliques: &Cliques, late: &[u32]) -> Vec<u32> {
        let mut order = Vec::new();
        let is_late = |i: usize| late.contains(&(i as u32));
        MinimumDegree::default().order(n, cliques, is_late, &mut order);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..n as u32).collect::<Vec<_>>(), "a permutation");
        order
    }

    /// New entries by elimination on sets, the slow way.
    fn fill(n: usize, cliques: &Cliques, order: &[u32]) -> usize {
        let mut near = vec![BTreeSet::new(); n];
        for k in 0..cliques.len() {
            for &a in cliques.get(k) {
                for &b in cliques.get(k) {
                    if a != b {
                        near[a as usize].insert(b);
                    }
                }
            }
        }
        let mut entries = 0;
        for &i in order {
            let around: Vec<u32> = near[i as usize].iter().copied().collect();
            entries += around.len();
            for &a in &around {
                near[a as usize].remove(&i);
                near[a as usize].extend(around.iter().filter(|&&b| b != a));
            }
        }
        entries
    }

    fn grid(side: u32) -> Cliques {
        let mut list = Vec::new();
        for y in 0..side {
            for x in 0..side {
                let i = y * side + x;
                if x + 1 < side {
                    list.push((i, i + 1));
                }
                if y + 1 < side {
                    list.push((i, i + side));
                }
            }
        }
        edges(&list)
    }

    #[test]
    fn a_tree_gets_no_new_entries() {
        let star: Vec<_> = (1..50).map(|k| (0, k)).collect();
        let path: Vec<_> = (1..50).map(|k| (k - 1, k)).collect();
        for list in [star, path] {
            let cliques = edges(&list);
            let order = ordered(50, &cliques, &[]);
            assert_eq!(fill(50, &cliques, &order), 49);
        }
    }

    #[test]
    fn a_grid_gets_far_fewer_entries_than_row_by_row() {
        let cliques = grid(30);
        let by_degree = fill(900, &cliques, &ordered(900, &cliques, &[]));
        let by_row = fill(900, &cliques, &(0..900).collect::<Vec<_>>());
        // Row by row: 30 entries for nearly each of 900; nested dissection needs about 8,000.
        assert!(by_row > 26_000, "{by_row}");
        assert!(by_degree < 12_000, "{by_degree}");
    }

    #[test]
    fn late_poses_come_last() {
        let cliques = grid(12);
        let order = ordered(144, &cliques, &[0, 5, 77]);
        let mut last = order[141..].to_vec();
        last.sort_unstable();
        assert_eq!(last, [0, 5, 77]);
    }

    #[test]
    fn loose_poses_and_lone_priors_are_ordered_too() {
        let mut cliques = edges(&[(1, 2)]);
        cliques.push([0]);
        cliques.push([2, 3, 4]);
        assert_eq!(ordered(7, &cliques, &[2]).last(), Some(&2));
        assert_eq!(ordered(0, &Cliques::default(), &[]), []);
    }
}
