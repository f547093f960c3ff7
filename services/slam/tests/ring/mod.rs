//! A corridor around a block with cupboards here and there, seen by a sensor with 16 rings; a robot
//! that walks it, and odometry that drifts. Made here, ray by ray: the truth is known.

use hachi_hal::{Point, Pose, Rotation, Stamp, Vector3};
use hachi_odometry::Condition;
use hachi_registration::Degeneracy;
use hachi_slam::{ScanInput, Slam, SlamEstimate, SlamEvents};

/// Side of the square that the robot walks, metres.
pub const SIDE_M: f64 = 16.0;
const HALF_WIDTH_M: f64 = 1.2;
const HEIGHT_M: f64 = 2.6;
const SENSOR_M: f64 = 0.6;
const RAYS: usize = 400;
const STEP_M: f64 = 0.1;

/// Boxes: low and high corner.
fn boxes() -> Vec<[Vector3; 2]> {
    let (out, inn) = (SIDE_M + HALF_WIDTH_M, SIDE_M - HALF_WIDTH_M);
    let wall = |low: [f64; 2], high: [f64; 2]| {
        [
            Vector3::new(low[0], low[1], 0.0),
            Vector3::new(high[0], high[1], HEIGHT_M),
        ]
    };
    let mut all = vec![
        wall([HALF_WIDTH_M, HALF_WIDTH_M], [inn, inn]),
        wall([-2.0, -HALF_WIDTH_M - 0.3], [out + 1.0, -HALF_WIDTH_M]),
        wall([-2.0, out], [out + 1.0, out + 0.3]),
        wall([-HALF_WIDTH_M - 0.3, -2.0], [-HALF_WIDTH_M, out + 1.0]),
        wall([out, -2.0], [out + 0.3, out + 1.0]),
    ];
    // Cupboards along the outer walls, none like another: along the side, its length, depth, height.
    let cupboards: [&[[f64; 4]]; 4] = [
        &[
            [2.1, 0.8, 0.45, 1.9],
            [5.0, 1.6, 0.30, 1.0],
            [11.3, 0.5, 0.60, 2.2],
        ],
        &[[1.2, 2.2, 0.25, 0.8], [8.4, 0.7, 0.55, 1.6]],
        &[
            [3.7, 1.1, 0.50, 2.0],
            [6.6, 0.4, 0.40, 1.3],
            [12.0, 1.9, 0.35, 0.9],
        ],
        &[[4.4, 1.4, 0.60, 1.2], [9.9, 0.9, 0.30, 2.3]],
    ];
    for (side, row) in cupboards.iter().enumerate() {
        for &[from, length, depth, height] in *row {
            let (near, far) = (HALF_WIDTH_M - depth, HALF_WIDTH_M);
            let (low, high) = match side {
                0 => ([from, -far], [from + length, -near]),
                1 => ([SIDE_M + near, from], [SIDE_M + far, from + length]),
                2 => ([from, SIDE_M + near], [from + length, SIDE_M + far]),
                _ => ([-far, from], [-near, from + length]),
            };
            all.push([
                Vector3::new(low[0], low[1], 0.0),
                Vector3::new(high[0], high[1], height),
            ]);
        }
    }
    all
}

/// Distance to the first thing on a ray.
fn first_hit(boxes: &[[Vector3; 2]], eye: &Vector3, along: &Vector3) -> f64 {
    let floor = if along.z < 0.0 {
        -eye.z / along.z
    } else {
        f64::INFINITY
    };
    let ceiling = if along.z > 0.0 {
        (HEIGHT_M - eye.z) / along.z
    } else {
        f64::INFINITY
    };
    boxes
        .iter()
        .fold(floor.min(ceiling), |nearest, [low, high]| {
            let (mut enter, mut leave) = (0.0f64, nearest);
            for a in 0..3 {
                let [s, t] = [low[a], high[a]].map(|c| (c - eye[a]) / along[a]);
                enter = enter.max(s.min(t));
                leave = leave.min(s.max(t));
            }
            if enter < leave { enter } else { nearest }
        })
}

/// The robot at a distance along the square from its first corner: turns on the spot at corners are
/// left out, it is turned there at once.
pub fn truth(way_m: f64) -> Pose {
    let side = (way_m / SIDE_M).floor();
    let along = way_m - side * SIDE_M;
    let (x, y) = match side as i64 % 4 {
        0 => (along, 0.0),
        1 => (SIDE_M, along),
        2 => (SIDE_M - along, SIDE_M),
        _ => (0.0, SIDE_M - along),
    };
    let yaw = side * std::f64::consts::FRAC_PI_2;
    Pose::from_parts(
        Vector3::new(x, y, SENSOR_M).into(),
        Rotation::from_euler_angles(0.0, 0.0, yaw),
    )
}

/// A robot that walks, and SLAM that listens.
pub struct Walker {
    pub slam: Slam,
    pub events: SlamEvents,
    pub boxes: Vec<[Vector3; 2]>,
    points: Vec<Point>,
    pub way_m: f64,
    /// Where odometry has it.
    pub odom_from_base: Pose,
    scans: i64,
    /// How far it goes with each step, and turns, to the left.
    pub step_m: f64,
    pub turn_rad: f64,
    heading_rad: f64,
    /// What odometry adds to each step.
    drift: Pose,
}

impl Walker {
    pub fn new(slam: Slam) -> Self {
        Self {
            slam,
            events: SlamEvents::default(),
            boxes: boxes(),
            points: Vec::new(),
            way_m: 0.5,
            odom_from_base: Pose::identity(),
            scans: 0,
            step_m: STEP_M,
            turn_rad: 0.0,
            heading_rad: 0.0,
            drift: Pose::from_parts(
                Vector3::new(0.0003, 0.0002, 0.0).into(),
                Rotation::from_euler_angles(0.0, 0.0, 0.00012),
            ),
        }
    }

    /// Lifted and put down elsewhere: odometry begins anew.
    pub fn carry_to(&mut self, way_m: f64) {
        self.way_m = way_m;
        self.odom_from_base = Pose::identity();
    }

    /// A scan from where the robot is.
    pub fn scan(&mut self, condition: Condition) -> SlamEstimate {
        self.scans += 1;
        self.points.clear();
        if self.slam.wants_points(&self.odom_from_base, &condition) {
            self.look();
        }
        let scan = ScanInput {
            stamp: Stamp::from_nanos(self.scans * 100_000_000),
            odom_from_base: self.odom_from_base,
            condition,
            open: Degeneracy::default(),
            base_from_sensor: [0.0; 3],
            points: &self.points,
        };
        self.slam.step(&scan, &mut self.events)
    }

    /// Where the robot is.
    fn pose(&self) -> Pose {
        truth(self.way_m) * Rotation::from_euler_angles(0.0, 0.0, self.heading_rad)
    }

    /// A step, of 10 cm unless set otherwise, and a scan.
    pub fn step(&mut self) -> SlamEstimate {
        let before = self.pose();
        self.way_m += self.step_m;
        self.heading_rad += self.turn_rad;
        let moved = before.inv_mul(&self.pose());
        self.odom_from_base = self.odom_from_base * moved * self.drift;
        self.scan(Condition::Ok)
    }

    /// Walks on so far.
    pub fn walk(&mut self, metres: f64) {
        for _ in 0..(metres / STEP_M).round() as usize {
            self.step();
        }
    }

    fn look(&mut self) {
        let pose = self.pose();
        let eye = pose.translation.vector;
        for ring in 0..16 {
            let (sin_up, cos_up) = (f64::from(2 * ring - 15)).to_radians().sin_cos();
            for ray in 0..RAYS {
                let (sin, cos) = (ray as f64 / RAYS as f64 * std::f64::consts::TAU).sin_cos();
                let along = Vector3::new(cos_up * cos, cos_up * sin, sin_up);
                let range = first_hit(&self.boxes, &eye, &(pose.rotation * along));
                if range < 80.0 {
                    let p = (along * range).cast::<f32>();
                    let mut point = Point::at(p.x, p.y, p.z);
                    point.intensity = 60.0;
                    self.points.push(point);
                }
            }
        }
    }

    /// How far an estimate is from the truth: metres, radians.
    pub fn off_m(&self, estimate: &SlamEstimate) -> (f64, f64) {
        let truth = truth(0.5).inv_mul(&self.pose());
        let off = truth.inv_mul(&estimate.map_from_base);
        (off.translation.vector.norm(), off.rotation.angle())
    }
}
