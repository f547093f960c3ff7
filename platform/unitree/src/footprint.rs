//! Where the ground is under the robot: the footprint frame, from the feet that stand.
//!
//! In: feet in the base frame, which of them stand, the body's attitude. Out:
//! `footprint_from_base`: the footprint lies on the plane through the stance feet's soles, at the
//! foot of the perpendicular from the base, x along the body's heading. In full six degrees of
//! freedom: a tilted body on level ground and a level body on a ramp both come out right.
//!
//! Three feet and more give the plane. With two, which is most of a trot, the last plane is
//! carried by the inertial attitude and turned just so far that it holds the line through both;
//! the other diagonal does the same half a step later. With one foot it keeps its tilt and goes
//! through that foot, with none it is carried as it is. How long ago three feet gave it is said.

use hachi_hal::{LegKinematics, Pose, Rotation, Stamp, Vector3};
use nalgebra::{Matrix3, Rotation3, Translation3};

use crate::contact::Contacts;

/// The ground under the robot at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// When.
    pub stamp: Stamp,
    /// Takes points in `base` to `footprint`.
    pub footprint_from_base: Pose,
    /// How long ago three or more feet gave the plane, ns; `None` if they never have.
    pub age_ns: Option<i64>,
    /// How many feet stand.
    pub feet: usize,
    /// Root mean square distance of the standing feet's soles from the plane, metres.
    pub residual_m: f64,
}

impl Footprint {
    /// The transform of the filters: takes points of the LiDAR to `footprint`.
    pub fn footprint_from_lidar(&self, base_from_lidar: &Pose) -> Pose {
        self.footprint_from_base * base_from_lidar
    }

    /// Height of the base over the ground, metres.
    pub fn height_m(&self) -> f64 {
        self.footprint_from_base.translation.z
    }

    /// Unit vector off the ground, base frame.
    pub fn normal_in_base(&self) -> Vector3 {
        self.footprint_from_base
            .rotation
            .inverse_transform_vector(&Vector3::z())
    }
}

/// Three feet nearer to one line than this give no plane, metres (root mean square).
const LEAST_WIDTH_M: f64 = 0.03;
/// Two feet nearer to each other than this give no line, metres.
const LEAST_LENGTH_M: f64 = 0.1;
/// A plane this steep against the body is none that it stands on: 60 degrees.
const LEAST_COSINE: f64 = 0.5;

/// A plane in some frame: points `x` with `normal . x + offset = 0`.
#[derive(Debug, Clone, Copy)]
struct Plane {
    /// Unit, off the ground.
    normal: Vector3,
    /// Distance of the frame's origin over the plane.
    offset: f64,
}

/// Follows the ground under one robot.
#[derive(Debug, Clone, Default)]
pub struct FootprintTracker {
    /// In a frame that turns with the inertial attitude's world, origin at the base.
    level: Option<Plane>,
    fitted: Option<Stamp>,
}

impl FootprintTracker {
    /// Knows no ground yet.
    pub const fn new() -> Self {
        Self {
            level: None,
            fitted: None,
        }
    }

    /// The ground at the moment of `contacts`. `None` until a foot stands.
    ///
    /// `feet` are the centres of the feet's spheres in the base frame, `level_from_base` the
    /// body's attitude.
    pub fn step(
        &mut self,
        legs: &dyn LegKinematics,
        feet: &[Vector3; 4],
        contacts: &Contacts,
        level_from_base: &Rotation,
    ) -> Option<Footprint> {
        let radius = legs.foot_radius_m();
        let standing = Standing::of(feet, contacts);
        let carried = self.level.map_or_else(
            || level_from_base.inverse_transform_vector(&Vector3::z()),
            |plane| level_from_base.inverse_transform_vector(&plane.normal),
        );
        let fit = standing.fit().filter(|normal| normal.z >= LEAST_COSINE);
        if fit.is_some() {
            self.fitted = Some(contacts.stamp);
        }
        let normal = fit.or_else(|| standing.turned(&carried)).unwrap_or(carried);
        let offset = match (standing.count, self.level) {
            (0, last) => last?.offset,
            _ => radius - normal.dot(&standing.middle),
        };
        let in_base = Plane { normal, offset };
        self.level = Some(Plane {
            normal: level_from_base * normal,
            offset,
        });
        Some(Footprint {
            stamp: contacts.stamp,
            footprint_from_base: in_base.footprint_from_base()?,
            age_ns: self.fitted.map(|at| contacts.stamp.nanos_since(at).max(0)),
            feet: standing.count,
            residual_m: standing.residual(&normal),
        })
    }
}

impl Plane {
    /// `None` where the body's x axis is along the normal and has no direction on the plane.
    fn footprint_from_base(&self) -> Option<Pose> {
        let ahead = Vector3::x() - self.normal * self.normal.x;
        let ahead = ahead.try_normalize(1e-6)?;
        let left = self.normal.cross(&ahead);
        let axes = Matrix3::from_columns(&[ahead, left, self.normal]);
        let base_from_footprint =
            Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let pose = Pose::from_parts(
            Translation3::from(self.normal * -self.offset),
            base_from_footprint,
        );
        Some(pose.inverse())
    }
}

/// The feet that stand, with their weights.
struct Standing {
    feet: [(Vector3, f64); 4],
    count: usize,
    middle: Vector3,
}

impl Standing {
    fn of(feet: &[Vector3; 4], contacts: &Contacts) -> Self {
        let mut standing = Self {
            feet: [(Vector3::zeros(), 0.0); 4],
            count: 0,
            middle: Vector3::zeros(),
        };
        let mut total = 0.0;
        for (foot, contact) in feet.iter().zip(&contacts.feet) {
            if contact.standing {
                // A foot that has just touched counts little, but counts.
                let weight = contact.confidence.max(0.05);
                standing.feet[standing.count] = (*foot, weight);
                standing.count += 1;
                standing.middle += foot * weight;
                total += weight;
            }
        }
        if total > 0.0 {
            standing.middle /= total;
        }
        standing
    }

    fn feet(&self) -> &[(Vector3, f64)] {
        &self.feet[..self.count]
    }

    /// Normal of the plane through three or four feet, by weighted least squares of their heights
    /// over the body's own level.
    fn fit(&self) -> Option<Vector3> {
        if self.count < 3 {
            return None;
        }
        let (mut xx, mut xy, mut yy, mut xz, mut yz, mut total) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (foot, weight) in self.feet() {
            let d = foot - self.middle;
            xx += weight * d.x * d.x;
            xy += weight * d.x * d.y;
            yy += weight * d.y * d.y;
            xz += weight * d.x * d.z;
            yz += weight * d.y * d.z;
            total += weight;
        }
        let determinant = xx * yy - xy * xy;
        // The smaller eigenvalue of the scatter is about determinant / trace.
        let width_squared = determinant / ((xx + yy) * total);
        let wide = width_squared > LEAST_WIDTH_M * LEAST_WIDTH_M;
        if !wide {
            return None;
        }
        let slope_x = (xz * yy - yz * xy) / determinant;
        let slope_y = (yz * xx - xz * xy) / determinant;
        Vector3::new(-slope_x, -slope_y, 1.0).try_normalize(1e-9)
    }

    /// The normal nearest to `carried` that is square to the line through two feet.
    fn turned(&self, carried: &Vector3) -> Option<Vector3> {
        let [(first, _), (second, _)] = self.feet() else {
            return None;
        };
        let along = (second - first).try_normalize(LEAST_LENGTH_M)?;
        let normal = (carried - along * along.dot(carried)).try_normalize(LEAST_COSINE)?;
        (normal.z >= LEAST_COSINE).then_some(normal)
    }

    fn residual(&self, normal: &Vector3) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let squares = self.feet().iter().map(|(foot, _)| {
            let off = normal.dot(&(foot - self.middle));
            off * off
        });
        libm::sqrt(squares.sum::<f64>() / self.count as f64)
    }
}
