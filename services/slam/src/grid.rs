//! A map for navigation: which squares of the floor are free, which are not, which nobody has seen.
//!
//! In: submaps where their nodes are. Out: a grid, as the ROS map server's PGM image and YAML file
//! (`map_server`, `nav2_map_server`). Every surface was seen along a ray: squares that rays pass at
//! the robot's height are free, squares in which they end at that height are not. Rays to the floor
//! clear, rays over a table do not.

use std::fmt::Write as _;

use hachi_hal::Pose;

use crate::node::Node;
use crate::submap::Submap;

/// Squares of a grid, at most: 256 MB while it is made. A larger map gets larger squares.
const MOST_SQUARES: u64 = 1 << 26;

/// Rays say nothing of squares farther from the eye than this: there a square's height is a guess.
const FARTHEST_M: f64 = 30.0;

/// Of the rays that touch a square, the share that ended there for it to be an obstacle. Below a half:
/// rays graze along walls.
const OBSTACLE_SHARE: f32 = 0.2;

/// Image values of the ROS map server: free, occupied, unknown.
const FREE: u8 = 254;
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;

/// Thresholds written beside the image. An unknown square reads as 50 / 255 = 0.19608, which has to be
/// above the second.
const OCCUPIED_ABOVE: f32 = 0.65;
const FREE_BELOW: f32 = 0.196;

/// Settings of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridConfig {
    /// Edge of a square, metres.
    pub resolution_m: f64,
    /// What is lower above the ground than this is floor.
    pub lowest_m: f32,
    /// What is higher than this is above the robot.
    pub highest_m: f32,
}

impl Default for GridConfig {
    /// Squares of 5 cm; what a legged robot steps on and what it walks under.
    fn default() -> Self {
        Self {
            resolution_m: 0.05,
            lowest_m: 0.12,
            highest_m: 1.2,
        }
    }
}

/// What is known of a square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Square {
    /// Nobody looked.
    Unknown,
    /// The robot can be there.
    Free,
    /// It can't.
    Occupied,
}

#[derive(Debug, Clone, Copy, Default)]
struct Count {
    ended: u16,
    passed: u16,
}

/// The grid.
#[derive(Debug, Clone)]
pub struct OccupancyGrid {
    config: GridConfig,
    /// Map coordinates of the lower left corner, metres.
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    squares: Vec<Count>,
}

impl OccupancyGrid {
    /// An empty grid over the places that nodes and what is seen from them (`reach_m` around) cover.
    pub fn over(nodes: &[Node], reach_m: f64, config: &GridConfig) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for node in nodes {
            let t = node.map_from_node.translation.vector;
            for axis in 0..2 {
                low[axis] = low[axis].min(t[axis] - reach_m);
                high[axis] = high[axis].max(t[axis] + reach_m);
            }
        }
        let mut config = *config;
        config.resolution_m = config.resolution_m.max(1e-3);
        if nodes.is_empty() {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        // The grid's lines are the same however far a map reaches.
        low = low.map(|c| (c / config.resolution_m).floor() * config.resolution_m);
        let side = |axis: usize, edge: f64| ((high[axis] - low[axis]) / edge).ceil().max(1.0);
        while side(0, config.resolution_m) * side(1, config.resolution_m) > MOST_SQUARES as f64 {
            config.resolution_m *= 2.0;
        }
        let width = side(0, config.resolution_m) as usize;
        let height = side(1, config.resolution_m) as usize;
        Self {
            config,
            origin_m: low,
            width,
            height,
            squares: vec![Count::default(); width * height],
        }
    }

    /// Adds what was seen from a node.
    pub fn add(&mut self, node: &Node, submap: &Submap) {
        let place = |p: [f32; 3]| {
            let moved = node.map_from_node * nalgebra::Point3::from(p.map(f64::from));
            [moved.x, moved.y]
        };
        let eyes: Vec<([f64; 2], f32)> = submap
            .viewpoints
            .iter()
            .map(|eye| (place(*eye), node.ground.height(*eye)))
            .collect();
        for p in &submap.points {
            if let Some((eye, eye_height)) = eyes.get(usize::from(p.viewpoint)) {
                let height = node.ground.height(p.position);
                self.trace(*eye, *eye_height, place(p.position), height);
            }
        }
    }

    /// One ray, square by square (Amanatides and Woo, "A fast voxel traversal algorithm", 1987).
    fn trace(&mut self, eye: [f64; 2], eye_height: f32, end: [f64; 2], end_height: f32) {
        let edge = self.config.resolution_m;
        let span = [end[0] - eye[0], end[1] - eye[1]];
        let length = span[0].hypot(span[1]);
        if !length.is_finite() {
            return;
        }
        let scaled = |p: [f64; 2], a: usize| (p[a] - self.origin_m[a]) / edge;
        let mut at = [0, 1].map(|a| scaled(eye, a).floor() as i64);
        let last = [0, 1].map(|a| scaled(end, a).floor() as i64);
        let step = span.map(|s| if s < 0.0 { -1 } else { 1 });
        // Share of the ray at which the next line of the grid is crossed, and between two lines.
        let per_square = span.map(|s| edge / s.abs());
        let mut next = [0, 1].map(|a| {
            let line = at[a] + i64::from(step[a] > 0);
            let distance = (line as f64 - scaled(eye, a)) * edge;
            if span[a] == 0.0 {
                f64::INFINITY
            } else {
                distance / span[a]
            }
        });
        let band = self.config.lowest_m..self.config.highest_m;
        let squares = (last[0] - at[0]).unsigned_abs() + (last[1] - at[1]).unsigned_abs();
        let mut share = 0.0f64;
        for _ in 0..squares.min(1 << 20) {
            if share * length > FARTHEST_M {
                return;
            }
            let height = eye_height + (end_height - eye_height) * share as f32;
            if band.contains(&height)
                && let Some(count) = self.count(at)
            {
                count.passed = count.passed.saturating_add(1);
            }
            let axis = usize::from(next[1] < next[0]);
            share = next[axis];
            next[axis] += per_square[axis];
            at[axis] += step[axis];
        }
        if length <= FARTHEST_M
            && let Some(count) = self.count(last)
        {
            if band.contains(&end_height) {
                count.ended = count.ended.saturating_add(1);
            } else if end_height < band.start {
                // Floor: something was seen there, and the robot can stand on it.
                count.passed = count.passed.saturating_add(1);
            }
        }
    }

    fn count(&mut self, at: [i64; 2]) -> Option<&mut Count> {
        let x = usize::try_from(at[0]).ok().filter(|x| *x < self.width)?;
        let y = usize::try_from(at[1]).ok().filter(|y| *y < self.height)?;
        self.squares.get_mut(y * self.width + x)
    }

    /// Squares from left to right, and from bottom to top.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Edge of a square, metres.
    pub fn resolution_m(&self) -> f64 {
        self.config.resolution_m
    }

    /// A square, counted from the lower left corner; unknown outside.
    pub fn square(&self, x: usize, y: usize) -> Square {
        let inside = x < self.width && y < self.height;
        let count = inside.then(|| self.squares[y * self.width + x]);
        match count.unwrap_or_default() {
            Count {
                ended: 0,
                passed: 0,
            } => Square::Unknown,
            Count { ended, passed } => {
                let all = f32::from(ended) + f32::from(passed);
                if f32::from(ended) >= OBSTACLE_SHARE * all {
                    Square::Occupied
                } else {
                    Square::Free
                }
            }
        }
    }

    /// Cuts off the margins that nobody has seen.
    pub fn cropped(&self) -> Self {
        let seen = |x: usize, y: usize| self.square(x, y) != Square::Unknown;
        let columns = (0..self.width).filter(|&x| (0..self.height).any(|y| seen(x, y)));
        let (left, right) = ends(columns);
        let rows = (0..self.height).filter(|&y| (left..right).any(|x| seen(x, y)));
        let (bottom, top) = ends(rows);
        let (width, height) = ((right - left).max(1), (top - bottom).max(1));
        let edge = self.config.resolution_m;
        let mut squares = Vec::with_capacity(width * height);
        for y in bottom..bottom + height {
            for x in left..left + width {
                let inside = x < self.width && y < self.height;
                let count = inside.then(|| self.squares[y * self.width + x]);
                squares.push(count.unwrap_or_default());
            }
        }
        Self {
            config: self.config,
            origin_m: [
                self.origin_m[0] + left as f64 * edge,
                self.origin_m[1] + bottom as f64 * edge,
            ],
            width,
            height,
            squares,
        }
    }

    /// The image: binary PGM, the first row the uppermost.
    pub fn pgm(&self) -> Vec<u8> {
        let mut bytes = format!("P5\n{} {}\n255\n", self.width, self.height).into_bytes();
        bytes.reserve(self.width * self.height);
        for y in (0..self.height).rev() {
            bytes.extend((0..self.width).map(|x| match self.square(x, y) {
                Square::Unknown => UNKNOWN,
                Square::Free => FREE,
                Square::Occupied => OCCUPIED,
            }));
        }
        bytes
    }

    /// The file that describes the image of this name.
    pub fn yaml(&self, image: &str) -> String {
        let mut text = String::new();
        let [x, y] = self.origin_m;
        // Writing to a string can't fail.
        let _ = write!(
            text,
            "image: {image}\nmode: trinary\nresolution: {}\norigin: [{x:.6}, {y:.6}, 0.0]\nnegate: 0\n\
             occupied_thresh: {OCCUPIED_ABOVE}\nfree_thresh: {FREE_BELOW}\n",
            self.config.resolution_m
        );
        text
    }
}

/// First and one past the last.
fn ends(mut indices: impl Iterator<Item = usize>) -> (usize, usize) {
    let first = indices.next();
    let last = indices.last().or(first);
    (first.unwrap_or(0), last.map_or(0, |l| l + 1))
}

/// A grid of a map: `submap` gives each node's, `None` where it can't be read.
pub fn grid_of(
    nodes: &[Node],
    config: &GridConfig,
    mut submap: impl FnMut(&Node) -> Option<std::sync::Arc<Submap>>,
) -> OccupancyGrid {
    let mut grid = OccupancyGrid::over(nodes, FARTHEST_M, config);
    for node in nodes {
        if let Some(submap) = submap(node) {
            grid.add(node, &submap);
        }
    }
    grid.cropped()
}

/// Where a point of a node's submap is on the map.
pub fn placed(map_from_node: &Pose, p: [f32; 3]) -> [f64; 3] {
    (map_from_node * nalgebra::Point3::from(p.map(f64::from)))
        .coords
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{Ground, NodeId, PieceId};
    use crate::submap::SubmapPoint;
    use hachi_hal::Stamp;

    fn node(map_from_node: Pose) -> Node {
        Node {
            id: NodeId(0),
            session: 0,
            piece: PieceId(0),
            chained: false,
            stamp: Stamp::from_nanos(0),
            odom_from_node: Pose::identity(),
            map_from_node,
            path_m: 0.0,
            ground: Ground::level(0.5),
        }
    }

    fn seen(points: &[[f32; 3]]) -> Submap {
        let point = |&position: &[f32; 3]| SubmapPoint {
            position,
            ..SubmapPoint::default()
        };
        Submap {
            voxel_m: 0.1,
            viewpoints: vec![[0.0; 3]],
            points: points.iter().map(point).collect(),
        }
    }

    const METRE: GridConfig = GridConfig {
        resolution_m: 1.0,
        lowest_m: 0.1,
        highest_m: 1.0,
    };

    #[test]
    fn the_files_are_those_of_the_ros_map_server_byte_for_byte() {
        // From (0.5, 0.5): a wall at x = 3.5 two squares up, seen along the diagonal.
        let node = node(Pose::translation(0.5, 0.5, 0.0));
        let submap = std::sync::Arc::new(seen(&[[3.0, 0.0, 0.0], [0.0, 1.0, -0.5]]));
        let grid = grid_of(&[node], &METRE, |_| Some(submap.clone()));
        // Upper row: floor was seen above the eye's square. Lower row: three free, then the wall.
        let mut pgm = b"P5\n4 2\n255\n".to_vec();
        pgm.extend([254, 205, 205, 205, 254, 254, 254, 0]);
        assert_eq!(grid.pgm(), pgm);
        assert_eq!(
            grid.yaml("grid.pgm"),
            "image: grid.pgm\nmode: trinary\nresolution: 1\norigin: [0.000000, 0.000000, 0.0]\n\
             negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        );
    }

    #[test]
    fn rays_over_a_table_clear_nothing_behind_its_edge() {
        // The eye is 0.5 m up; the ray to a lamp 8 m away and 4 m higher leaves the robot's height
        // after a metre, in the second square.
        let node = node(Pose::translation(0.5, 0.5, 0.0));
        let submap = std::sync::Arc::new(seen(&[[8.0, 0.0, 4.0]]));
        let grid = grid_of(&[node], &METRE, |_| Some(submap.clone()));
        assert_eq!(grid.size(), (2, 1));
    }

    #[test]
    fn an_empty_map_and_a_huge_one_have_a_grid_all_the_same() {
        assert_eq!(grid_of(&[], &METRE, |_| None).size(), (1, 1));
        let far = [
            node(Pose::identity()),
            node(Pose::translation(1e6, 1e6, 0.0)),
        ];
        let grid = OccupancyGrid::over(&far, 30.0, &GridConfig::default());
        assert!(grid.size().0 as u64 * grid.size().1 as u64 <= MOST_SQUARES);
        assert!(grid.resolution_m() > 1.0);
    }
}
