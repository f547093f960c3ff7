//! A corridor, a room behind a door, and a robot with a LiDAR that patrols them behind the gate.

use hachi_behaviour::{ObstacleFinder, Patrol, PatrolConfig, PlaceEstimate, SafetyConfig};
use hachi_hal::{BaseAction, BodyVelocity, Point, Pose, Vector3};
use nalgebra::{Translation3, UnitQuaternion};

use super::walk::{STEP_MS, Walk};

type Segment = [[f64; 2]; 2];

/// Walls, as seen from above.
pub struct Building(Vec<Segment>);

impl Building {
    /// A corridor 2.2 m wide along x whose left wall's face is at y = 0; in it, at x = 0, an opening
    /// `width_m` wide with a leaf that is opened into a room 4 m wide and 5 m deep.
    pub fn with_door(width_m: f64) -> Self {
        let half = width_m / 2.0;
        let wall = 0.12;
        let mut segments = vec![
            [[-6.0, -2.2], [10.0, -2.2]],
            [[-6.0, 0.0], [-half, 0.0]],
            [[half, 0.0], [10.0, 0.0]],
            [[-6.0, -2.2], [-6.0, 0.0]],
            [[10.0, -2.2], [10.0, 0.0]],
            [[-2.0, 5.0], [2.0, 5.0]],
            // The leaf, open.
            [[-half, 0.0], [-half, wall + width_m]],
            // Furniture beside what is kept free for visits.
            [[0.9, 1.0], [0.9, 4.0]],
            [[-0.9, 1.8], [-0.9, 4.0]],
        ];
        for side in [-1.0, 1.0] {
            segments.push([[side * half, 0.0], [side * half, wall]]);
            segments.push([[side * half, wall], [side * 2.0, wall]]);
            segments.push([[side * 2.0, wall], [side * 2.0, 5.0]]);
        }
        Self(segments)
    }

    /// From a place along a direction to the nearest wall, m.
    fn range(&self, at: [f64; 2], angle: f64) -> f64 {
        let (sin, cos) = angle.sin_cos();
        let hits = self.0.iter().filter_map(|[a, b]| {
            let (along, off) = ([b[0] - a[0], b[1] - a[1]], [a[0] - at[0], a[1] - at[1]]);
            let det = along[0] * sin - along[1] * cos;
            let share = (off[1] * cos - off[0] * sin) / det;
            let range = (along[0] * off[1] - along[1] * off[0]) / det;
            ((0.0..=1.0).contains(&share) && range > 0.0).then_some(range)
        });
        hits.fold(f64::INFINITY, f64::min)
    }

    /// From a rectangle to the nearest wall, m; what lies in it is at 0.
    fn clearance(&self, robot: &Robot) -> f64 {
        let (sin, cos) = robot.heading.sin_cos();
        let points = self.0.iter().flat_map(|[a, b]| {
            (0..=50).map(move |i| {
                let s = f64::from(i) / 50.0;
                [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
            })
        });
        let size = &robot.safety;
        let away = points.map(|p| {
            let off = [p[0] - robot.at[0], p[1] - robot.at[1]];
            let x = (off[0] * cos + off[1] * sin).abs() - size.half_length_m;
            let y = (off[1] * cos - off[0] * sin).abs() - size.half_width_m;
            x.max(0.0).hypot(y.max(0.0))
        });
        away.fold(f64::INFINITY, f64::min)
    }
}

/// A robot that does what the gate lets pass.
pub struct Robot {
    building: Building,
    safety: SafetyConfig,
    walk: Walk,
    finder: ObstacleFinder,
    pub patrol: Patrol,
    at: [f64; 2],
    heading: f64,
    noise: u32,
    /// The nearest that it came to a wall, m.
    pub clearance_m: f64,
    /// How far its middle went through the door's plane, m.
    pub farthest_in_m: f64,
    /// Places that it gave up, from 0.
    pub given_up: Vec<usize>,
}

impl Robot {
    /// In the corridor, 4 m before the door.
    pub fn new(building: Building, places: &[[f64; 2]]) -> Self {
        let safety = SafetyConfig::default();
        let config = PatrolConfig {
            places: places.to_vec(),
            ..PatrolConfig::default()
        };
        Self {
            building,
            walk: Walk::new(safety),
            finder: ObstacleFinder::new(&safety),
            patrol: Patrol::new(config, safety),
            safety,
            at: [-4.0, -1.1],
            heading: 0.0,
            noise: 1,
            clearance_m: f64::INFINITY,
            farthest_in_m: f64::NEG_INFINITY,
            given_up: Vec::new(),
        }
    }

    /// Walks for so long.
    pub fn walk_for(&mut self, seconds: f64) {
        let mut action = BaseAction::Move(BodyVelocity::ZERO);
        let mut was_blocked = None;
        for step in 0..(seconds * 1e3) as i64 / STEP_MS {
            if step % 10 == 0 {
                self.scan();
            }
            if step % 5 == 0 {
                let place = PlaceEstimate {
                    stamp: self.walk.now,
                    map_from_base: Pose::new(
                        Vector3::new(self.at[0], self.at[1], 0.5),
                        Vector3::z() * self.heading,
                    ),
                    trusted: true,
                };
                let wish = self
                    .patrol
                    .step(self.walk.now, &place, &self.walk.obstacles);
                action = wish.map_or(BaseAction::Stop, |wish| wish.action);
                let blocked = self.patrol.blocked();
                if blocked != was_blocked {
                    self.given_up.extend(blocked);
                    was_blocked = blocked;
                }
            }
            let v = self.walk.step(action).velocity();
            let (sin, cos) = self.heading.sin_cos();
            let dt_s = STEP_MS as f64 * 1e-3;
            self.at[0] += (v.forward * cos - v.left * sin) * dt_s;
            self.at[1] += (v.forward * sin + v.left * cos) * dt_s;
            self.heading += v.yaw_rate * dt_s;
            if step % 10 == 0 {
                self.clearance_m = self.clearance_m.min(self.building.clearance(self));
                self.farthest_in_m = self.farthest_in_m.max(self.at[1]);
            }
        }
    }

    /// Three rings of returns, half a degree apart, good to 2 cm.
    fn scan(&mut self) {
        let lidar = 0.25;
        let from = [
            self.at[0] + lidar * self.heading.cos(),
            self.at[1] + lidar * self.heading.sin(),
        ];
        let mut points = Vec::new();
        for i in 0..720 {
            let angle = f64::from(i).to_radians() / 2.0;
            let range = self.building.range(from, self.heading + angle);
            for ring in 0..3 {
                // A linear congruential generator (Numerical Recipes), to plus and minus 2 cm.
                self.noise = self
                    .noise
                    .wrapping_mul(1_664_525)
                    .wrapping_add(1_013_904_223);
                let off = (f64::from(self.noise) / f64::from(u32::MAX) - 0.5) * 0.04;
                let range = range + off;
                points.push(Point {
                    x: (range * angle.cos()) as f32,
                    y: (range * angle.sin()) as f32,
                    z: 0.1 * ring as f32,
                    ..Point::default()
                });
            }
        }
        let mounted = Pose::from_parts(
            Translation3::new(lidar, 0.0, 0.7),
            UnitQuaternion::identity(),
        );
        self.walk.obstacles = self.finder.find(self.walk.now, &points, &mounted);
    }
}
