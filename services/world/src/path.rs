//! A path on the floor: straight lines whose corners are rounded, by arc length.
//!
//! In: waypoints. Out: position and heading at any distance along. The curvature is continuous
//! (each corner is a quintic Bézier curve that leaves its lines with curvature zero), so a body
//! that follows the path with a smooth speed has a continuous acceleration.

type Point = [f64; 2];

/// Control points of a corner lie at these shares of the cut, measured from the corner.
const CONTROL: [f64; 3] = [1.0, 0.65, 0.25];
/// Knots of a corner's arc-length table.
const KNOTS: usize = 33;
/// Gauss-Legendre nodes and weights on [-1, 1], five points.
const GAUSS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

#[derive(Debug, Clone)]
struct Corner {
    control: [Point; 6],
    /// Arc length at each knot of the curve's parameter.
    lengths: [f64; KNOTS],
}

impl Corner {
    fn new(at: Point, incoming: Point, outgoing: Point, cut: f64) -> Self {
        let on = |direction: Point, share: f64| {
            [
                at[0] + direction[0] * cut * share,
                at[1] + direction[1] * cut * share,
            ]
        };
        let back = [-incoming[0], -incoming[1]];
        let [far, mid, near] = CONTROL;
        let mut corner = Self {
            control: [
                on(back, far),
                on(back, mid),
                on(back, near),
                on(outgoing, near),
                on(outgoing, mid),
                on(outgoing, far),
            ],
            lengths: [0.0; KNOTS],
        };
        for i in 1..KNOTS {
            corner.lengths[i] =
                corner.lengths[i - 1] + corner.arc(Self::parameter(i - 1), Self::parameter(i));
        }
        corner
    }

    fn parameter(knot: usize) -> f64 {
        knot as f64 / (KNOTS - 1) as f64
    }

    fn length(&self) -> f64 {
        self.lengths[KNOTS - 1]
    }

    /// De Casteljau: the point, and the derivative by the curve's parameter.
    fn point_and_derivative(&self, u: f64) -> (Point, Point) {
        let mut p = self.control;
        for level in (2..6).rev() {
            for i in 0..level {
                p[i] = mix(p[i], p[i + 1], u);
            }
        }
        let derivative = [5.0 * (p[1][0] - p[0][0]), 5.0 * (p[1][1] - p[0][1])];
        (mix(p[0], p[1], u), derivative)
    }

    fn arc(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        GAUSS
            .iter()
            .map(|(node, weight)| {
                let (_, d) = self.point_and_derivative(middle + half * node);
                weight * d[0].hypot(d[1])
            })
            .sum::<f64>()
            * half
    }

    fn at_length(&self, length: f64) -> (Point, f64) {
        let after = self.lengths.partition_point(|&l| l <= length);
        let knot = after.clamp(1, KNOTS - 1) - 1;
        let span = self.lengths[knot + 1] - self.lengths[knot];
        let from = Self::parameter(knot);
        let mut u = from + (length - self.lengths[knot]) / span / (KNOTS - 1) as f64;
        // Newton on the arc length, whose derivative is known exactly: two steps reach 1e-12.
        for _ in 0..2 {
            let (_, d) = self.point_and_derivative(u);
            u += (length - self.lengths[knot] - self.arc(from, u)) / d[0].hypot(d[1]);
        }
        let (point, d) = self.point_and_derivative(u);
        (point, d[1].atan2(d[0]))
    }
}

fn mix(a: Point, b: Point, u: f64) -> Point {
    [a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1])]
}

#[derive(Debug, Clone)]
enum Piece {
    Line {
        from: Point,
        heading: f64,
        /// Its cosine and sine.
        along: Point,
    },
    Corner(Box<Corner>),
}

/// A path by arc length.
#[derive(Debug, Clone)]
pub(crate) struct Path {
    /// Each piece with the arc length at which it begins.
    pieces: Vec<(f64, Piece)>,
    length: f64,
}

impl Path {
    /// The path through `waypoints`, its corners cut by at most `cut` metres on either side.
    /// Waypoints closer than a millimetre to the one before are left out; `None` if fewer than
    /// two remain.
    pub fn through(waypoints: &[Point], cut: f64) -> Option<Self> {
        let mut corners: Vec<Point> = Vec::new();
        for &point in waypoints {
            if corners
                .last()
                .is_none_or(|last| (point[0] - last[0]).hypot(point[1] - last[1]) > 1e-3)
            {
                corners.push(point);
            }
        }
        let directions: Vec<(Point, f64)> = corners
            .windows(2)
            .map(|pair| {
                let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
                let length = dx.hypot(dy);
                ([dx / length, dy / length], length)
            })
            .collect();
        if directions.is_empty() {
            return None;
        }
        let mut path = Self {
            pieces: Vec::new(),
            length: 0.0,
        };
        let mut from = corners[0];
        for (i, &(direction, length)) in directions.iter().enumerate() {
            let to = corners[i + 1];
            match directions.get(i + 1) {
                Some(&(outgoing, next_length)) => {
                    let cut = cut.min(length / 2.0).min(next_length / 2.0);
                    let end = [to[0] - direction[0] * cut, to[1] - direction[1] * cut];
                    path.line(from, end, direction);
                    let corner = Corner::new(to, direction, outgoing, cut);
                    from = corner.control[5];
                    let begins = path.length;
                    path.length += corner.length();
                    path.pieces.push((begins, Piece::Corner(Box::new(corner))));
                }
                None => path.line(from, to, direction),
            }
        }
        Some(path)
    }

    fn line(&mut self, from: Point, to: Point, direction: Point) {
        let heading = direction[1].atan2(direction[0]);
        let (sin, cos) = heading.sin_cos();
        let piece = Piece::Line {
            from,
            heading,
            along: [cos, sin],
        };
        self.pieces.push((self.length, piece));
        self.length += (to[0] - from[0]).hypot(to[1] - from[1]);
    }

    /// Metres from the first waypoint to the last.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Position and heading (radians, x towards y) after `length` metres.
    pub fn at(&self, length: f64) -> (Point, f64) {
        let length = length.clamp(0.0, self.length);
        let piece = self
            .pieces
            .partition_point(|(begins, _)| *begins <= length)
            .max(1)
            - 1;
        let (begins, piece) = &self.pieces[piece];
        let within = length - begins;
        match piece {
            Piece::Line {
                from,
                heading,
                along,
            } => {
                let place = [0, 1].map(|axis| from[axis] + along[axis] * within);
                (place, *heading)
            }
            Piece::Corner(corner) => corner.at_length(within),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_runs_by_arc_length_and_turns_its_corners_smoothly() {
        let path = Path::through(&[[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [1.0, 6.0]], 1.0).unwrap();
        let step = 1e-3;
        let (mut last, mut last_heading) = path.at(0.0);
        let mut last_curvature = 0.0;
        let mut s = step;
        while s < path.length() {
            let (point, heading) = path.at(s);
            let moved = (point[0] - last[0]).hypot(point[1] - last[1]);
            assert!((moved - step).abs() < 1e-8, "at {s}: moved {moved}");
            let curvature = (heading - last_heading) / step;
            assert!(
                (curvature - last_curvature).abs() < 0.03,
                "at {s}: {curvature}"
            );
            (last, last_heading, last_curvature) = (point, heading, curvature);
            s += step;
        }
        assert_eq!(path.at(0.0).0, [0.0, 0.0]);
        let (end, _) = path.at(path.length());
        assert!((end[0] - 1.0).hypot(end[1] - 6.0) < 1e-9, "{end:?}");
    }

    #[test]
    fn a_path_needs_two_places() {
        assert!(Path::through(&[[1.0, 1.0], [1.0, 1.0]], 0.5).is_none());
    }
}
