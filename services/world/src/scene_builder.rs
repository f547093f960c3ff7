//! Puts a scene together from boxes, cylinders, panes, ramps and meshes.

use hachi_hal::Vector3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose as ParryPose, Rotation, Vector};
use parry3d::shape::{Cuboid, Triangle};

use crate::floor::{Floor, RaisedFloor, Terrain};
use crate::ground::{Cover, Ground};
use crate::material::Material;
use crate::scene::{Object, ObjectId, Primitive, Role, Scene, Shape, narrow};

/// Puts a scene together, object by object. Coordinates are metres in the map frame.
#[derive(Debug, Default)]
pub struct SceneBuilder {
    primitives: Vec<Primitive>,
    objects: Vec<Object>,
    ground: Option<Ground>,
    floor: Floor,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    fn object(&mut self, material: Material, role: Role) -> ObjectId {
        self.objects.push(Object { material, role });
        (self.objects.len() - 1) as ObjectId
    }

    fn part(&mut self, object: ObjectId, shape: Shape) {
        self.primitives.push(Primitive::new(shape, object));
    }

    /// A box of edges `size` around `centre`, turned by `yaw` radians about the vertical.
    pub fn cuboid(
        &mut self,
        centre: [f64; 3],
        size: [f64; 3],
        yaw: f64,
        material: Material,
    ) -> ObjectId {
        let object = self.object(material, Role::Structure);
        self.box_part(object, centre, size, yaw);
        object
    }

    /// A level slab of floor whose upper face is at `top`.
    pub fn floor_slab(
        &mut self,
        low: [f64; 2],
        high: [f64; 2],
        top: f64,
        material: Material,
    ) -> ObjectId {
        let object = self.object(material, Role::Floor);
        let thickness = 0.2;
        self.box_part(
            object,
            [
                (low[0] + high[0]) / 2.0,
                (low[1] + high[1]) / 2.0,
                top - thickness / 2.0,
            ],
            [high[0] - low[0], high[1] - low[1], thickness],
            0.0,
        );
        object
    }

    fn box_part(&mut self, object: ObjectId, centre: [f64; 3], size: [f64; 3], yaw: f64) {
        let quarter_turns = yaw / std::f64::consts::FRAC_PI_2;
        let whole = quarter_turns.round();
        let shape = if (quarter_turns - whole).abs() < 1e-9 {
            let [sx, sy, sz] = size;
            let (sx, sy) = if whole.rem_euclid(2.0) == 1.0 {
                (sy, sx)
            } else {
                (sx, sy)
            };
            Shape::AxisBox(Aabb::new(
                narrow(Vector3::new(
                    centre[0] - sx / 2.0,
                    centre[1] - sy / 2.0,
                    centre[2] - sz / 2.0,
                )),
                narrow(Vector3::new(
                    centre[0] + sx / 2.0,
                    centre[1] + sy / 2.0,
                    centre[2] + sz / 2.0,
                )),
            ))
        } else {
            Shape::Box {
                world_from_box: ParryPose::new(
                    narrow(Vector3::from(centre)),
                    Vector::new(0.0, 0.0, yaw as f32),
                ),
                cuboid: Cuboid::new(narrow(Vector3::from(size) / 2.0)),
            }
        };
        self.part(object, shape);
    }

    /// An upright cylinder that stands on `base`.
    pub fn cylinder(
        &mut self,
        base: [f64; 3],
        radius: f64,
        height: f64,
        material: Material,
    ) -> ObjectId {
        let object = self.object(material, Role::Structure);
        self.part(
            object,
            Shape::Cylinder {
                base: narrow(Vector3::from(base)),
                radius: radius as f32,
                height: height as f32,
            },
        );
        object
    }

    /// A ball.
    pub fn ball(&mut self, centre: [f64; 3], radius: f64, material: Material) -> ObjectId {
        let object = self.object(material, Role::Structure);
        self.part(
            object,
            Shape::Ball {
                centre: narrow(Vector3::from(centre)),
                radius: radius as f32,
            },
        );
        object
    }

    /// A box from end to end that follows a slope, its sides upright: the line from `from` to `to`
    /// runs along the middle of its upper face.
    pub fn beam(
        &mut self,
        from: [f64; 3],
        to: [f64; 3],
        width: f64,
        height: f64,
        material: Material,
    ) -> ObjectId {
        let object = self.object(material, Role::Structure);
        let [from, to] = [from, to].map(Vector3::from);
        let along = to - from;
        let (level, length) = (along.xy().norm(), along.norm());
        let yaw = Rotation::from_rotation_z(along.y.atan2(along.x) as f32);
        // A positive turn about y lowers the far end.
        let turn = yaw * Rotation::from_rotation_y(-along.z.atan2(level) as f32);
        let down = turn * Vector::new(0.0, 0.0, -(height as f32) / 2.0);
        let shape = Shape::Box {
            world_from_box: ParryPose::from_parts(narrow((from + to) / 2.0) + down, turn),
            cuboid: Cuboid::new(narrow(Vector3::new(length, width, height) / 2.0)),
        };
        self.part(object, shape);
        object
    }

    /// Rolling ground over a rectangle, and rectangles of it that are covered otherwise: a later
    /// one lies over an earlier one. There is one terrain to a scene: a second replaces the first.
    pub fn terrain(
        &mut self,
        terrain: Terrain,
        low: [f64; 2],
        high: [f64; 2],
        material: Material,
        covered: &[([f64; 2], [f64; 2], Material)],
    ) {
        let mut covers = vec![Cover {
            low,
            high,
            object: self.object(material, Role::Floor),
        }];
        let mut kinds: Vec<(Material, ObjectId)> = Vec::new();
        for &(low, high, material) in covered {
            let known = kinds.iter().find(|(kind, _)| *kind == material);
            let object = match known {
                Some((_, object)) => *object,
                None => {
                    let object = self.object(material, Role::Floor);
                    kinds.push((material, object));
                    object
                }
            };
            covers.push(Cover { low, high, object });
        }
        self.ground = Some(Ground::new(&terrain, low, high, &covers));
        self.floor.terrain = Some(terrain);
    }

    /// An upright pane 1 cm thick, centred on the line from one foot to the other.
    pub fn pane(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        bottom: f64,
        top: f64,
        material: Material,
    ) -> ObjectId {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        self.cuboid(
            [
                (from[0] + to[0]) / 2.0,
                (from[1] + to[1]) / 2.0,
                (bottom + top) / 2.0,
            ],
            [dx.hypot(dy), 0.01, top - bottom],
            dy.atan2(dx),
            material,
        )
    }

    /// Triangles, both sides of which can be hit. Triangles that name a missing vertex are left out.
    pub fn mesh(
        &mut self,
        vertices: &[[f64; 3]],
        triangles: &[[usize; 3]],
        material: Material,
    ) -> ObjectId {
        let object = self.object(material, Role::Structure);
        self.mesh_part(object, vertices, triangles);
        object
    }

    fn mesh_part(&mut self, object: ObjectId, vertices: &[[f64; 3]], triangles: &[[usize; 3]]) {
        for corners in triangles {
            if let [Some(a), Some(b), Some(c)] = corners.map(|corner| vertices.get(corner)) {
                let [a, b, c] = [a, b, c].map(|vertex| narrow(Vector3::from(*vertex)));
                self.part(object, Shape::Triangle(Triangle::new(a, b, c)));
            }
        }
    }

    /// A ramp up, a level stretch and a ramp down: a surface of strips 5 cm long on the ramps,
    /// where a strip departs from the floor's height function by less than 0.2 mm.
    pub fn raised_floor(&mut self, raised: RaisedFloor, material: Material) -> ObjectId {
        const STRIP_M: f64 = 0.05;
        let object = self.object(material, Role::Floor);
        let strips = (raised.ramp_m / STRIP_M).ceil() as usize;
        let stations: Vec<f64> = (0..=strips)
            .map(|i| raised.ramp_m * i as f64 / strips as f64)
            .chain(
                (0..=strips)
                    .map(|i| raised.ramp_m * (1.0 + i as f64 / strips as f64) + raised.level_m),
            )
            .collect();
        let [ux, uy] = raised.along;
        let vertices: Vec<[f64; 3]> = stations
            .iter()
            .flat_map(|&s| {
                [-raised.half_width_m, raised.half_width_m].map(|across| {
                    [
                        raised.start[0] + s * ux - across * uy,
                        raised.start[1] + s * uy + across * ux,
                        raised.profile(s),
                    ]
                })
            })
            .collect();
        let triangles: Vec<[usize; 3]> = (0..stations.len() - 1)
            .flat_map(|i| {
                let a = 2 * i;
                [[a, a + 1, a + 2], [a + 1, a + 3, a + 2]]
            })
            .collect();
        self.mesh_part(object, &vertices, &triangles);
        self.floor.raised.push(raised);
        object
    }

    /// The scene.
    pub fn build(self) -> Scene {
        Scene::new(self.primitives, self.objects, self.ground, self.floor)
    }
}
