//! The plane of the ground from a scan alone, for recordings of a robot nobody knows.
//!
//! In: points in the sensor frame. Out: the ground plane under the sensor with a confidence, or
//! why there is none. Planes through triples of points (a fixed pseudo-random sequence: the same
//! scan gives the same plane) are judged by what lies on them and what lies below; the best is
//! refined by least squares. Following the plane over time is `ground_tracker`'s.
//!
//! The sensor stands upright to within [`MAX_TILT_DEG`] and 0.1 to 3.5 m above the ground.

use alloc::vec::Vec;

use hachi_hal::{Point, Pose};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::float::{cross, dot, norm, sqrt, sub, unit};
use crate::intensity::Height;
use crate::label::Reason;
use crate::surface::least_eigenvector;

/// Largest angle between the sensor's z axis and the ground's normal: a mount pitched by 30
/// degrees on a body that pitches by some more.
pub const MAX_TILT_DEG: f32 = 37.0;
/// Cosine of [`MAX_TILT_DEG`].
const MIN_COS_TILT: f32 = 0.798_6;
const HEIGHTS_M: core::ops::RangeInclusive<f32> = 0.1..=3.5;
/// Ground farther out is another slope, or too grazing to return much.
const REACH_M: f32 = 15.0;
/// Points judged for each hypothesis.
const SAMPLES: usize = 2000;
/// Points that refine the best one and judge it, at most: a plane through thousands is known to a
/// millimetre.
const REFINED_BY: usize = 8192;
/// With 30 % ground, 250 triples miss it with a probability of 0.1 %.
const HYPOTHESES: usize = 250;
/// Half the thickness of the ground: three times a LiDAR's 1.5 cm of noise.
const THICKNESS_M: f32 = 0.05;
/// Below this share of a band under the plane, it is the floor of something else.
const BELOW_M: f32 = 0.15;
const REFINEMENTS: usize = 4;
/// Plane fits below it are refused.
const MIN_CONFIDENCE: f32 = 0.25;
const MIN_POINTS: usize = 30;

/// The ground under a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundPlane {
    /// The plane in the sensor frame, as a height.
    pub height: Height,
    /// 0 to 1: how much lies on the plane, how little below and just above it, how wide it is.
    pub confidence: f32,
    /// Points on the plane, of those that refined it.
    pub inliers: usize,
    /// Root mean square distance of those from it, metres.
    pub roughness_m: f32,
}

impl GroundPlane {
    /// The footprint frame on this plane: origin under the sensor, z along the normal, x along the
    /// sensor's x axis laid on the plane.
    pub fn footprint_from_lidar(&self) -> Pose {
        footprint_from_lidar(self.height)
    }
}

/// As [`GroundPlane::footprint_from_lidar`], from a height alone.
pub(crate) fn footprint_from_lidar(height: Height) -> Pose {
    let up = Vector3::from(height.up.map(f64::from)).normalize();
    // `up` is within MAX_TILT_DEG of z, so x is never along it.
    let forward = (Vector3::x() - up * up.x).normalize();
    let left = up.cross(&forward);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[
        forward.transpose(),
        left.transpose(),
        up.transpose(),
    ]));
    Pose::from_parts(
        Translation3::new(0.0, 0.0, f64::from(height.sensor_height_m)),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// Why no ground was found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoGround {
    /// Too little within reach of the sensor.
    #[error("{near} points within 15 m, at least 30 needed")]
    TooFewPoints {
        /// Kept points within reach.
        near: usize,
    },
    /// No plane below the sensor within the tilt it may have.
    #[error("no plane below the sensor within 37 degrees of upright")]
    NoPlane,
    /// The best plane is not believable.
    #[error("the best plane has confidence {confidence:.2}, at least 0.25 needed")]
    NotBelieved {
        /// Its confidence.
        confidence: f32,
    },
}

/// Finds the ground plane. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct GroundFinder {
    near: Vec<[f32; 3]>,
    sampled: Vec<[f32; 3]>,
    /// The positions of `sampled` again, axis by axis: heights are computed several at a time.
    coordinates: [Vec<f32>; 3],
}

impl GroundFinder {
    /// The ground among the kept points; `expected` (the previous scan's) is one more hypothesis.
    pub fn find(
        &mut self,
        points: &[Point],
        labels: &[Reason],
        expected: Option<Height>,
    ) -> Result<GroundPlane, NoGround> {
        self.near.clear();
        self.near.extend(
            points
                .iter()
                .zip(labels)
                .filter(|(_, label)| label.is_kept())
                .map(|(point, _)| point.position())
                .filter(|p| norm(*p) < REACH_M),
        );
        let near = self.near.len();
        if near < MIN_POINTS {
            return Err(NoGround::TooFewPoints { near });
        }
        self.sampled.clear();
        self.sampled
            .extend(self.near.iter().step_by(near.div_ceil(SAMPLES)).copied());
        for (axis, coordinates) in self.coordinates.iter_mut().enumerate() {
            coordinates.clear();
            coordinates.extend(self.sampled.iter().map(|p| p[axis]));
        }
        thin(&mut self.near, near.div_ceil(REFINED_BY));
        let best = self.best_hypothesis(expected).ok_or(NoGround::NoPlane)?;
        let plane = self.refine(best).ok_or(NoGround::NoPlane)?;
        if plane.confidence < MIN_CONFIDENCE {
            return Err(NoGround::NotBelieved {
                confidence: plane.confidence,
            });
        }
        Ok(plane)
    }

    fn best_hypothesis(&self, expected: Option<Height>) -> Option<Height> {
        let mut random = Sequence(0x9E37_79B9);
        let mut best = expected.map(|height| (self.score(height), height));
        for _ in 0..HYPOTHESES {
            let triple = [(); 3].map(|()| self.sampled[random.below(self.sampled.len())]);
            let Some(height) = plane_through(triple) else {
                continue;
            };
            let score = self.score(height);
            if best.is_none_or(|(most, _)| score > most) {
                best = Some((score, height));
            }
        }
        best.map(|(_, height)| height)
    }

    /// Points on the plane, of those that refined it.less points below it: a table top has the floor below.
    fn score(&self, height: Height) -> i32 {
        let [xs, ys, zs] = &self.coordinates;
        let positions = xs.iter().zip(ys).zip(zs);
        positions
            .map(|((x, y), z)| {
                let h = height.of([*x, *y, *z]);
                i32::from(h.abs() < THICKNESS_M) - i32::from(h < -BELOW_M)
            })
            .sum()
    }

    /// Least squares on the points near the plane, repeated; then judged.
    fn refine(&self, mut height: Height) -> Option<GroundPlane> {
        for _ in 0..REFINEMENTS {
            height = upright(least_squares(&self.near, height)?.0)?;
        }
        let (_, variances, inliers) = least_squares(&self.near, height)?;
        let count = |low: f32, high: f32| {
            let within = |p: &&[f32; 3]| (low..high).contains(&height.of(**p));
            self.near.iter().filter(within).count() as f32
        };
        let on = inliers as f32;
        // A tenth of what is near is plenty for ground; a robot in a crowd sees less.
        let support = (on / (0.1 * self.near.len() as f32)).min(1.0);
        let nothing_below = (1.0 - 2.0 * count(f32::NEG_INFINITY, -BELOW_M) / on).max(0.0);
        // A slice cut out of walls goes on above as it is; ground ends.
        let ends_above = (1.0 - count(THICKNESS_M, 3.0 * THICKNESS_M) / on).max(0.0);
        let width = sqrt(variances[1] as f32).min(1.0);
        Some(GroundPlane {
            height,
            confidence: support * nothing_below * ends_above * width,
            inliers,
            roughness_m: sqrt(variances[0].max(0.0) as f32),
        })
    }
}

/// Keeps one point of each `step`.
fn thin(points: &mut Vec<[f32; 3]>, step: usize) {
    let kept = points.len().div_ceil(step);
    for to in 1..kept {
        points[to] = points[to * step];
    }
    points.truncate(kept);
}

/// The plane through the points within the ground's thickness of `height`, their variances along
/// the principal axes (least first) and their number.
fn least_squares(points: &[[f32; 3]], height: Height) -> Option<(Height, [f64; 3], usize)> {
    let on = || points.iter().filter(|p| height.of(**p).abs() < THICKNESS_M);
    let mut sum = [0f64; 3];
    let mut count = 0usize;
    for p in on() {
        count += 1;
        for axis in 0..3 {
            sum[axis] += f64::from(p[axis]);
        }
    }
    if count < MIN_POINTS / 2 {
        return None;
    }
    let mean = sum.map(|s| s / count as f64);
    let mut c = [0f64; 6];
    for p in on() {
        let d: [f64; 3] = core::array::from_fn(|axis| f64::from(p[axis]) - mean[axis]);
        c[0] += d[0] * d[0];
        c[1] += d[0] * d[1];
        c[2] += d[0] * d[2];
        c[3] += d[1] * d[1];
        c[4] += d[1] * d[2];
        c[5] += d[2] * d[2];
    }
    let (variances, normal) = least_eigenvector(c.map(|v| v / count as f64));
    let sign = if normal[2] < 0.0 { -1.0 } else { 1.0 };
    let up = normal.map(|v| v * sign);
    let sensor_height = -(up[0] * mean[0] + up[1] * mean[1] + up[2] * mean[2]);
    Some((
        Height {
            up: up.map(|v| v as f32),
            sensor_height_m: sensor_height as f32,
        },
        variances,
        count,
    ))
}

fn plane_through([a, b, c]: [[f32; 3]; 3]) -> Option<Height> {
    let normal = unit(cross(sub(b, a), sub(c, a)))?;
    let up = normal.map(|v| if normal[2] < 0.0 { -v } else { v });
    upright(Height {
        up,
        sensor_height_m: -dot(up, a),
    })
}

/// The plane, if it may be the ground.
fn upright(height: Height) -> Option<Height> {
    (height.up[2] >= MIN_COS_TILT && HEIGHTS_M.contains(&height.sensor_height_m)).then_some(height)
}

/// A fixed pseudo-random sequence (xorshift, Marsaglia 2003).
struct Sequence(u32);

impl Sequence {
    /// The next number below `end`, which is positive.
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 as usize % end
    }
}
