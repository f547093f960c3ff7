//! A scan's points sorted by the direction in which the sensor saw them.
//!
//! In: the points of one scan in the sensor frame and their labels. Out: cells of nearly equal
//! solid angle, each with its points; a lookup visits the 3x3 cells around a direction. A scan is
//! seen from one place with a fixed angular step, so a direction finds neighbours in bounded time
//! where a search in space has to look farther the farther out it is.
//!
//! Rows divide the sine of the elevation evenly (equal solid angle), columns divide a row's
//! circle. The angle around the circle is the *diamond angle* `y / (|x| + |y|)`, monotone in the
//! true angle and free of trigonometry; its columns differ in width by a factor of two at most.

use alloc::vec::Vec;

use hachi_hal::Point;

use crate::float::norm;
use crate::label::Reason;

/// Rows over `[-1, 1]` of the sine: 1/32 is 1.8 degrees at the horizon, just under the 2 degrees
/// between two rings of a 16-beam sensor.
const ROWS: usize = 64;
/// Columns on the horizon: 0.6 to 1.1 degrees each, three to six firings of a turning LiDAR.
const COLUMNS: usize = 400;
/// From so many points on, a scan has 32 rings or more, less than a degree apart: rows and columns
/// are halved, so that a lookup offers no more points than it does for a scan of 16 rings.
const DENSE: usize = 60_000;
/// At most this many points are offered from each row of a lookup, those in the middle: the bound
/// on time when many points share a direction. A row of a 64-beam sensor's lookup holds 70.
const OFFERED_PER_ROW: usize = 96;
/// Distances are computed in blocks of this many.
pub(crate) const LANES: usize = 8;
/// In `cell_of`: the point was not sorted in.
const NOWHERE: u32 = u32::MAX;

/// A point as the grid keeps it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) position: [f32; 3],
    /// Distance from the sensor, metres.
    pub(crate) distance: f32,
    /// Index in the scan.
    pub(crate) index: u32,
}

/// The points of a scan by direction. Keeps its memory from scan to scan.
#[derive(Debug, Clone, Default)]
pub(crate) struct AngularGrid {
    rows: Vec<Row>,
    /// How many times finer than [`ROWS`] and [`COLUMNS`] the cells are, 1 or 2.
    finer: usize,
    /// First entry of each cell in `sorted`, and the end of the last.
    start: Vec<u32>,
    cell_of: Vec<u32>,
    row_of: Vec<u8>,
    sorted: Vec<Seen>,
    /// The positions of `sorted` again, axis by axis: distances are computed four at a time.
    coordinates: [Vec<f32>; 3],
}

#[derive(Debug, Clone, Copy)]
struct Row {
    first_cell: u32,
    columns: u32,
}

/// Where a direction falls.
#[derive(Debug, Clone, Copy)]
struct Direction {
    row: usize,
    /// Around the circle, in `[0, 1)`.
    turn: f32,
}

impl AngularGrid {
    /// Sorts in the points that are still kept.
    pub(crate) fn build(&mut self, points: &[Point], labels: &[Reason]) {
        self.build_where(points, labels, Reason::is_kept);
    }

    /// Sorts in the points whose label `takes` accepts.
    pub(crate) fn build_where(
        &mut self,
        points: &[Point],
        labels: &[Reason],
        takes: impl Fn(Reason) -> bool,
    ) {
        let finer = if points.len() < DENSE { 1 } else { 2 };
        if self.finer != finer {
            self.finer = finer;
            self.lay_out();
        }
        let cells = self.start.len() - 1;
        self.start.fill(0);
        self.cell_of.clear();
        self.row_of.clear();
        let mut sorted_in = 0usize;
        for (point, label) in points.iter().zip(labels) {
            let cell = if takes(*label) {
                self.cell_towards(point.position())
            } else {
                None
            };
            if let Some((cell, _)) = cell {
                self.start[cell as usize] += 1;
                sorted_in += 1;
            }
            let (cell, row) = cell.unwrap_or((NOWHERE, 0));
            self.cell_of.push(cell);
            self.row_of.push(row);
        }
        // Counts to ends; filling from the back turns ends into starts and keeps the scan's order.
        let mut end = 0;
        for slot in &mut self.start[..cells] {
            end += *slot;
            *slot = end;
        }
        self.start[cells] = end;
        const EMPTY: Seen = Seen {
            position: [0.0; 3],
            distance: 0.0,
            index: 0,
        };
        self.sorted.clear();
        self.sorted.resize(sorted_in, EMPTY);
        for (index, &cell) in self.cell_of.iter().enumerate().rev() {
            if cell == NOWHERE {
                continue;
            }
            let slot = &mut self.start[cell as usize];
            *slot -= 1;
            let position = points[index].position();
            self.sorted[*slot as usize] = Seen {
                position,
                distance: norm(position),
                index: index as u32,
            };
        }
        for (axis, coordinates) in self.coordinates.iter_mut().enumerate() {
            coordinates.clear();
            coordinates.extend(self.sorted.iter().map(|seen| seen.position[axis]));
            coordinates.extend([f32::INFINITY; LANES]);
        }
    }

    fn lay_out(&mut self) {
        let (rows, columns) = (ROWS * self.finer, (COLUMNS * self.finer) as f32);
        let mut first_cell = 0;
        self.rows.clear();
        for row in 0..rows {
            let sine = (row as f32 + 0.5) * (2.0 / rows as f32) - 1.0;
            let cosine = crate::float::sqrt(1.0 - sine * sine);
            let columns = ((columns * cosine) as u32).max(1);
            self.rows.push(Row {
                first_cell,
                columns,
            });
            first_cell += columns;
        }
        self.start.clear();
        self.start.resize(first_cell as usize + 1, 0);
    }

    /// How many cells there are; cell numbers are below it.
    pub(crate) fn cells(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// The cell of a point of the scan, if it was sorted in.
    pub(crate) fn cell_of(&self, index: usize) -> Option<u32> {
        self.cell_of
            .get(index)
            .copied()
            .filter(|cell| *cell != NOWHERE)
    }

    /// The row of a point of the scan; 0 if it was not sorted in.
    pub(crate) fn row_of(&self, index: usize) -> usize {
        self.row_of.get(index).copied().map_or(0, usize::from)
    }

    /// The points sorted in, in the order of the scan.
    pub(crate) fn indices(&self) -> impl Iterator<Item = u32> {
        (0..)
            .zip(&self.cell_of)
            .filter(|(_, cell)| **cell != NOWHERE)
            .map(|(index, _)| index)
    }

    /// The positions of the points sorted in, axis by axis, in the order of
    /// [`AngularGrid::sorted`]; [`LANES`] infinities follow, so that a block may begin at any.
    pub(crate) fn coordinates(&self) -> [&[f32]; 3] {
        let [x, y, z] = &self.coordinates;
        [x, y, z]
    }

    /// The points sorted in, cell by cell.
    pub(crate) fn sorted(&self) -> &[Seen] {
        &self.sorted
    }

    /// The points near a direction as ranges of [`AngularGrid::sorted`] and of
    /// [`AngularGrid::coordinates`].
    #[inline]
    pub(crate) fn spans_around(&self, towards: [f32; 3], mut span: impl FnMut(usize, usize)) {
        self.ranges_around(towards, 1, &mut |first, last| {
            self.offer(first, last, &mut span)
        });
    }

    /// As [`AngularGrid::spans_around`], in the direction of a point that was sorted in.
    #[inline]
    pub(crate) fn spans_around_point(&self, index: u32, mut span: impl FnMut(usize, usize)) {
        if let Some(direction) = self.direction_of(index) {
            self.ranges_near(direction, 1, &mut |first, last| {
                self.offer(first, last, &mut span);
            });
        }
    }

    /// The points of a range of cells; those in the middle if there are too many.
    #[inline]
    fn offer(&self, first: u32, last: u32, span: &mut impl FnMut(usize, usize)) {
        let (start, end) = (
            self.start[first as usize] as usize,
            self.start[last as usize] as usize,
        );
        let spare = (end - start).saturating_sub(OFFERED_PER_ROW);
        span(start + spare / 2, end - spare.div_ceil(2));
    }

    /// Runs `visit` on the number of each cell around a direction: as many cells to each side as
    /// make one cell of a grid that is not finer.
    pub(crate) fn cells_around(&self, towards: [f32; 3], mut visit: impl FnMut(u32)) {
        self.ranges_around(towards, self.finer, &mut |first, last| {
            (first..last).for_each(&mut visit);
        });
    }

    /// Where a point that was sorted in falls: in the middle of its cell.
    #[inline]
    fn direction_of(&self, index: u32) -> Option<Direction> {
        let row = self.row_of(index as usize);
        let (cell, own) = (self.cell_of(index as usize)?, self.rows.get(row)?);
        let turn = ((cell - own.first_cell) as f32 + 0.5) / own.columns as f32;
        Some(Direction { row, turn })
    }

    /// The cells around a direction as ranges of cell numbers, none twice.
    #[inline]
    fn ranges_around(&self, towards: [f32; 3], reach: usize, range: &mut impl FnMut(u32, u32)) {
        if let Some(direction) = direction(towards, self.rows.len()) {
            self.ranges_near(direction, reach, range);
        }
    }

    #[inline]
    fn ranges_near(
        &self,
        Direction { row, turn }: Direction,
        reach: usize,
        range: &mut impl FnMut(u32, u32),
    ) {
        let last_row = (row + reach).min(self.rows.len().saturating_sub(1));
        for row in row.saturating_sub(reach)..=last_row {
            let Some(&Row {
                first_cell,
                columns,
            }) = self.rows.get(row)
            else {
                return;
            };
            let (around, end) = (2 * reach as u32 + 1, first_cell + columns);
            if columns <= around {
                range(first_cell, end);
                continue;
            }
            // From the leftmost column on, which may lie before the row's first.
            let first = column(turn, columns) + columns - reach as u32;
            let first = first_cell
                + if first < columns {
                    first
                } else {
                    first - columns
                };
            if first + around <= end {
                range(first, first + around);
            } else {
                range(first, end);
                range(first_cell, first_cell + around - (end - first));
            }
        }
    }

    /// The cell of a direction, and its row.
    fn cell_towards(&self, position: [f32; 3]) -> Option<(u32, u8)> {
        let Direction { row, turn } = direction(position, self.rows.len())?;
        let Row {
            first_cell,
            columns,
        } = *self.rows.get(row)?;
        // Twice ROWS fits.
        Some((first_cell + column(turn, columns), row as u8))
    }
}

#[inline]
fn column(turn: f32, columns: u32) -> u32 {
    ((turn * columns as f32) as u32).min(columns - 1)
}

/// Which of `rows` rows, and where in it; `None` for a point at the sensor or without a usable
/// length.
#[inline]
fn direction(position: [f32; 3], rows: usize) -> Option<Direction> {
    let length = norm(position);
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let [x, y, z] = position;
    // In [0, rows], as the sine is in [-1, 1] but for rounding.
    let row = ((z / length + 1.0) * (rows as f32 * 0.5)) as usize;
    let row = row.min(rows.saturating_sub(1));
    let taxicab = x.abs() + y.abs();
    // In [-1, 1]: -1 is right (-y), 0 ahead, 1 left; behind, it is mirrored.
    let across = if taxicab > 0.0 { y / taxicab } else { 0.0 };
    let quarter_turns = match (x >= 0.0, y >= 0.0) {
        (true, true) => across,
        (false, _) => 2.0 - across,
        (true, false) => 4.0 + across,
    };
    Some(Direction {
        row,
        turn: quarter_turns * 0.25,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    fn ring(count: usize, elevation: f32) -> Vec<Point> {
        (0..count)
            .map(|i| {
                let angle = i as f32 * core::f32::consts::TAU / count as f32;
                let (s, c) = (libm::sinf(angle), libm::cosf(angle));
                Point::at(5.0 * c, 5.0 * s, 5.0 * libm::tanf(elevation))
            })
            .collect()
    }

    #[test]
    fn a_lookup_finds_what_lies_within_half_a_degree_all_around_and_at_the_poles() {
        let mut points = ring(720, 0.1);
        points.extend(ring(40, 1.55));
        points.extend(ring(40, -1.55));
        let labels = vec![Reason::Kept; points.len()];
        let mut grid = AngularGrid::default();
        grid.build(&points, &labels);
        for (i, p) in points.iter().enumerate() {
            let mut near = Vec::new();
            grid.spans_around(p.position(), |first, last| {
                let offered = &grid.sorted()[first..last];
                near.extend(offered.iter().map(|seen| seen.index as usize));
            });
            assert!(near.contains(&i), "{i}");
            let unique: alloc::collections::BTreeSet<_> = near.iter().collect();
            assert_eq!(unique.len(), near.len(), "offered twice around {i}");
            if i < 720 {
                assert!(near.contains(&((i + 1) % 720)) && near.contains(&((i + 719) % 720)));
            }
        }
    }

    #[test]
    fn labelled_points_and_points_without_direction_stay_out() {
        let points = [
            Point::at(0.0, 0.0, 0.0),
            Point::at(1.0, 0.0, 0.0),
            Point::at(1e30, 0.0, 0.0),
        ];
        let mut grid = AngularGrid::default();
        grid.build(&points, &[Reason::Kept, Reason::Range, Reason::Kept]);
        assert!(grid.sorted().is_empty());
        assert!((0..3).all(|i| grid.cell_of(i).is_none()));
    }

    #[test]
    fn a_direction_shared_by_very_many_points_is_thinned() {
        let points = vec![Point::at(3.0, 0.1, 0.1); 100_000];
        let mut grid = AngularGrid::default();
        grid.build(&points, &vec![Reason::Kept; points.len()]);
        let mut offered = 0;
        grid.spans_around([3.0, 0.1, 0.1], |first, last| offered += last - first);
        assert!((1..=OFFERED_PER_ROW).contains(&offered), "{offered}");
    }
}
