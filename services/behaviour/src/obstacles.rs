//! What stands around the robot, from the live cloud alone.
//!
//! In: one scan in the sensor's frame, and where the sensor is over the ground. Out: for each
//! direction the nearest thing that rises over the ground, in the footprint frame. Nothing is
//! remembered from scan to scan: what is there is seen again, ten times a second.
//!
//! All returns count, also those that mapping leaves out as reflections: to stop for a reflection
//! costs a moment, to walk into a pane costs more. A thing has to return three shots from about
//! the same place: a raindrop or a stray return stops nobody.

use hachi_hal::{Point, Pose, Stamp};

use crate::config::SafetyConfig;

/// Directions: two degrees each. A leg of a chair at 1.5 m is as wide.
pub const SECTORS: usize = 180;
/// Distances that are told apart, metres.
const BIN_M: f32 = 0.1;
/// Farther away than these nothing is looked at: settings with which the robot needs more room to
/// stop are refused ([`SafetyConfig::check`]).
const BINS: usize = 50;
/// How far away obstacles are seen, m: less a bin, whose near edge counts.
pub(crate) const SEEN_M: f64 = (BINS - 1) as f64 * BIN_M as f64;
/// Returns from about one place that make a thing.
const SUPPORT: u16 = 3;

/// The nearest things around the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacles {
    /// When the scan ended.
    pub stamp: Stamp,
    /// How many there are.
    len: usize,
    /// Where they are: forward and left of the footprint, metres.
    places: [[f32; 2]; SECTORS],
}

impl Obstacles {
    /// Nothing around.
    pub const fn none(stamp: Stamp) -> Self {
        Self {
            stamp,
            len: 0,
            places: [[0.0; 2]; SECTORS],
        }
    }

    /// Where they are: forward and left of the footprint, metres.
    pub fn places(&self) -> &[[f32; 2]] {
        &self.places[..self.len]
    }

    /// One more thing; whether there was room for it.
    pub fn add(&mut self, place: [f32; 2]) -> bool {
        match self.places.get_mut(self.len) {
            Some(free) => {
                *free = place;
                self.len += 1;
                true
            }
            None => false,
        }
    }
}

/// Finds obstacles, scan after scan.
#[derive(Debug, Clone)]
pub struct ObstacleFinder {
    half: [f32; 2],
    low: f32,
    high: f32,
    /// Returns by direction and distance.
    cells: Box<[[Cell; BINS + 1]; SECTORS]>,
}

/// Returns from about one place.
#[derive(Debug, Clone, Copy)]
struct Cell {
    count: u16,
    /// How far ahead or behind the nearest is, m.
    ahead: f32,
    /// The sum of their distances to a side, m.
    aside: f32,
}

const EMPTY: Cell = Cell {
    count: 0,
    ahead: f32::INFINITY,
    aside: 0.0,
};

impl Cell {
    fn count(&mut self, x: f32, y: f32) {
        self.count = self.count.saturating_add(1);
        self.ahead = self.ahead.min(x.abs());
        self.aside += y.abs();
    }
}

impl ObstacleFinder {
    /// For a robot of this size.
    pub fn new(config: &SafetyConfig) -> Self {
        Self {
            half: [config.half_length_m as f32, config.half_width_m as f32],
            low: config.obstacle_low_m as f32,
            high: config.obstacle_high_m as f32,
            cells: Box::new([[EMPTY; BINS + 1]; SECTORS]),
        }
    }

    /// The things that one scan shows.
    pub fn find(
        &mut self,
        stamp: Stamp,
        points: &[Point],
        footprint_from_lidar: &Pose,
    ) -> Obstacles {
        for sector in self.cells.iter_mut() {
            sector.fill(EMPTY);
        }
        let rotation = footprint_from_lidar
            .rotation
            .to_rotation_matrix()
            .cast::<f32>();
        let shift = footprint_from_lidar.translation.vector.cast::<f32>();
        for point in points {
            let p = rotation * nalgebra::Vector3::from(point.position()) + shift;
            let rises = p.z > self.low && p.z < self.high;
            let own = p.x.abs() < self.half[0] && p.y.abs() < self.half[1];
            if rises && !own {
                self.count(p.x, p.y);
            }
        }
        let mut obstacles = Obstacles::none(stamp);
        for (sector, cells) in self.cells.iter().enumerate() {
            // What lies across the border of two bins is one thing.
            let nearest = cells
                .windows(2)
                .position(|pair| pair[0].count.saturating_add(pair[1].count) >= SUPPORT);
            if let Some(bin) = nearest {
                let bin = if cells[bin].count == 0 { bin + 1 } else { bin };
                obstacles.add(place(sector, bin, &cells[bin]));
            }
        }
        obstacles
    }

    fn count(&mut self, x: f32, y: f32) {
        let bin = (x.hypot(y) / BIN_M) as usize;
        // A point that is not finite has no direction and falls into no bin.
        if bin < BINS && x.is_finite() && y.is_finite() {
            let turn = y.atan2(x) / std::f32::consts::TAU + 0.5;
            let sector = ((turn * SECTORS as f32) as usize).min(SECTORS - 1);
            self.cells[sector][bin].count(x, y);
        }
    }
}

/// Where a thing counts as standing: aside at the mean of its returns, ahead at the near edge of its
/// bin. A scan lasts 0.1 s, in which the robot comes up to 8 cm nearer to what is ahead. A door frame
/// beside its way does not come nearer: a bin's width, or the single return that errs most (a
/// VLP-16's by 3 cm), would close doors that are wide enough. What a mean hides is less than a bin.
fn place(sector: usize, bin: usize, cell: &Cell) -> [f32; 2] {
    let angle = ((sector as f32 + 0.5) / SECTORS as f32 - 0.5) * std::f32::consts::TAU;
    let range = bin as f32 * BIN_M;
    let aside = cell.aside / f32::from(cell.count.max(1));
    let near_edge = (range * range - aside * aside).max(0.0).sqrt();
    [
        cell.ahead.min(near_edge).copysign(angle.cos()),
        aside.copysign(angle.sin()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Translation3;

    fn point(x: f32, y: f32, z: f32) -> Point {
        Point {
            x,
            y,
            z,
            ..Point::default()
        }
    }

    /// The sensor 0.8 m over the ground.
    fn mounted() -> Pose {
        Pose::from_parts(
            Translation3::new(0.0, 0.0, 0.8),
            nalgebra::UnitQuaternion::identity(),
        )
    }

    #[test]
    fn a_post_is_seen_where_it_stands_and_floor_ceiling_and_the_own_body_are_not() {
        let mut finder = ObstacleFinder::new(&SafetyConfig::default());
        let post = [0.0, -0.2, -0.4].map(|z| point(1.53, 0.52, z));
        let floor = [-0.79, -0.80, -0.75].map(|z| point(1.0, -0.5, z));
        let ceiling = [1.5, 1.6, 1.7].map(|z| point(0.9, 0.0, z));
        let body = [-0.2, -0.3, -0.4].map(|z| point(0.5, 0.2, z));
        let all: Vec<_> = post
            .into_iter()
            .chain(floor)
            .chain(ceiling)
            .chain(body)
            .collect();
        let found = finder.find(Stamp::default(), &all, &mounted());
        let [[x, y]] = found.places() else {
            panic!("{found:?}");
        };
        assert!((x - 1.53).hypot(y - 0.52) < 0.11, "{x} {y}");
        assert!(
            x.hypot(*y) <= 1.53f32.hypot(0.52),
            "never farther than it is"
        );
    }

    /// The frame of a door 1.0 m wide, ahead and to the left, through returns that err by 2 cm.
    #[test]
    fn what_stands_beside_the_way_is_aside_where_it_is_and_ahead_never_farther() {
        let mut finder = ObstacleFinder::new(&SafetyConfig::default());
        for ahead in [0.70f32, 0.83, 0.95, 1.07, 1.18] {
            let errs = [-0.02f32, 0.02, 0.0, -0.02, 0.02, 0.0];
            let frame = errs.map(|err| point(ahead, 0.5 + err, -0.2));
            let found = finder.find(Stamp::default(), &frame, &mounted());
            let nearest = found.places().iter().map(|[_, y]| *y);
            let nearest = nearest.fold(f32::INFINITY, f32::min);
            // Neighbouring sectors may have a part of them each.
            assert!((nearest - 0.5).abs() < 0.0201, "{ahead}: {found:?}");
            assert!(
                found
                    .places()
                    .iter()
                    .all(|[x, _]| *x <= ahead && *x > ahead - 0.15)
            );
        }
    }

    #[test]
    fn two_stray_returns_stop_nobody_and_neither_does_nonsense() {
        let mut finder = ObstacleFinder::new(&SafetyConfig::default());
        let bad = [f32::NAN, f32::INFINITY, f32::MAX].map(|v| point(v, v, 0.0));
        let stray = [0.0, 0.05].map(|z| point(1.0, 0.0, z));
        let all: Vec<_> = bad.into_iter().chain(stray).collect();
        assert_eq!(
            finder.find(Stamp::default(), &all, &mounted()).places(),
            &[] as &[[f32; 2]]
        );
    }

    #[test]
    fn the_nearer_of_two_things_in_one_direction_counts() {
        let mut finder = ObstacleFinder::new(&SafetyConfig::default());
        let wall = (0..9).map(|i| point(3.0, 0.01, -0.05 * i as f32));
        let pole = (0..3).map(|i| point(1.99, 0.01, -0.05 * i as f32));
        let all: Vec<_> = wall.chain(pole).collect();
        let found = finder.find(Stamp::default(), &all, &mounted());
        assert_eq!(found.places().len(), 1);
        assert!((found.places()[0][0] - 1.9).abs() < 0.01, "{found:?}");
    }
}
