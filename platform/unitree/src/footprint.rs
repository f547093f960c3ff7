//! Where the ground is under the robot: the footprint frame, from the feet that stand.
//!
//! In: feet in the base frame, which of them stand, the body's attitude. Out:
//! `footprint_from_base`: the footprint lies on the plane through the stance feet's soles, at the
//! foot of the perpendicular from the base, x along the body's heading. In full six degrees of
//! freedom: a tilted body on level ground and a level body on a ramp both come out right.
//!
//! Three feet and more give the plane. With fewer, which is most of a trot, the places where the
//! other feet last stood are carried along by the body's attitude and its leg odometry, and help;
//! where these are unknown or too old the last plane is carried by the attitude, turned just so far
//! that it holds the line through two standing feet, and laid through the feet that stand. How long
//! ago three feet stood at once is said.

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

/// Feet with less confidence are not asked: one that has just touched, or is about to lift.
const LEAST_CONFIDENCE: f64 = 0.2;

/// A foot's last place is remembered for this long, ns: a step of a slow walk.
const REMEMBERED_NS: i64 = 1_000_000_000;
/// Weight of a place that was just left, against a foot that stands.
const HOLD_WEIGHT: f64 = 0.5;

/// A plane in some frame: points `x` with `normal . x + offset = 0`.
#[derive(Debug, Clone, Copy)]
struct Plane {
    /// Unit, off the ground.
    normal: Vector3,
    /// Distance of the frame's origin over the plane.
    offset: f64,
}

/// Where a foot last stood: its centre in the level frame, origin at the base.
#[derive(Debug, Clone, Copy)]
struct Hold {
    place: Vector3,
    stood: Stamp,
}

/// What one moment's ground is found from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootprintInput<'a> {
    /// Centres of the feet's spheres, base frame.
    pub feet: &'a [Vector3; 4],
    /// Which of them stand.
    pub contacts: &'a Contacts,
    /// Feet that move though they seem to stand: they slip, or they do not stand. Left out.
    pub moving: &'a [bool; 4],
    /// The body's attitude.
    pub level_from_base: Rotation,
    /// How far the base has moved since the last moment, level frame; `None` where nobody knows.
    pub moved: Option<Vector3>,
}

/// Follows the ground under one robot.
#[derive(Debug, Clone, Default)]
pub struct FootprintTracker {
    /// In the level frame: it turns with the base's heading no more than the attitude's world does.
    level: Option<Plane>,
    holds: [Option<Hold>; 4],
    fitted: Option<Stamp>,
}

impl FootprintTracker {
    /// Knows no ground yet.
    pub const fn new() -> Self {
        Self {
            level: None,
            holds: [None; 4],
            fitted: None,
        }
    }

    /// The ground at one moment. `None` until a foot stands.
    pub fn step(
        &mut self,
        legs: &dyn LegKinematics,
        input: &FootprintInput<'_>,
    ) -> Option<Footprint> {
        let (now, level_from_base) = (input.contacts.stamp, input.level_from_base);
        let base_from_level = level_from_base.inverse();
        let radius = legs.foot_radius_m();
        self.carry_holds(input.moved, now);
        let standing = Feet::standing(input);
        let remembered = standing.with_holds(&self.holds, &base_from_level, now);
        let carried = base_from_level * self.level.map_or_else(Vector3::z, |plane| plane.normal);

        let sound = |normal: &Vector3| normal.z >= LEAST_COSINE;
        let fit = standing.plane().filter(sound);
        if fit.is_some() {
            self.fitted = Some(now);
        }
        let normal = fit
            .or_else(|| remembered.plane().filter(sound))
            .or_else(|| standing.turned(&carried).filter(sound))
            .unwrap_or(carried);
        let offset = match (standing.count, self.level) {
            (0, last) => last?.offset,
            _ => radius - normal.dot(&standing.middle),
        };
        self.level = Some(Plane {
            normal: level_from_base * normal,
            offset,
        });
        self.remember(input, &standing);
        Some(Footprint {
            stamp: now,
            footprint_from_base: Plane { normal, offset }.footprint_from_base()?,
            age_ns: self.fitted.map(|at| now.nanos_since(at).max(0)),
            feet: standing.count,
            residual_m: standing.residual(&normal),
        })
    }

    /// Moves the remembered places under the base, and forgets those that are old.
    fn carry_holds(&mut self, moved: Option<Vector3>, now: Stamp) {
        for hold in &mut self.holds {
            let kept = hold.filter(|h| now.nanos_since(h.stood) <= REMEMBERED_NS);
            *hold = kept.zip(moved).map(|(h, moved)| Hold {
                place: h.place - moved,
                ..h
            });
        }
    }

    fn remember(&mut self, input: &FootprintInput<'_>, standing: &Feet) {
        for (i, hold) in self.holds.iter_mut().enumerate() {
            if standing.weights[i] > 0.0 {
                *hold = Some(Hold {
                    place: input.level_from_base * input.feet[i],
                    stood: input.contacts.stamp,
                });
            }
        }
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

/// Feet with their weights; those without weight are not there.
struct Feet {
    places: [Vector3; 4],
    weights: [f64; 4],
    count: usize,
    middle: Vector3,
}

impl Feet {
    /// Those that stand.
    fn standing(input: &FootprintInput<'_>) -> Self {
        let weights = core::array::from_fn(|i| {
            let contact = &input.contacts.feet[i];
            let sure = contact.standing && contact.confidence >= LEAST_CONFIDENCE;
            if sure && !input.moving[i] {
                contact.confidence
            } else {
                0.0
            }
        });
        Self::of(*input.feet, weights)
    }

    /// And where the others last stood.
    fn with_holds(
        &self,
        holds: &[Option<Hold>; 4],
        base_from_level: &Rotation,
        now: Stamp,
    ) -> Self {
        let (mut places, mut weights) = (self.places, self.weights);
        for (i, hold) in holds.iter().enumerate() {
            if let (Some(hold), true) = (hold, weights[i] == 0.0) {
                places[i] = base_from_level * hold.place;
                let age = now.nanos_since(hold.stood) as f64 / REMEMBERED_NS as f64;
                weights[i] = HOLD_WEIGHT * (1.0 - age).clamp(0.01, 1.0);
            }
        }
        Self::of(places, weights)
    }

    fn of(places: [Vector3; 4], weights: [f64; 4]) -> Self {
        let total: f64 = weights.iter().sum();
        let middle = places
            .iter()
            .zip(weights)
            .map(|(p, w)| p * w)
            .sum::<Vector3>();
        Self {
            places,
            weights,
            count: weights.iter().filter(|w| **w > 0.0).count(),
            middle: if total > 0.0 { middle / total } else { middle },
        }
    }

    fn each(&self) -> impl Iterator<Item = (&Vector3, f64)> {
        let all = self.places.iter().zip(self.weights);
        all.filter(|(_, weight)| *weight > 0.0)
    }

    /// Normal of the plane through three or four feet, by weighted least squares of their heights
    /// over the body's own level.
    fn plane(&self) -> Option<Vector3> {
        if self.count < 3 {
            return None;
        }
        let (mut xx, mut xy, mut yy, mut xz, mut yz, mut total) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (foot, weight) in self.each() {
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
        let mut each = self.each();
        let (Some((first, _)), Some((second, _)), None) = (each.next(), each.next(), each.next())
        else {
            return None;
        };
        let along = (second - first).try_normalize(LEAST_LENGTH_M)?;
        (carried - along * along.dot(carried)).try_normalize(LEAST_COSINE)
    }

    fn residual(&self, normal: &Vector3) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let squares = self.each().map(|(foot, _)| {
            let off = normal.dot(&(foot - self.middle));
            off * off
        });
        libm::sqrt(squares.sum::<f64>() / self.count as f64)
    }
}
