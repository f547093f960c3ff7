//! Any cloud to a levelled one: z up from the ground, the sensor above the origin.
//!
//! In: points of a sensor frame whose tilt and height may be unknown. Out: the points in the
//! levelled frame, `level_from_sensor`, and what it rests on. The frame's x axis is the sensor's,
//! laid level. Elsewhere: finding the plane (`hachi-cloud`), following it over time (the caller).

use hachi_cloud::GroundFinder;
use hachi_cloud::label::Reason;
use hachi_hal::{Point, Pose, Rotation, Vector3};

/// Where returns tell the ground's height if no plane does, metres from the sensor.
const NEAR_M: f64 = 15.0;
/// The share of these that may lie below the ground: mirror images, stray returns.
const STRAY_SHARE: f64 = 0.02;

/// What a levelled frame's height rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Ground {
    /// A plane fitted to the returns below the sensor.
    Plane {
        /// 0 to 1, see [`hachi_cloud::GroundPlane`].
        confidence: f32,
    },
    /// No plane was found: the lowest returns near the sensor, stray ones aside.
    LowestReturns,
    /// No usable return: the sensor's own height.
    Nothing,
}

/// What was done to a cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levelled {
    /// Takes points of the sensor frame to the levelled one.
    pub level_from_sensor: Pose,
    /// What its height (and without gravity its tilt) rests on.
    pub ground: Ground,
}

/// Levels clouds. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct Leveller {
    finder: GroundFinder,
    points: Vec<Point>,
    labels: Vec<Reason>,
    heights: Vec<f64>,
}

impl Leveller {
    /// Levels `points` (`[x, y, z, intensity]`, sensor frame, metres) into `out`, which is cleared.
    ///
    /// With `level_from_sensor`, a rotation that gravity gave, only the height is looked for;
    /// without it the ground's plane gives the tilt as well (up to 37 degrees, the sensor 0.1 to
    /// 3.5 m high), and where there is none the sensor is taken to be level. Points that are not
    /// finite are left out.
    pub fn level(
        &mut self,
        points: &[[f32; 4]],
        level_from_sensor: Option<Rotation>,
        out: &mut Vec<[f32; 4]>,
    ) -> Levelled {
        let gravity = level_from_sensor.unwrap_or_else(Rotation::identity);
        let turned = Pose::from_parts(nalgebra::Translation3::identity(), gravity);
        apply(&turned, points, out);
        let levelled = self.find(out, level_from_sensor.is_some());
        let level_from_sensor = levelled.level_from_sensor * turned;
        apply(&level_from_sensor, points, out);
        Levelled {
            level_from_sensor,
            ..levelled
        }
    }

    /// The ground under points that are level up to their height, or up to tilt and height.
    fn find(&mut self, points: &[[f32; 4]], tilt_known: bool) -> Levelled {
        self.points.clear();
        self.points
            .extend(points.iter().map(|p| Point::at(p[0], p[1], p[2])));
        self.labels.clear();
        self.labels.resize(points.len(), Reason::Kept);
        if let Ok(plane) = self.finder.find(&self.points, &self.labels, None) {
            let level_from_sensor = match tilt_known {
                true => Pose::translation(0.0, 0.0, plane.height.sensor_height_m.into()),
                false => plane.footprint_from_lidar(),
            };
            let ground = Ground::Plane {
                confidence: plane.confidence,
            };
            return Levelled {
                level_from_sensor,
                ground,
            };
        }
        self.heights.clear();
        let near = points.iter().filter(|p| {
            let [x, y] = [f64::from(p[0]), f64::from(p[1])];
            x.hypot(y) < NEAR_M
        });
        self.heights.extend(near.map(|p| f64::from(p[2])));
        let stray = (self.heights.len() as f64 * STRAY_SHARE) as usize;
        if stray >= self.heights.len() {
            return Levelled {
                level_from_sensor: Pose::identity(),
                ground: Ground::Nothing,
            };
        }
        let (_, lowest, _) = self.heights.select_nth_unstable_by(stray, f64::total_cmp);
        Levelled {
            level_from_sensor: Pose::translation(0.0, 0.0, -*lowest),
            ground: Ground::LowestReturns,
        }
    }
}

/// Points of the sensor frame in the levelled one, for a known `level_from_sensor`; `out` is
/// cleared, points that are not finite are left out.
pub fn apply(level_from_sensor: &Pose, points: &[[f32; 4]], out: &mut Vec<[f32; 4]>) {
    let rotation = level_from_sensor.rotation.to_rotation_matrix();
    let rotation = rotation.matrix().map(|v| v as f32);
    let translation: Vector3 = level_from_sensor.translation.vector;
    let translation = translation.map(|v| v as f32);
    out.clear();
    out.extend(points.iter().filter_map(|&[x, y, z, intensity]| {
        let p = rotation * nalgebra::Vector3::new(x, y, z) + translation;
        let finite = p.iter().all(|c| c.is_finite());
        finite.then_some([p.x, p.y, p.z, intensity])
    }));
}
