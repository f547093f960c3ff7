//! The least-cost assignment of rows to columns.
//!
//! In: a matrix of costs, and what it costs to leave a pair apart. Out: the pairs.
//!
//! Shortest augmenting paths with potentials (Jonker and Volgenant, Computing 38, 1987, without
//! its initial steps), O(rows² · columns) for the smaller side as rows. The libraries at hand ask
//! for memory in every call, and the tracker must not: this one keeps its buffers. Its answers
//! are held against `pathfinding::kuhn_munkres` in a test.

/// Costs of every row with every column.
#[derive(Debug, Clone, Default)]
pub struct CostMatrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl CostMatrix {
    /// Forgets what it held; every cost is `cost` now.
    pub fn reset(&mut self, rows: usize, columns: usize, cost: f64) {
        self.rows = rows;
        self.columns = columns;
        self.values.clear();
        self.values.resize(rows * columns, cost);
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The cost of a pair.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    /// Sets the cost of a pair.
    pub fn set(&mut self, row: usize, column: usize, cost: f64) {
        self.values[row * self.columns + column] = cost;
    }
}

/// Marks a row or column that has no partner yet.
const FREE: usize = usize::MAX;

/// The solver and its buffers.
#[derive(Debug, Clone, Default)]
pub struct Assignment {
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
    row_of_column: Vec<usize>,
    /// The column before this one on the shortest path.
    previous: Vec<usize>,
    distance: Vec<f64>,
    visited: Vec<bool>,
    pairs: Vec<(usize, usize)>,
}

impl Assignment {
    /// The pairs (row, column) of least total cost, in the order of rows. A pair whose cost is
    /// `apart` or more, or no number, stays apart and counts as `apart`.
    pub fn solve(&mut self, costs: &CostMatrix, apart: f64) -> &[(usize, usize)] {
        let transposed = costs.rows > costs.columns;
        let cost = |i: usize, j: usize| {
            let (row, column) = if transposed { (j, i) } else { (i, j) };
            let cost = costs.get(row, column);
            // Not `min`: it would keep `apart` for a NaN only by the order of its arguments.
            if cost < apart { cost } else { apart }
        };
        let (rows, columns) = match transposed {
            true => (costs.columns, costs.rows),
            false => (costs.rows, costs.columns),
        };
        self.prepare(rows, columns);
        for row in 0..rows {
            self.add_row(row, columns, &cost);
        }
        self.pairs.clear();
        for (j, &i) in self.row_of_column.iter().enumerate() {
            if i != FREE && cost(i, j) < apart {
                self.pairs.push(if transposed { (j, i) } else { (i, j) });
            }
        }
        self.pairs.sort_unstable();
        &self.pairs
    }

    fn prepare(&mut self, rows: usize, columns: usize) {
        fn fill<T: Clone>(buffer: &mut Vec<T>, len: usize, value: T) {
            buffer.clear();
            buffer.resize(len, value);
        }
        fill(&mut self.row_potential, rows, 0.0);
        fill(&mut self.column_potential, columns, 0.0);
        fill(&mut self.row_of_column, columns, FREE);
        fill(&mut self.previous, columns, FREE);
        fill(&mut self.distance, columns, f64::INFINITY);
        fill(&mut self.visited, columns, false);
    }

    /// Finds a partner for one more row along the shortest path to a free column.
    fn add_row(&mut self, new_row: usize, columns: usize, cost: &impl Fn(usize, usize) -> f64) {
        self.distance.fill(f64::INFINITY);
        self.visited.fill(false);
        let (mut row, mut at) = (new_row, FREE);
        let free_column = loop {
            let base = if at == FREE { 0.0 } else { self.distance[at] };
            let mut next = (f64::INFINITY, FREE);
            for j in 0..columns {
                if self.visited[j] {
                    continue;
                }
                let reduced = cost(row, j) - self.row_potential[row] - self.column_potential[j];
                if base + reduced < self.distance[j] {
                    self.distance[j] = base + reduced;
                    self.previous[j] = at;
                }
                if self.distance[j] < next.0 {
                    next = (self.distance[j], j);
                }
            }
            at = next.1;
            self.visited[at] = true;
            match self.row_of_column[at] {
                FREE => break at,
                partner => row = partner,
            }
        };
        let length = self.distance[free_column];
        self.row_potential[new_row] += length;
        for j in 0..columns {
            if self.visited[j] && j != free_column {
                let slack = length - self.distance[j];
                self.row_potential[self.row_of_column[j]] += slack;
                self.column_potential[j] -= slack;
            }
        }
        let mut column = free_column;
        while column != FREE {
            let before = self.previous[column];
            self.row_of_column[column] = match before {
                FREE => new_row,
                before => self.row_of_column[before],
            };
            column = before;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pathfinding::prelude::{Matrix, kuhn_munkres_min};
    use proptest::prelude::*;

    fn matrix(rows: usize, columns: usize, values: &[f64]) -> CostMatrix {
        let mut costs = CostMatrix::default();
        costs.reset(rows, columns, 0.0);
        costs.values.copy_from_slice(values);
        costs
    }

    #[test]
    fn the_greedy_choice_is_not_taken_where_it_costs_more() {
        let costs = matrix(2, 2, &[1.0, 2.0, 2.0, 9.0]);
        assert_eq!(Assignment::default().solve(&costs, 100.0), [(0, 1), (1, 0)]);
    }

    #[test]
    fn what_is_no_number_or_too_dear_stays_apart() {
        let costs = matrix(2, 2, &[f64::NAN, 5.0, f64::INFINITY, 0.5]);
        assert_eq!(Assignment::default().solve(&costs, 5.0), [(1, 1)]);
    }

    #[test]
    fn nothing_with_nothing_is_nothing() {
        let mut solver = Assignment::default();
        assert!(solver.solve(&matrix(0, 3, &[]), 1.0).is_empty());
        assert!(solver.solve(&matrix(3, 0, &[]), 1.0).is_empty());
    }

    proptest! {
        #[test]
        fn costs_as_little_as_the_library_says(
            rows in 1..8_usize,
            columns in 1..8_usize,
            numbers in prop::collection::vec(0..60_i64, 64),
        ) {
            // The library takes integers and at most as many rows as columns.
            let apart = 40;
            let capped: Vec<i64> = numbers[..rows * columns].iter().map(|&n| n.min(apart)).collect();
            let values: Vec<f64> = numbers[..rows * columns].iter().map(|&n| n as f64).collect();
            let mut weights = Matrix::from_vec(rows, columns, capped).unwrap();
            if rows > columns {
                weights.transpose();
            }
            let (least, _) = kuhn_munkres_min(&weights);
            let costs = matrix(rows, columns, &values);
            let mut solver = Assignment::default();
            let pairs = solver.solve(&costs, apart as f64);
            let paid: f64 = pairs.iter().map(|&(i, j)| costs.get(i, j)).sum();
            let apart_count = rows.min(columns) - pairs.len();
            prop_assert_eq!(paid + (apart_count as i64 * apart) as f64, least as f64);
            let mut taken: Vec<_> = pairs.iter().map(|p| p.1).collect();
            taken.sort_unstable();
            taken.dedup();
            prop_assert_eq!(taken.len(), pairs.len());
        }
    }
}
