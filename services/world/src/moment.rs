//! A scene at one moment: what stands in it, and who walks in it.

use parry3d::query::Ray;

use crate::material::Material;
use crate::optics::brightness;
use crate::person::Body;
use crate::scene::{Hit, Object, ObjectId, Role, Scene};

/// People are objects too: their numbers begin here, each person's identity added.
pub(crate) const FIRST_PERSON: ObjectId = 1 << 31;

/// What a laser meets of a person: clothes, mostly.
const CLOTHED: Object = Object {
    material: Material::CLOTH,
    role: Role::Structure,
};

/// A scene with people in it.
#[derive(Clone, Copy)]
pub(crate) struct Moment<'a> {
    pub scene: &'a Scene,
    pub bodies: &'a [Body],
}

impl<'a> Moment<'a> {
    /// The first hit within `within` metres of a ray with a unit direction, passing by `ignore`.
    pub fn cast(&self, ray: &Ray, within: f32, ignore: Option<ObjectId>) -> Option<Hit> {
        self.nearer(ray, within, self.scene.cast(ray, within, ignore))
    }

    /// The first hit of a ray that meets `hit` first in the scene: that, or somebody before it.
    pub fn nearer(&self, ray: &Ray, within: f32, hit: Option<Hit>) -> Option<Hit> {
        let mut nearest = hit;
        for body in self.bodies {
            let best = nearest.map_or(within, |hit| hit.distance);
            if let Some(met) = body.cast(ray, best) {
                nearest = Some(Hit {
                    distance: met.distance,
                    normal: met.normal,
                    object: FIRST_PERSON.saturating_add(body.id()),
                });
            }
        }
        nearest
    }

    pub fn object(&self, id: ObjectId) -> &'a Object {
        if id >= FIRST_PERSON {
            return &CLOTHED;
        }
        self.scene.object(id)
    }

    /// The most that any surface scatters back, in units of a white target.
    pub fn brightest(&self) -> f32 {
        if self.bodies.is_empty() {
            return self.scene.brightest();
        }
        self.scene.brightest().max(brightness(&CLOTHED.material))
    }
}
