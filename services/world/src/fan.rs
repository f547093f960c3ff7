//! What the rays of a packet hit first, cast together.
//!
//! In: the scene's tree and primitives; rays in fans of eight that leave about the same place at
//! about the same azimuth, some thousandths of a turn from fan to fan. Out: for each ray the
//! nearest primitive, the same as if it had been cast alone. Elsewhere: rays cast one by one,
//! behind glass and mirrors (`scene`).
//!
//! Most of the time of a single ray goes into finding what lies on its way at all, and that is
//! nearly the same for its neighbours. So the tree is walked once for all fans, by wedges that hold
//! their rays; of the boxes found, each fan's own wedge takes the few that it may meet, eight at a
//! time; and those are tested against the fan's eight rays at a time.

use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, TraversalAction};
use parry3d::query::Ray;
use wide::f32x8;

use crate::scene::{Primitive, Shape};

/// Rays of a fan.
pub(crate) const RAYS: usize = 8;
/// Steeper rays than this (their level part, of 1) are no fan: an azimuth means little to them.
const LEAST_LEVEL: f32 = 0.2;
/// Rounding may put a wedge this much beside its rays, metres.
const SLACK_M: f32 = 2e-3;
/// In place of the inverse of zero: the product with zero stays zero.
const BIG: f32 = 1e30;

/// The nearest hits so far, of as many rays as there are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Nearest {
    /// The distance along each ray; where nothing is hit, how far it is followed.
    pub distances: Vec<f32>,
    /// What each ray hits, by its number among the primitives.
    pub primitives: Vec<Option<u32>>,
}

/// Room for casting, used again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scratch {
    pub nearest: Nearest,
    /// Numbers of the primitives that some ray may meet.
    met: Vec<u32>,
    /// Their bounds, eight at a time.
    boxes: Vec<Boxes>,
}

/// All places that some rays reach. Ways are measured on the level, so that rays of different
/// elevation move alike in x and y.
struct Wedge {
    axes: [Interval; 3],
    /// How far the farthest-reaching ray goes, on the level.
    reach: f32,
}

/// Where rays begin on one axis, and how they move on it for each metre on the level.
#[derive(Clone, Copy)]
struct Interval {
    from: [f32; 2],
    /// Inverses of the greatest and the least speed; `BIG` where that does not lead that way.
    up: f32,
    down: f32,
    speed: [f32; 2],
}

impl Interval {
    fn new(from: [f32; 2], speed: [f32; 2]) -> Self {
        Self {
            from: [from[0] - SLACK_M, from[1] + SLACK_M],
            up: if speed[1] > 0.0 { 1.0 / speed[1] } else { BIG },
            down: if speed[0] < 0.0 { 1.0 / speed[0] } else { -BIG },
            speed,
        }
    }

    /// When the first ray enters the span and the last one leaves it.
    #[inline]
    fn stay(&self, low: f32, high: f32) -> (f32, f32) {
        let enters = ((low - self.from[1]) * self.up).max((high - self.from[0]) * self.down);
        let leaves = if self.speed[0] > 0.0 {
            (high - self.from[0]) / self.speed[0]
        } else if self.speed[1] < 0.0 {
            (low - self.from[1]) / self.speed[1]
        } else {
            BIG
        };
        (enters, leaves)
    }

    /// The same for eight spans.
    #[inline]
    fn stays(&self, low: f32x8, high: f32x8) -> (f32x8, f32x8) {
        let up = (low - f32x8::splat(self.from[1])) * f32x8::splat(self.up);
        let down = (high - f32x8::splat(self.from[0])) * f32x8::splat(self.down);
        let leaves = if self.speed[0] > 0.0 {
            (high - f32x8::splat(self.from[0])) * f32x8::splat(1.0 / self.speed[0])
        } else if self.speed[1] < 0.0 {
            (low - f32x8::splat(self.from[1])) * f32x8::splat(1.0 / self.speed[1])
        } else {
            f32x8::splat(BIG)
        };
        (up.fast_max(down), leaves)
    }
}

/// Rays enter a box no later than they leave it, but for rounding in this share of the way.
const ROUNDING: f32 = 1e-5;

impl Wedge {
    /// `None` if a ray is too steep.
    fn around<'a>(rays: impl Iterator<Item = (&'a Ray, &'a f32)>) -> Option<Self> {
        let mut from = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
        let mut speed = from;
        let mut reach = 0.0f32;
        for (ray, within) in rays {
            let level = (ray.dir.x * ray.dir.x + ray.dir.y * ray.dir.y).sqrt();
            if level.is_nan() || level < LEAST_LEVEL {
                return None;
            }
            reach = reach.max(within * level);
            let (origin, dir) = (ray.origin.to_array(), (ray.dir / level).to_array());
            for axis in 0..3 {
                let [least, most] = &mut from[axis];
                (*least, *most) = (least.min(origin[axis]), most.max(origin[axis]));
                let [least, most] = &mut speed[axis];
                (*least, *most) = (least.min(dir[axis]), most.max(dir[axis]));
            }
        }
        Some(Self {
            axes: std::array::from_fn(|axis| Interval::new(from[axis], speed[axis])),
            reach: reach + SLACK_M,
        })
    }

    /// Whether a ray may meet the box; a few boxes beside them pass too.
    #[inline]
    fn may_meet(&self, low: Vector, high: Vector) -> bool {
        let [x, y, z] = &self.axes;
        let (x, y, z) = (
            x.stay(low.x, high.x),
            y.stay(low.y, high.y),
            z.stay(low.z, high.z),
        );
        let enters = x.0.max(y.0).max(z.0).max(0.0);
        let leaves = x.1.min(y.1).min(z.1).min(self.reach);
        enters * (1.0 - ROUNDING) <= leaves + SLACK_M
    }

    /// The same for eight boxes: one bit each.
    #[inline]
    fn may_meet_of(&self, boxes: &Boxes) -> u32 {
        let mut enters = f32x8::ZERO;
        let mut leaves = f32x8::splat(self.reach);
        for (axis, interval) in self.axes.iter().enumerate() {
            let stay = interval.stays(boxes.low[axis], boxes.high[axis]);
            enters = enters.fast_max(stay.0);
            leaves = leaves.fast_min(stay.1);
        }
        (enters * f32x8::splat(1.0 - ROUNDING))
            .simd_le(leaves + f32x8::splat(SLACK_M))
            .to_bitmask()
    }
}

/// Eight boxes side by side.
#[derive(Debug, Clone, Copy)]
struct Boxes {
    low: [f32x8; 3],
    high: [f32x8; 3],
}

impl Boxes {
    /// The bounds of up to eight primitives; what is left is nowhere.
    fn of(primitives: &[Primitive], numbers: &[u32]) -> Self {
        let mut low = [[BIG; RAYS]; 3];
        let mut high = [[-BIG; RAYS]; 3];
        for (lane, number) in numbers.iter().enumerate() {
            let bounds = &primitives[*number as usize].bounds;
            for (axis, (from, to)) in (bounds.mins.to_array().into_iter())
                .zip(bounds.maxs.to_array())
                .enumerate()
            {
                (low[axis][lane], high[axis][lane]) = (from, to);
            }
        }
        Self {
            low: low.map(f32x8::new),
            high: high.map(f32x8::new),
        }
    }
}

/// The rays of a fan side by side.
struct Lanes {
    origin: [f32x8; 3],
    inverse: [f32x8; 3],
}

impl Lanes {
    fn new(rays: &[Ray]) -> Self {
        let mut origin = [[0.0; RAYS]; 3];
        let mut inverse = [[BIG; RAYS]; 3];
        for (lane, ray) in rays.iter().enumerate() {
            let (from, dir) = (ray.origin.to_array(), ray.dir.to_array());
            for axis in 0..3 {
                origin[axis][lane] = from[axis];
                if dir[axis] != 0.0 {
                    inverse[axis][lane] = 1.0 / dir[axis];
                }
            }
        }
        Self {
            origin: origin.map(f32x8::new),
            inverse: inverse.map(f32x8::new),
        }
    }

    /// Where each ray enters a box, and which of them do so no later than `best`: the same
    /// arithmetic as parry's, so a box is as far as it is for a single ray.
    #[inline]
    fn enter(&self, low: Vector, high: Vector, best: f32x8) -> (f32x8, u32) {
        let (mut near, mut far) = (f32x8::ZERO, best);
        for (axis, (low, high)) in [(low.x, high.x), (low.y, high.y), (low.z, high.z)]
            .into_iter()
            .enumerate()
        {
            let a = (f32x8::splat(low) - self.origin[axis]) * self.inverse[axis];
            let b = (f32x8::splat(high) - self.origin[axis]) * self.inverse[axis];
            near = near.fast_max(a.fast_min(b));
            far = far.fast_min(a.fast_max(b));
        }
        (near, near.simd_le(far).to_bitmask())
    }
}

/// Finds what each ray hits before it has gone `scratch.nearest.distances`, and puts it there. Of
/// two primitives at the same distance the one of the lower number counts. The rays are whole fans;
/// those of even and of odd number lie near each other. `false` if they are no fans: then nothing
/// is found.
pub(crate) fn cast(
    tree: &Bvh,
    primitives: &[Primitive],
    rays: &[Ray],
    scratch: &mut Scratch,
) -> bool {
    let Scratch {
        nearest,
        met,
        boxes,
    } = scratch;
    let every_other = |first: usize| {
        let fans = rays.chunks(RAYS).zip(nearest.distances.chunks(RAYS));
        let fans = fans.skip(first).step_by(2);
        Wedge::around(fans.flat_map(|(rays, reaches)| rays.iter().zip(reaches)))
    };
    let (Some(even), Some(odd)) = (every_other(0), every_other(1)) else {
        return false;
    };
    met.clear();
    tree.traverse(|node| {
        let (low, high) = (node.mins(), node.maxs());
        if !even.may_meet(low, high) && !odd.may_meet(low, high) {
            return TraversalAction::Prune;
        }
        if let Some(number) = node.leaf_data() {
            met.push(number);
        }
        TraversalAction::Continue
    });
    boxes.clear();
    boxes.extend(
        met.chunks(RAYS)
            .map(|numbers| Boxes::of(primitives, numbers)),
    );
    for (rays, (distances, hits)) in rays
        .chunks(RAYS)
        .zip((nearest.distances.chunks_mut(RAYS)).zip(nearest.primitives.chunks_mut(RAYS)))
    {
        let Some(wedge) = Wedge::around(rays.iter().zip(&*distances)) else {
            return false;
        };
        let lanes = Lanes::new(rays);
        for (boxes, numbers) in boxes.iter().zip(met.chunks(RAYS)) {
            let mut may_meet = wedge.may_meet_of(boxes);
            while may_meet != 0 {
                let lane = may_meet.trailing_zeros() as usize;
                may_meet &= may_meet - 1;
                if let Some(&number) = numbers.get(lane) {
                    meet(primitives, number, rays, &lanes, distances, hits);
                }
            }
        }
    }
    true
}

/// Tests the rays of a fan against one primitive.
#[inline]
fn meet(
    primitives: &[Primitive],
    number: u32,
    rays: &[Ray],
    lanes: &Lanes,
    distances: &mut [f32],
    hits: &mut [Option<u32>],
) {
    let primitive = &primitives[number as usize];
    let mut best = [0.0; RAYS];
    best[..distances.len()].copy_from_slice(distances);
    let bounds = &primitive.bounds;
    let (enters, mut hit) = lanes.enter(bounds.mins, bounds.maxs, f32x8::new(best));
    if hit == 0 {
        return;
    }
    let enters = enters.to_array();
    while hit != 0 {
        let ray = hit.trailing_zeros() as usize;
        hit &= hit - 1;
        if ray >= rays.len() {
            break;
        }
        let distance = match &primitive.shape {
            Shape::AxisBox(_) => enters[ray],
            shape => match shape.distance(&rays[ray], distances[ray]) {
                Some(distance) => distance,
                None => continue,
            },
        };
        let before_equal =
            distance == distances[ray] && hits[ray].is_some_and(|other| number < other);
        if distance < distances[ray] || before_equal {
            distances[ray] = distance;
            hits[ray] = Some(number);
        }
    }
}
