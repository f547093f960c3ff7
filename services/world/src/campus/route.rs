//! The streets of a campus as a grid of crossings, and ways along them.
//!
//! In: the sizes of the blocks; stops, or how far to go. Out: places for the robot to walk
//! through. Elsewhere: what the patrols visit (`campus`).

use std::collections::VecDeque;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::START_M;

/// Depth of the blocks around the campus proper, metres.
const BELT_M: [f64; 2] = [52.0, 64.0];

/// A stop of a patrol, by the lines of the campus proper.
#[derive(Debug, Clone, Copy)]
pub(super) enum Stop {
    /// Column line and row line.
    Crossing([usize; 2]),
    /// Through the block of this column and row, from its first crossing to the opposite one.
    Park([usize; 2]),
}

/// The middles of the streets, x of the columns' and y of the rows', the belt's with them. The
/// robot starts on the first row line of the campus proper, after its first crossing.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub lines: [Vec<f64>; 2],
}

impl Grid {
    /// A grid of blocks of these sizes, a belt around them.
    pub fn new(widths: &[f64], heights: &[f64], random: &mut ChaCha8Rng) -> Self {
        let mut lines = |sizes: &[f64], first: f64| {
            let [least, most] = BELT_M;
            let mut lines = vec![first - random.random_range(least..most), first];
            for size in sizes {
                lines.push(lines[lines.len() - 1] + size);
            }
            lines.push(lines[lines.len() - 1] + random.random_range(least..most));
            lines
        };
        Self {
            lines: [lines(widths, -START_M), lines(heights, 0.0)],
        }
    }

    /// The corners of it all.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|end| {
            [0, 1].map(|axis| {
                let lines = &self.lines[axis];
                lines[end * (lines.len() - 1)]
            })
        })
    }

    /// Corner and size of a block, the belt's counted.
    pub fn block(&self, index: [usize; 2]) -> ([f64; 2], [f64; 2]) {
        let low = [0, 1].map(|axis| self.lines[axis][index[axis]]);
        let size = [0, 1].map(|axis| self.lines[axis][index[axis] + 1] - low[axis]);
        (low, size)
    }

    /// A crossing of the campus proper.
    fn crossing(&self, [column, row]: [usize; 2]) -> [f64; 2] {
        [self.lines[0][column + 1], self.lines[1][row + 1]]
    }

    /// How many lines the campus proper has, across and up.
    fn extent(&self) -> [usize; 2] {
        [self.lines[0].len() - 2, self.lines[1].len() - 2]
    }

    /// Places from stop to stop and back to the start; straight ones lead through.
    pub fn way(
        &self,
        stops: &[Stop],
        footpath: impl Fn([f64; 2]) -> Vec<[f64; 2]>,
    ) -> Vec<[f64; 2]> {
        let mut way: Vec<[f64; 2]> = vec![[0.0, 0.0]];
        let mut go = |to: [f64; 2]| {
            // Where the direction stays the same there is no corner to round.
            if let [.., before, last] = way[..] {
                let straight = (0..2).any(|a| before[a] == last[a] && last[a] == to[a]);
                if straight {
                    way.pop();
                }
            }
            way.push(to);
        };
        for stop in stops {
            match *stop {
                Stop::Crossing(crossing) => go(self.crossing(crossing)),
                Stop::Park(block) => {
                    let (low, size) = self.block(block.map(|index| index + 1));
                    for place in footpath(size).into_iter().skip(1) {
                        go([low[0] + place[0], low[1] + place[1]]);
                    }
                }
            }
        }
        go([0.0, 0.0]);
        way.remove(0);
        way
    }
}

/// A patrol of at least `length_m` that at each crossing takes the street it has been in least
/// often, never turns round in a street, and comes back to the start.
pub(super) fn explore(grid: &Grid, length_m: f64, random: &mut ChaCha8Rng) -> Vec<Stop> {
    let [columns, rows] = grid.extent();
    // Streets along x, then along y, by the crossing they begin at.
    let mut visits = vec![0u32; 2 * columns * rows];
    let street = |a: [usize; 2], b: [usize; 2]| {
        let first = [a[0].min(b[0]), a[1].min(b[1])];
        2 * (first[1] * columns + first[0]) + usize::from(a[0] == b[0])
    };
    let (mut before, mut at) = ([0, 0], [1, 0]);
    visits[street(before, at)] += 1;
    let mut stops = vec![Stop::Crossing(at)];
    let mut walked = -START_M;
    while walked < length_m {
        let mut ahead: Vec<[usize; 2]> = neighbours(at, [columns, rows]);
        ahead.retain(|next| *next != before);
        let fewest = ahead.iter().map(|next| visits[street(at, *next)]).min();
        ahead.retain(|next| Some(visits[street(at, *next)]) == fewest);
        let next = ahead[random.random_range(0..ahead.len())];
        visits[street(at, next)] += 1;
        let (from, to) = (grid.crossing(at), grid.crossing(next));
        walked += (to[0] - from[0]).abs() + (to[1] - from[1]).abs();
        (before, at) = (at, next);
        stops.push(Stop::Crossing(at));
    }
    stops.extend(
        homewards(before, at, [columns, rows])
            .into_iter()
            .map(Stop::Crossing),
    );
    stops
}

fn neighbours([column, row]: [usize; 2], [columns, rows]: [usize; 2]) -> Vec<[usize; 2]> {
    let mut found = Vec::with_capacity(4);
    if column + 1 < columns {
        found.push([column + 1, row]);
    }
    if row + 1 < rows {
        found.push([column, row + 1]);
    }
    if column > 0 {
        found.push([column - 1, row]);
    }
    if row > 0 {
        found.push([column, row - 1]);
    }
    found
}

/// The way with the fewest crossings to the first one, entered from above, without turning round.
fn homewards(before: [usize; 2], at: [usize; 2], extent: [usize; 2]) -> Vec<[usize; 2]> {
    let goal = ([0, 1], [0, 0]);
    let start = (before, at);
    let mut reached = vec![(start, usize::MAX)];
    let mut queue = VecDeque::from([0]);
    while let Some(index) = queue.pop_front() {
        let ((before, at), _) = reached[index];
        if (before, at) == goal {
            let mut way = Vec::new();
            let mut step = index;
            while step != 0 {
                let ((_, at), from) = reached[step];
                way.push(at);
                step = from;
            }
            way.reverse();
            return way;
        }
        for next in neighbours(at, extent) {
            let state = (at, next);
            if next != before && reached.iter().all(|(known, _)| *known != state) {
                reached.push((state, index));
                queue.push_back(reached.len() - 1);
            }
        }
    }
    Vec::new()
}
