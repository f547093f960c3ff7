//! People who walk through a scene: where they are, what they wear, and the shapes of their bodies.
//!
//! In: for each person a list of visits, each a path walked in one outfit. Out: at any time, who is
//! there, with a body of capsules and balls whose limbs swing with the steps. Elsewhere: what lasers and
//! cameras see of them (`moment`, `camera`).
//!
//! Proportions are those of an adult of 1.75 m (Winter, Biomechanics, 4th ed., figure 4.1), scaled to
//! the person's height.

use hachi_hal::{Pose, Vector3};
use nalgebra::{Translation3, UnitQuaternion};
use parry3d::math::Vector;
use parry3d::query::Ray;
use wide::f32x8;

use crate::floor::Floor;
use crate::scene::{ball_hit, narrow};

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// What somebody wears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outfit {
    /// Shirt or jacket, sleeves included.
    pub top: Rgb,
    /// Trousers.
    pub trousers: Rgb,
    /// Shoes.
    pub shoes: Rgb,
}

/// One walk through the scene, from appearing to going away.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    /// When it begins, seconds since the simulation's start.
    pub begins_s: f64,
    /// The places it leads through, on the map, metres. One place alone is somebody who stands.
    pub path: Vec<[f64; 2]>,
    /// How fast, m/s.
    pub speed_m_s: f64,
    /// How long the person stands at the end of the path before going away, seconds.
    pub stays_s: f64,
    /// What the person wears this time.
    pub outfit: Outfit,
}

/// Somebody.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// Who: the identity that stays when the clothes change.
    pub id: u32,
    /// How tall, metres.
    pub height_m: f64,
    /// Colour of the skin.
    pub skin: Rgb,
    /// Colour of the hair.
    pub hair: Rgb,
    /// When and where, in the order of time.
    pub visits: Vec<Visit>,
}

/// Somebody at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Presence {
    /// On the floor between the feet, x ahead.
    pub map_from_person: Pose,
    /// Which visit this is.
    pub visit: usize,
    /// How far the person has walked in it, metres.
    pub walked_m: f64,
    /// Whether the person walks rather than stands.
    pub walks: bool,
}

impl Visit {
    fn lengths(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2], f64)> {
        let pairs = self.path.iter().zip(self.path.iter().skip(1));
        pairs.map(|(from, to)| (*from, *to, (to[0] - from[0]).hypot(to[1] - from[1])))
    }

    fn length_m(&self) -> f64 {
        self.lengths().map(|(_, _, length)| length).sum()
    }

    /// When it ends, seconds since the simulation's start.
    pub fn ends_s(&self) -> f64 {
        let walk_s = if self.speed_m_s > 0.0 {
            self.length_m() / self.speed_m_s
        } else {
            0.0
        };
        self.begins_s + walk_s + self.stays_s
    }

    /// Place and heading after so many metres.
    fn at(&self, walked_m: f64) -> Option<([f64; 2], f64)> {
        let mut left_m = walked_m;
        let mut last = (*self.path.first()?, 0.0);
        for (from, to, length) in self.lengths().filter(|(_, _, length)| *length > 0.0) {
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let share = (left_m / length).min(1.0);
            last = ([from[0] + share * dx, from[1] + share * dy], dy.atan2(dx));
            if left_m <= length {
                break;
            }
            left_m -= length;
        }
        Some(last)
    }
}

impl Person {
    /// Where the person is at a time (seconds since the start), if there at all.
    pub fn presence(&self, time_s: f64, floor: &Floor) -> Option<Presence> {
        let during = |visit: &Visit| (visit.begins_s..visit.ends_s()).contains(&time_s);
        let index = self.visits.iter().position(during)?;
        let visit = &self.visits[index];
        let length_m = visit.length_m();
        let walked_m = (visit.speed_m_s * (time_s - visit.begins_s)).clamp(0.0, length_m);
        let ([x, y], heading) = visit.at(walked_m)?;
        let place = Translation3::new(x, y, floor.height(x, y));
        Some(Presence {
            map_from_person: place * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading),
            visit: index,
            walked_m,
            walks: walked_m < length_m,
        })
    }

    /// What the person wears on a visit.
    pub fn outfit(&self, visit: usize) -> Option<&Outfit> {
        self.visits.get(visit).map(|visit| &visit.outfit)
    }

    pub(crate) fn body(&self, presence: &Presence) -> Option<Body> {
        let outfit = self.outfit(presence.visit)?;
        Some(Body::new(self, outfit, presence))
    }
}

/// A round-ended rod; a ball where both ends are one.
#[derive(Debug, Clone, Copy)]
struct Capsule {
    from: Vector,
    to: Vector,
    radius: f32,
    color: Rgb,
}

/// Where a ray meets a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyHit {
    pub distance: f32,
    pub normal: Vector,
    pub color: Rgb,
}

/// A body in the map.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    id: u32,
    parts: [Capsule; 15],
    balls: [Balls; 2],
    /// A ball around all of it.
    centre: Vector,
    reach: f32,
}

/// Height of the body that the numbers below are of, metres.
const REFERENCE_M: f64 = 1.75;
/// One step with each foot, metres.
const STRIDE_M: f64 = 1.4;
/// How far a foot and a hand swing to the front and back, metres.
const FOOT_SWING_M: f64 = 0.30;
const HAND_SWING_M: f64 = 0.22;

impl Body {
    fn new(person: &Person, outfit: &Outfit, presence: &Presence) -> Self {
        let scale = person.height_m / REFERENCE_M;
        let swing = if presence.walks {
            (presence.walked_m / STRIDE_M * std::f64::consts::TAU).sin()
        } else {
            0.0
        };
        let in_map = |x: f64, y: f64, z: f64| {
            let point = nalgebra::Point3::new(x, y, z) * scale;
            narrow((presence.map_from_person * point).coords)
        };
        let rod = |from: [f64; 3], to: [f64; 3], radius: f64, color| Capsule {
            from: in_map(from[0], from[1], from[2]),
            to: in_map(to[0], to[1], to[2]),
            radius: (radius * scale) as f32,
            color,
        };
        let ball = |at: [f64; 3], radius, color| rod(at, at, radius, color);
        let Outfit {
            top,
            trousers,
            shoes,
        } = *outfit;
        let limb = |side: f64| {
            // Left arm and right leg go together.
            let foot = [-side * swing * FOOT_SWING_M, side * 0.10, 0.11];
            let hand = [side * swing * HAND_SWING_M, side * 0.26, 0.82];
            let elbow = [hand[0] * 0.3, side * 0.27, 1.10];
            let knee = [foot[0] * 0.5 + 0.02, side * 0.10, 0.50];
            [
                rod([0.0, side * 0.09, 0.92], knee, 0.08, trousers),
                rod(knee, foot, 0.06, trousers),
                rod(foot, [foot[0] + 0.12, foot[1], 0.05], 0.05, shoes),
                rod([0.0, side * 0.21, 1.41], elbow, 0.055, top),
                rod(elbow, hand, 0.04, person.skin),
            ]
        };
        let ([a, b, c, d, e], [f, g, h, i, j]) = (limb(1.0), limb(-1.0));
        let parts = [
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            i,
            j,
            rod([0.0, 0.09, 0.98], [0.0, 0.11, 1.37], 0.12, top),
            rod([0.0, -0.09, 0.98], [0.0, -0.11, 1.37], 0.12, top),
            rod([0.0, 0.0, 1.42], [0.01, 0.0, 1.56], 0.055, person.skin),
            ball([0.02, 0.0, 1.62], 0.11, person.skin),
            ball([-0.01, 0.0, 1.645], 0.105, person.hair),
        ];
        Self {
            id: person.id,
            balls: [
                Balls::around(&parts[..LANES]),
                Balls::around(&parts[LANES..]),
            ],
            parts,
            centre: in_map(0.0, 0.0, 0.875),
            reach: (1.0 * scale) as f32,
        }
    }

    pub fn cast(&self, ray: &Ray, within: f32) -> Option<BodyHit> {
        let to_centre = self.centre - ray.origin;
        let along = to_centre.dot(ray.dir);
        let across = to_centre.dot(to_centre) - along * along;
        if across > self.reach * self.reach || along < -self.reach || along - self.reach > within {
            return None;
        }
        let mut nearest: Option<BodyHit> = None;
        for (balls, parts) in self.balls.iter().zip(self.parts.chunks(LANES)) {
            let mut met = balls.met(ray);
            while met != 0 {
                let part = parts[met.trailing_zeros() as usize];
                met &= met - 1;
                let best = nearest.map_or(within, |hit| hit.distance);
                if let Some((distance, normal)) = part.hit(ray).filter(|hit| hit.0 < best) {
                    nearest = Some(BodyHit {
                        distance,
                        normal,
                        color: part.color,
                    });
                }
            }
        }
        nearest
    }

    /// Whose it is.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// The ball around it.
    pub fn bounds(&self) -> (Vector, f32) {
        (self.centre, self.reach)
    }
}

const LANES: usize = 8;

/// Balls around up to eight parts, side by side. Of a ray's way through a body most is past nearly
/// all of its parts, which is cheaper to see for eight of their balls at a time.
#[derive(Debug, Clone)]
struct Balls {
    centre: [f32x8; 3],
    /// Below zero where there is no part.
    radius2: f32x8,
}

/// Rounding may put a ball this much beside its part, metres.
const SLACK_M: f32 = 1e-3;

impl Balls {
    fn around(parts: &[Capsule]) -> Self {
        let mut centre = [[0.0; LANES]; 3];
        let mut radius2 = [-1.0; LANES];
        for (lane, part) in parts.iter().enumerate() {
            let middle = (part.from + part.to) * 0.5;
            let radius = (part.to - middle).length() + part.radius + SLACK_M;
            radius2[lane] = radius * radius;
            for (axis, at) in middle.to_array().into_iter().enumerate() {
                centre[axis][lane] = at;
            }
        }
        Self {
            centre: centre.map(f32x8::new),
            radius2: f32x8::new(radius2),
        }
    }

    /// Which of them a ray's line meets: one bit each.
    fn met(&self, ray: &Ray) -> u32 {
        let (origin, dir) = (ray.origin.to_array(), ray.dir.to_array());
        let to: [f32x8; 3] = std::array::from_fn(|a| self.centre[a] - f32x8::splat(origin[a]));
        let dir = dir.map(f32x8::splat);
        let along = to[0] * dir[0] + to[1] * dir[1] + to[2] * dir[2];
        let across: [f32x8; 3] = std::array::from_fn(|a| to[a] - dir[a] * along);
        let across2 = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
        across2.simd_le(self.radius2).to_bitmask()
    }
}

impl Capsule {
    /// Distance and normal where a ray from outside enters: at the side, or at an end's ball.
    fn hit(&self, ray: &Ray) -> Option<(f32, Vector)> {
        let axis = self.to - self.from;
        let length2 = axis.dot(axis);
        if length2 > 0.0
            && let Some(hit) = self.side_hit(ray, axis, length2)
        {
            // The ends' balls lie within the cylinder that is entered here.
            return Some(hit);
        }
        let end_hit = |end: Vector| {
            let distance = ball_hit(end, self.radius, ray)?;
            Some((distance, (ray.point_at(distance) - end) / self.radius))
        };
        let from = end_hit(self.from);
        if length2 == 0.0 {
            return from;
        }
        let hits = from.into_iter().chain(end_hit(self.to));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn side_hit(&self, ray: &Ray, axis: Vector, length2: f32) -> Option<(f32, Vector)> {
        // What is left of ray and offset across the axis.
        let offset = ray.origin - self.from;
        let (dir_along, offset_along) = (ray.dir.dot(axis) / length2, offset.dot(axis) / length2);
        let dir = ray.dir - axis * dir_along;
        let across = offset - axis * offset_along;
        let a = dir.dot(dir);
        let half_b = dir.dot(across);
        let c = across.dot(across) - self.radius * self.radius;
        let discriminant = half_b * half_b - a * c;
        if a < 1e-12 || discriminant < 0.0 {
            return None;
        }
        let distance = (-half_b - discriminant.sqrt()) / a;
        let along = offset_along + distance * dir_along;
        let hits = distance >= 0.0 && (0.0..=1.0).contains(&along);
        hits.then(|| (distance, (across + dir * distance) / self.radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(from: [f32; 3], to: [f32; 3]) -> Ray {
        let (from, to) = (Vector::from(from), Vector::from(to));
        Ray::new(from, (to - from).normalize())
    }

    #[test]
    fn a_capsule_is_hit_at_its_side_and_its_round_ends() {
        let capsule = Capsule {
            from: Vector::new(2.0, 0.0, 0.0),
            to: Vector::new(2.0, 0.0, 1.0),
            radius: 0.5,
            color: [0; 3],
        };
        let (side, normal) = capsule.hit(&ray([0.0, 0.3, 0.5], [1.0, 0.3, 0.5])).unwrap();
        // 3-4-5: 2 - 0.4.
        assert!((side - 1.6).abs() < 1e-5, "{side}");
        assert!((normal - Vector::new(-0.8, 0.6, 0.0)).length() < 1e-5);
        let (top, _) = capsule.hit(&ray([2.0, 0.0, 5.0], [2.0, 0.0, 0.0])).unwrap();
        assert!((top - 3.5).abs() < 1e-5, "{top}");
        assert!(
            capsule
                .hit(&ray([0.0, 0.51, 0.5], [1.0, 0.51, 0.5]))
                .is_none()
        );
        assert!(
            capsule
                .hit(&ray([0.0, 0.0, 1.51], [1.0, 0.0, 1.51]))
                .is_none()
        );
        assert!(
            capsule
                .hit(&ray([5.0, 0.0, 0.5], [6.0, 0.0, 0.5]))
                .is_none()
        );
    }

    /// Parts are passed over by the balls around them; none that is met may be.
    #[test]
    fn a_body_is_hit_where_the_nearest_of_its_parts_is() {
        let outfit = Outfit {
            top: [1; 3],
            trousers: [2; 3],
            shoes: [3; 3],
        };
        let person = Person {
            id: 1,
            height_m: 1.9,
            skin: [4; 3],
            hair: [5; 3],
            visits: Vec::new(),
        };
        let presence = Presence {
            map_from_person: Pose::translation(40.0, -30.0, 2.0),
            visit: 0,
            walked_m: 0.3,
            walks: true,
        };
        let body = Body::new(&person, &outfit, &presence);
        let mut hits = 0;
        for i in 0..4000_u16 {
            let aim = [f32::from(i % 50) / 25.0 - 1.0, f32::from(i / 50) / 40.0];
            let ray = ray([36.0, -31.0, 2.6], [40.0, -30.0 + aim[0], 2.0 + aim[1]]);
            let all = body.parts.iter().filter_map(|part| part.hit(&ray));
            let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0));
            let hit = body.cast(&ray, 100.0).map(|hit| (hit.distance, hit.normal));
            assert_eq!(hit, nearest, "{i}");
            hits += usize::from(hit.is_some());
        }
        assert!((500..3000).contains(&hits), "{hits}");
    }
}
