//! A scene: solids with materials, and what a ray hits first.
//!
//! In: what [`SceneBuilder`](crate::SceneBuilder) was told. Out: the nearest hit of a ray. The bounding-volume tree and
//! the intersection with boxes and triangles are parry's; its types stay inside this crate.
//! Elsewhere: materials (`material`), the buildings themselves (`building`).
//!
//! Inside, coordinates are `f32`: a building of 100 m is resolved to 8 µm.

use hachi_hal::Vector3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose as ParryPose, Vector};
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::{Ray, RayCast};
use parry3d::shape::{Cuboid, Triangle};

use crate::fan::{self, Scratch};
use crate::floor::Floor;
use crate::ground::Ground;
use crate::material::Material;
use crate::optics::brightness;

/// Numbers the objects of a scene in the order in which they were added.
pub type ObjectId = u32;

/// What an object is to the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Walls, furniture, everything that stands or hangs.
    Structure,
    /// What one walks on.
    Floor,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Object {
    pub material: Material,
    pub role: Role,
}

#[derive(Debug)]
pub(crate) enum Shape {
    AxisBox(Aabb),
    Box {
        world_from_box: ParryPose,
        cuboid: Cuboid,
    },
    /// Upright. Solved in closed form: parry casts cylinders by an iterative search.
    Cylinder {
        base: Vector,
        radius: f32,
        height: f32,
    },
    Ball {
        centre: Vector,
        radius: f32,
    },
    Triangle(Triangle),
}

impl Shape {
    fn bounds(&self) -> Aabb {
        match self {
            Self::AxisBox(bounds) => *bounds,
            Self::Box {
                world_from_box,
                cuboid,
            } => cuboid.aabb(world_from_box),
            Self::Cylinder {
                base,
                radius,
                height,
            } => Aabb::new(
                *base - Vector::new(*radius, *radius, 0.0),
                *base + Vector::new(*radius, *radius, *height),
            ),
            Self::Ball { centre, radius } => {
                let reach = Vector::new(*radius, *radius, *radius);
                Aabb::new(*centre - reach, *centre + reach)
            }
            Self::Triangle(triangle) => triangle.local_aabb(),
        }
    }

    pub fn distance(&self, ray: &Ray, within: f32) -> Option<f32> {
        match self {
            Self::AxisBox(bounds) => bounds.cast_local_ray(ray, within, true),
            Self::Box {
                world_from_box,
                cuboid,
            } => cuboid.cast_ray(world_from_box, ray, within, true),
            Self::Cylinder {
                base,
                radius,
                height,
            } => cylinder_hit(*base, *radius, *height, ray).map(|(distance, _)| distance),
            Self::Ball { centre, radius } => ball_hit(*centre, *radius, ray),
            Self::Triangle(triangle) => triangle.cast_local_ray(ray, within, true),
        }
    }

    /// The normal where the ray hits; zero if it starts inside or misses.
    fn normal(&self, ray: &Ray, within: f32) -> Vector {
        let hit = match self {
            Self::AxisBox(bounds) => return box_normal(bounds, ray),
            Self::Box {
                world_from_box,
                cuboid,
            } => {
                let half = cuboid.half_extents;
                let ray = ray.inverse_transform_by(world_from_box);
                return world_from_box.rotation * box_normal(&Aabb::new(-half, half), &ray);
            }
            Self::Cylinder {
                base,
                radius,
                height,
            } => {
                return cylinder_hit(*base, *radius, *height, ray)
                    .map_or(Vector::ZERO, |(_, normal)| normal);
            }
            Self::Ball { centre, radius } => {
                return ball_hit(*centre, *radius, ray).map_or(Vector::ZERO, |distance| {
                    (ray.point_at(distance) - *centre) / *radius
                });
            }
            Self::Triangle(triangle) => triangle.cast_local_ray_and_get_normal(ray, within, true),
        };
        hit.map_or(Vector::ZERO, |hit| hit.normal)
    }
}

/// The normal of the face by which a ray enters a box: that of the axis it gets between the faces of
/// last. Zero if the ray starts inside.
fn box_normal(bounds: &Aabb, ray: &Ray) -> Vector {
    let (origin, dir) = (ray.origin.to_array(), ray.dir.to_array());
    let (low, high) = (bounds.mins.to_array(), bounds.maxs.to_array());
    let (mut last, mut normal) = (0.0, [0.0; 3]);
    for axis in 0..3 {
        if dir[axis] != 0.0 {
            let face = if dir[axis] > 0.0 { low } else { high }[axis];
            let enters = (face - origin[axis]) * (1.0 / dir[axis]);
            if enters > last {
                (last, normal) = (enters, [0.0; 3]);
                normal[axis] = -dir[axis].signum();
            }
        }
    }
    Vector::from(normal)
}

/// Distance at which a ray from outside enters a ball.
pub(crate) fn ball_hit(centre: Vector, radius: f32, ray: &Ray) -> Option<f32> {
    let to_centre = centre - ray.origin;
    let along = to_centre.dot(ray.dir);
    // From the foot of the perpendicular, not from the squares of long distances.
    let across = to_centre - ray.dir * along;
    let chord = radius * radius - across.dot(across);
    let distance = along - chord.max(0.0).sqrt();
    (chord >= 0.0 && distance >= 0.0).then_some(distance)
}

/// Distance and normal where a ray from outside enters an upright cylinder.
fn cylinder_hit(base: Vector, radius: f32, height: f32, ray: &Ray) -> Option<(f32, Vector)> {
    let from = ray.origin - base;
    let dir = ray.dir;
    let a = dir.x * dir.x + dir.y * dir.y;
    let mut side = None;
    if a > 1e-12 {
        let half_b = from.x * dir.x + from.y * dir.y;
        let c = from.x * from.x + from.y * from.y - radius * radius;
        let discriminant = half_b * half_b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let distance = (-half_b - discriminant.sqrt()) / a;
        let z = from.z + distance * dir.z;
        if distance >= 0.0 && (0.0..=height).contains(&z) {
            let normal = Vector::new(
                (from.x + distance * dir.x) / radius,
                (from.y + distance * dir.y) / radius,
                0.0,
            );
            side = Some((distance, normal));
        }
    }
    let cap_z = if dir.z < 0.0 { height } else { 0.0 };
    let cap = (cap_z - from.z) / dir.z;
    let (x, y) = (from.x + cap * dir.x, from.y + cap * dir.y);
    if cap >= 0.0 && x * x + y * y <= radius * radius && side.is_none_or(|(d, _)| cap < d) {
        return Some((cap, Vector::new(0.0, 0.0, -dir.z.signum())));
    }
    side
}

#[derive(Debug)]
pub(crate) struct Primitive {
    pub shape: Shape,
    pub object: ObjectId,
    pub bounds: Aabb,
}

impl Primitive {
    pub fn new(shape: Shape, object: ObjectId) -> Self {
        Self {
            bounds: shape.bounds(),
            shape,
            object,
        }
    }
}

/// Where a ray met something.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub distance: f32,
    /// Unit; towards either side of the surface.
    pub normal: Vector,
    pub object: ObjectId,
}

/// Solids with materials, and the floor that one walks on.
#[derive(Debug)]
pub struct Scene {
    primitives: Vec<Primitive>,
    objects: Vec<Object>,
    tree: Bvh,
    ground: Option<Ground>,
    floor: Floor,
    brightest: f32,
}

impl Scene {
    pub(crate) fn new(
        primitives: Vec<Primitive>,
        objects: Vec<Object>,
        ground: Option<Ground>,
        floor: Floor,
    ) -> Self {
        let bounds: Vec<Aabb> = primitives
            .iter()
            .map(|primitive| primitive.bounds)
            .collect();
        Self {
            brightest: objects
                .iter()
                .map(|object| brightness(&object.material))
                .fold(0.0, f32::max),
            tree: Bvh::from_leaves(BvhBuildStrategy::Ploc, &bounds),
            primitives,
            objects,
            ground,
            floor,
        }
    }

    /// The most that any surface scatters back, in units of a white target.
    pub(crate) fn brightest(&self) -> f32 {
        self.brightest
    }

    /// The first hit within `within` metres of a ray with a unit direction, passing by `ignore`.
    pub(crate) fn cast(&self, ray: &Ray, within: f32, ignore: Option<ObjectId>) -> Option<Hit> {
        let ground = (self.ground.as_ref())
            .and_then(|ground| ground.cast(ray, within))
            .filter(|hit| Some(hit.object) != ignore);
        let within = ground.map_or(within, |hit| hit.distance);
        let nearest = self.tree.cast_ray(ray, within, |index, best| {
            let primitive = &self.primitives[index as usize];
            if Some(primitive.object) == ignore {
                return None;
            }
            primitive.shape.distance(ray, best)
        });
        match nearest {
            Some((index, distance)) => Some(self.hit_on(index, ray, distance)),
            None => ground,
        }
    }

    /// As [`cast`](Self::cast) for each of the rays, passing by nothing. They come in fans, see
    /// `fan`, and every `stride`-th ray is about the same, but for some thousandths of a turn.
    /// Their hits are put in the place of what is in `hits`.
    pub(crate) fn cast_fans(
        &self,
        rays: &[Ray],
        stride: usize,
        within: f32,
        scratch: &mut Scratch,
        hits: &mut Vec<Option<Hit>>,
    ) {
        hits.clear();
        hits.resize(rays.len(), None);
        if let Some(ground) = &self.ground {
            ground.cast_alike(rays, stride, within, hits);
        }
        let nearest = &mut scratch.nearest;
        nearest.distances.clear();
        let reaches = hits
            .iter()
            .map(|hit| hit.map_or(within, |hit| hit.distance));
        nearest.distances.extend(reaches);
        nearest.primitives.clear();
        nearest.primitives.resize(rays.len(), None);
        if fan::cast(&self.tree, &self.primitives, rays, scratch) {
            let nearest = &scratch.nearest;
            let found = nearest.primitives.iter().zip(&nearest.distances);
            for ((hit, ray), (number, distance)) in hits.iter_mut().zip(rays).zip(found) {
                if let Some(number) = number {
                    *hit = Some(self.hit_on(*number, ray, *distance));
                }
            }
        } else {
            for (hit, ray) in hits.iter_mut().zip(rays) {
                *hit = self.cast(ray, within, None);
            }
        }
    }

    fn hit_on(&self, index: u32, ray: &Ray, distance: f32) -> Hit {
        let primitive = &self.primitives[index as usize];
        Hit {
            distance,
            normal: primitive.shape.normal(ray, f32::MAX),
            object: primitive.object,
        }
    }

    pub(crate) fn object(&self, id: ObjectId) -> &Object {
        &self.objects[id as usize]
    }

    /// The floor that one walks on.
    pub fn floor(&self) -> &Floor {
        &self.floor
    }

    /// The material of an object, if there is one of that number.
    pub fn material(&self, id: ObjectId) -> Option<&Material> {
        self.objects.get(id as usize).map(|object| &object.material)
    }

    /// How many objects there are.
    pub fn object_count(&self) -> usize {
        self.objects.len()
    }

    /// How many boxes, cylinders, balls and triangles the objects are made of.
    pub fn primitive_count(&self) -> usize {
        self.primitives.len()
    }

    /// The distance along a ray to the first surface, metres, if there is one within `within_m`.
    /// `direction` is a unit vector.
    pub fn distance(&self, from: Vector3, direction: Vector3, within_m: f64) -> Option<f64> {
        let ray = Ray::new(narrow(from), narrow(direction));
        self.cast(&ray, within_m as f32, None)
            .map(|hit| f64::from(hit.distance))
    }
}

pub(crate) fn narrow(v: Vector3) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::RaisedFloor;
    use crate::scene_builder::SceneBuilder;

    fn distance(scene: &Scene, from: [f64; 3], direction: [f64; 3]) -> Option<f64> {
        scene.distance(
            Vector3::from(from),
            Vector3::from(direction).normalize(),
            100.0,
        )
    }

    #[test]
    fn a_turned_box_is_hit_on_its_edge_and_its_face() {
        let mut builder = SceneBuilder::new();
        // A cube of edge 2 turned by 45 degrees: its edge points at the origin from 10 - sqrt 2.
        let eighth = std::f64::consts::FRAC_PI_4;
        builder.cuboid([10.0, 0.0, 0.0], [2.0; 3], eighth, Material::WALL);
        builder.cuboid(
            [0.0, 8.0, 0.0],
            [2.0, 4.0, 2.0],
            2.0 * eighth,
            Material::WALL,
        );
        let scene = builder.build();
        let hit = distance(&scene, [0.0; 3], [1.0, 0.0, 0.0]).unwrap();
        assert!((hit - (10.0 - 2f64.sqrt())).abs() < 1e-5, "{hit}");
        // The second box lies across: turned a quarter, it is 2 m deep along y.
        let hit = distance(&scene, [1.9, 0.0, 0.0], [0.0, 1.0, 0.0]).unwrap();
        assert!((hit - 7.0).abs() < 1e-5, "{hit}");
    }

    #[test]
    fn a_cylinder_is_hit_on_its_side_its_cap_and_not_beside_it() {
        let mut builder = SceneBuilder::new();
        builder.cylinder([5.0, 0.0, -1.0], 0.25, 2.0, Material::CONCRETE);
        let scene = builder.build();
        let side = distance(&scene, [0.0, 0.15, 0.0], [1.0, 0.0, 0.0]).unwrap();
        assert!((side - 4.8).abs() < 1e-5, "{side}"); // 3-4-5 triangle: 5 - 0.2
        let cap = distance(&scene, [5.1, 0.0, 3.0], [0.0, 0.0, -1.0]).unwrap();
        assert!((cap - 2.0).abs() < 1e-5, "{cap}");
        assert_eq!(distance(&scene, [0.0, 0.26, 0.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(distance(&scene, [0.0, 0.0, 1.01], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn a_ball_is_hit_where_it_bulges() {
        let mut builder = SceneBuilder::new();
        builder.ball([5.0, 0.0, 0.0], 0.5, Material::CONCRETE);
        let scene = builder.build();
        let side = distance(&scene, [0.0, 0.3, 0.0], [1.0, 0.0, 0.0]).unwrap();
        assert!((side - 4.6).abs() < 1e-5, "{side}"); // 3-4-5 triangle: 5 - 0.4
        assert_eq!(distance(&scene, [0.0, 0.51, 0.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(distance(&scene, [9.0, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn a_beam_reaches_from_end_to_end_along_its_slope() {
        let mut builder = SceneBuilder::new();
        builder.beam(
            [0.0, 1.0, 0.0],
            [4.0, 1.0, 1.0],
            0.4,
            0.3,
            Material::CONCRETE,
        );
        let scene = builder.build();
        // Its upper edge rises one in four, its ends are cut square to the slope.
        for x in [0.1, 1.0, 2.0, 3.5] {
            let down = distance(&scene, [x, 1.1, 3.0], [0.0, 0.0, -1.0]).unwrap();
            assert!((3.0 - down - x / 4.0).abs() < 1e-5, "at {x}: {down}");
        }
        assert_eq!(distance(&scene, [1.0, 1.21, 3.0], [0.0, 0.0, -1.0]), None);
        let side = distance(&scene, [2.0, 0.0, 0.4], [0.0, 1.0, 0.0]).unwrap();
        assert!((side - 0.8).abs() < 1e-5, "{side}");
    }

    #[test]
    fn the_ramp_surface_is_where_the_floor_says() {
        let mut builder = SceneBuilder::new();
        builder.raised_floor(
            RaisedFloor {
                start: [1.0, 0.0],
                along: [1.0, 0.0],
                half_width_m: 1.0,
                ramp_m: 3.0,
                level_m: 2.0,
                height_m: 0.35,
            },
            Material::FLOOR,
        );
        let scene = builder.build();
        for i in 0..79 {
            let x = 1.03 + f64::from(i) * 0.1;
            let down = distance(&scene, [x, 0.37, 2.0], [0.0, 0.0, -1.0]).unwrap();
            let height = scene.floor().height(x, 0.37);
            assert!(
                (2.0 - down - height).abs() < 2e-4,
                "at {x}: {down}, {height}"
            );
        }
    }

    #[test]
    fn the_nearest_of_many_objects_is_found() {
        // Against brute force: pillars on a grid, rays all around.
        let mut builder = SceneBuilder::new();
        let mut centres = Vec::new();
        for i in -5..=5 {
            for j in -5..=5 {
                if (i, j) != (0, 0) {
                    let centre = [3.0 * f64::from(i), 2.7 * f64::from(j)];
                    centres.push(centre);
                    builder.cylinder([centre[0], centre[1], -1.0], 0.3, 2.0, Material::WALL);
                }
            }
        }
        let scene = builder.build();
        for k in 0..720 {
            let (sin, cos) = (f64::from(k) * 0.5f64.to_radians()).sin_cos();
            let expected = centres
                .iter()
                .filter_map(|c| {
                    let (along, across) = (c[0] * cos + c[1] * sin, c[1] * cos - c[0] * sin);
                    (along > 0.0 && across.abs() < 0.3)
                        .then(|| along - (0.09 - across * across).sqrt())
                })
                .fold(f64::INFINITY, f64::min);
            let got = distance(&scene, [0.0; 3], [cos, sin, 0.0]).unwrap_or(f64::INFINITY);
            assert!(
                got == expected || (got - expected).abs() < 1e-3,
                "ray {k}: {got} and {expected}"
            );
        }
    }
    #[test]
    fn rays_cast_together_hit_what_they_hit_alone() {
        use crate::Preset;
        for preset in Preset::ALL {
            let world = preset.world(5);
            let (mut scratch, mut hits) = (Scratch::default(), Vec::new());
            let mut same = 0;
            for place in 0..60 {
                let time_s = world.trajectory.period_s() * f64::from(place) / 60.0;
                let eye = world.trajectory.map_from_base(time_s).translation.vector;
                let heading = f64::from(place) * 0.9;
                let rays: Vec<Ray> = (0..10)
                    .flat_map(|fan| (0..8).map(move |ray| (fan, ray)))
                    .map(|(fan, ray)| {
                        let azimuth = heading + 0.02 * f64::from(fan) + 0.0003 * f64::from(ray);
                        let up = 0.035 * f64::from(ray + 8 * (fan % 2)) - 0.26;
                        let dir = Vector3::new(azimuth.cos(), azimuth.sin(), up).normalize();
                        Ray::new(narrow(eye + Vector3::z() * 0.2), narrow(dir))
                    })
                    .collect();
                world
                    .scene
                    .cast_fans(&rays, 16, 100.0, &mut scratch, &mut hits);
                for (ray, together) in rays.iter().zip(&hits) {
                    let alone = world.scene.cast(ray, 100.0, None);
                    match (alone, together) {
                        (None, None) => {}
                        (Some(alone), Some(together)) => {
                            let off = (alone.distance - together.distance).abs();
                            assert!(off <= 1e-4 * alone.distance, "{preset:?}: {off}");
                            same += usize::from(alone.object == together.object);
                        }
                        _ => panic!("{preset:?}: {ray:?} hits {alone:?}, {together:?}"),
                    }
                }
            }
            assert!(same > 1500, "{preset:?}: {same}");
        }
    }
}
