//! Follows one laser pulse through the scene to every echo it causes.
//!
//! In: a beam (origin and direction in the map frame). Out: echoes, each with its path length,
//! its strength, the calibrated intensity and what it truly is. Elsewhere: which echoes a sensor
//! reports, and range noise (`sensor`).
//!
//! The model: a surface scatters `reflectivity * cos(incidence)^exponent` back; the received power
//! falls with the square of the path. A pane of glass or a polished floor also mirrors (Schlick)
//! and glass lets light through; as the echo comes back the same way, each share counts twice.
//! The sensor takes the pulse to have flown straight: structure seen in a mirror appears behind
//! it, at the length of the folded path. Calibrated intensity is range-free, as the VLP-16 manual
//! has it: 0 to 100 for diffuse targets, above for retro-reflectors.

use parry3d::math::Vector;
use parry3d::query::Ray;

use crate::material::{Finish, Material, mirrored_share};
use crate::moment::Moment;
use crate::scene::{Hit, ObjectId, Role};

/// What a return truly is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum ReturnLabel {
    /// The sensor reports nothing here.
    #[default]
    None,
    /// Structure, seen straight.
    Direct,
    /// Floor, seen straight.
    Floor,
    /// The surface of a pane of glass.
    GlassSurface,
    /// Something behind a pane, seen through it: where it is reported.
    ThroughGlass,
    /// Something seen in a pane as in a mirror: not where it is reported.
    Ghost,
    /// Something seen in a polished floor: reported below the floor, where nothing is.
    FloorGhost,
    /// Nothing at all: dust, stray light, another sensor's pulse.
    Stray,
}

impl ReturnLabel {
    /// All but [`ReturnLabel::None`].
    pub const RETURNS: [Self; 7] = [
        Self::Direct,
        Self::Floor,
        Self::GlassSurface,
        Self::ThroughGlass,
        Self::Ghost,
        Self::FloorGhost,
        Self::Stray,
    ];

    /// Whether there is nothing where this return is reported.
    pub const fn is_ghost(self) -> bool {
        matches!(self, Self::Ghost | Self::FloorGhost | Self::Stray)
    }
}

/// One echo of a pulse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Echo {
    /// Length of the path to the surface, metres.
    pub distance: f32,
    /// Received power, in units of a white target at 1 m.
    pub power: f32,
    /// Calibrated intensity, 0 to 255.
    pub intensity: f32,
    pub label: ReturnLabel,
    /// What scattered the light back.
    pub object: ObjectId,
}

/// As many echoes as are kept of one pulse; weaker ones give way to stronger ones.
const MAX_ECHOES: usize = 8;
/// Mirrored or passed through so often, nothing of the pulse is left to detect.
const MAX_DEPTH: u8 = 3;
/// Below this share of the pulse a branch is not followed: a wall seen in two coated panes, one
/// after the other, head-on.
const MIN_GAIN: f32 = 2e-3;
/// Least power that is detected: that of a 10 % target at 100 m, which the VLP-16's data sheet
/// promises.
pub(crate) const MIN_POWER: f32 = 1e-5;
/// No echo from nearer is reported, metres.
pub(crate) const MIN_RANGE_M: f32 = 0.3;
/// How much stronger than a white target a retro-reflector answers.
const RETRO_GAIN: f32 = 10.0;
/// A clean pane answers head-on, within about this angle (radians) of its normal.
const GLINT_WIDTH: f32 = 0.2;
/// What dust on a pane scatters back at any angle.
const DUST: f32 = 1e-4;

/// The echoes of one pulse.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Echoes {
    echoes: [Echo; MAX_ECHOES],
    len: usize,
}

impl Echoes {
    pub fn new() -> Self {
        let none = Echo {
            distance: 0.0,
            power: 0.0,
            intensity: 0.0,
            label: ReturnLabel::None,
            object: 0,
        };
        Self {
            echoes: [none; MAX_ECHOES],
            len: 0,
        }
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn as_slice(&self) -> &[Echo] {
        &self.echoes[..self.len]
    }

    fn push(&mut self, echo: Echo) {
        if self.len < MAX_ECHOES {
            self.echoes[self.len] = echo;
            self.len += 1;
            return;
        }
        let mut weakest = 0;
        for i in 1..MAX_ECHOES {
            if self.echoes[i].power < self.echoes[weakest].power {
                weakest = i;
            }
        }
        if self.echoes[weakest].power < echo.power {
            self.echoes[weakest] = echo;
        }
    }
}

#[derive(Clone, Copy)]
struct Branch {
    ray: Ray,
    travelled: f32,
    gain: f32,
    /// What mirrored or passed the light last: its faces are not hit again from here.
    ignore: Option<ObjectId>,
    seen: Seen,
    depth: u8,
}

#[derive(Clone, Copy, PartialEq)]
enum Seen {
    Straight,
    ThroughGlass,
    InGlass,
    InFloor,
}

impl Seen {
    fn label(self, plain: ReturnLabel) -> ReturnLabel {
        match self {
            Self::Straight => plain,
            Self::ThroughGlass => ReturnLabel::ThroughGlass,
            Self::InGlass => ReturnLabel::Ghost,
            Self::InFloor => ReturnLabel::FloorGhost,
        }
    }
}

/// The most that a material scatters back, in units of a white target.
pub(crate) fn brightness(material: &Material) -> f32 {
    match material.finish {
        Finish::Retroreflective => RETRO_GAIN * material.reflectivity,
        _ => material.reflectivity + DUST,
    }
}

/// Which echoes are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// All.
    Every,
    /// The strongest from beyond the least range; branches that cannot beat it are left out.
    Strongest,
}

/// Adds the echoes of a pulse of strength `gain` within `max_range` to `echoes`. `first_hit` is
/// what the pulse hits first within that range.
pub(crate) fn trace(
    moment: Moment<'_>,
    ray: Ray,
    first_hit: Option<Hit>,
    gain: f32,
    max_range: f32,
    wanted: Wanted,
    echoes: &mut Echoes,
) {
    let Some(hit) = first_hit else {
        return;
    };
    let first = Branch {
        ray,
        travelled: 0.0,
        gain,
        ignore: None,
        seen: Seen::Straight,
        depth: 0,
    };
    let mut met = (first, hit, scatter(moment, &first, &hit));
    echoes.push(met.2.echo);
    // Half the least power is the least that luck lets a sensor detect.
    let mut to_beat = MIN_POWER / 2.0;
    if met.2.mirrored == 0.0 && met.2.passed == 0.0 {
        return;
    }
    // Each branch adds at most two and takes one away, MAX_DEPTH deep.
    let mut stack = [first; MAX_DEPTH as usize + 2];
    let mut waiting = 0;
    loop {
        let (branch, hit, scattered) = &met;
        if wanted == Wanted::Strongest && scattered.echo.distance >= MIN_RANGE_M {
            to_beat = to_beat.max(scattered.echo.power);
        }
        if branch.depth < MAX_DEPTH {
            for next in onward(moment, branch, hit, scattered) {
                if next.gain > MIN_GAIN {
                    stack[waiting] = next;
                    waiting += 1;
                }
            }
        }
        met = loop {
            if waiting == 0 {
                return;
            }
            waiting -= 1;
            let branch = stack[waiting];
            // Whatever this branch meets is at least so far away and at best so bright.
            let best = branch.gain * moment.brightest() / (branch.travelled * branch.travelled);
            if best < to_beat {
                continue;
            }
            let within = max_range - branch.travelled;
            if let Some(hit) = moment.cast(&branch.ray, within, branch.ignore) {
                break (branch, hit, scatter(moment, &branch, &hit));
            }
        };
        echoes.push(met.2.echo);
    }
}

/// What becomes of a branch at a surface.
#[derive(Clone, Copy)]
struct Scattered {
    echo: Echo,
    /// Shares of its light.
    mirrored: f32,
    passed: f32,
}

fn scatter(moment: Moment<'_>, branch: &Branch, hit: &Hit) -> Scattered {
    let object = moment.object(hit.object);
    let material = &object.material;
    let distance = branch.travelled + hit.distance;
    let cosine = hit.normal.dot(branch.ray.dir).abs().min(1.0);
    let (mirrored, passed, plain) = match material.finish {
        Finish::Matte | Finish::Retroreflective => (0.0, 0.0, ReturnLabel::Direct),
        Finish::Polished { mirrored } => {
            (mirrored_share(mirrored, cosine), 0.0, ReturnLabel::Direct)
        }
        Finish::Glass { mirrored, absorbed } => {
            let mirrored = mirrored_share(mirrored, cosine);
            (
                mirrored,
                (1.0 - mirrored - absorbed).max(0.0),
                ReturnLabel::GlassSurface,
            )
        }
    };
    let plain = match object.role {
        Role::Floor => ReturnLabel::Floor,
        Role::Structure => plain,
    };
    let scattered = if material.is_glass() {
        let angle = cosine.acos() / GLINT_WIDTH;
        material.reflectivity * (-angle * angle).exp() + DUST
    } else {
        material.reflectivity * darkening(material, cosine) * (1.0 - mirrored)
    };
    let (power, intensity) = match material.finish {
        // The manual puts an ideal retro-reflector at 255 and the least of them above 100.
        Finish::Retroreflective => (
            RETRO_GAIN * scattered,
            100.0 + 155.0 * branch.gain * scattered,
        ),
        _ => (scattered, 100.0 * branch.gain * scattered),
    };
    Scattered {
        echo: Echo {
            distance,
            power: branch.gain * power / (distance * distance).max(0.01),
            intensity,
            label: branch.seen.label(plain),
            object: hit.object,
        },
        mirrored,
        passed,
    }
}

/// The cosine to the material's power, the two usual ones in a hurry.
fn darkening(material: &Material, cosine: f32) -> f32 {
    match material.incidence_exponent {
        1.0 => cosine,
        0.5 => cosine.sqrt(),
        exponent => cosine.powf(exponent),
    }
}

/// Where the light goes on from a surface, in the mirror and beyond it, the stronger branch last:
/// it is followed first.
fn onward(moment: Moment<'_>, branch: &Branch, hit: &Hit, scattered: &Scattered) -> [Branch; 2] {
    let (mirrored, passed) = (scattered.mirrored, scattered.passed);
    let role = moment.object(hit.object).role;
    let point = branch.ray.point_at(hit.distance);
    let next = Branch {
        travelled: scattered.echo.distance,
        ignore: Some(hit.object),
        depth: branch.depth + 1,
        ..*branch
    };
    let mirror = Branch {
        ray: Ray::new(
            point,
            branch.ray.dir - hit.normal * (2.0 * hit.normal.dot(branch.ray.dir)),
        ),
        gain: branch.gain * mirrored * mirrored,
        seen: match (branch.seen, role) {
            (Seen::InGlass, _) | (_, Role::Structure) => Seen::InGlass,
            (_, Role::Floor) => Seen::InFloor,
        },
        ..next
    };
    let beyond = Branch {
        ray: Ray::new(point, branch.ray.dir),
        gain: branch.gain * passed * passed,
        seen: match branch.seen {
            Seen::Straight => Seen::ThroughGlass,
            seen => seen,
        },
        ..next
    };
    if mirror.gain > beyond.gain {
        [beyond, mirror]
    } else {
        [mirror, beyond]
    }
}

/// A direction from components; keeps parry's vector type out of the other modules.
pub(crate) fn beam(origin: [f64; 3], direction: [f64; 3]) -> Ray {
    let narrow = |v: [f64; 3]| Vector::new(v[0] as f32, v[1] as f32, v[2] as f32);
    Ray::new(narrow(origin), narrow(direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene_builder::SceneBuilder;

    fn echoes_of(scene: &Scene, origin: [f64; 3], direction: [f64; 3]) -> Vec<Echo> {
        let mut echoes = Echoes::new();
        let ray = beam(origin, direction);
        let hit = scene.cast(&ray, 100.0, None);
        let moment = Moment { scene, bodies: &[] };
        trace(moment, ray, hit, 1.0, 100.0, Wanted::Every, &mut echoes);
        echoes.as_slice().to_vec()
    }

    /// A pane along x whose near face is at y = 2, and a wall facing it at y = -1.
    fn corridor_with_pane() -> Scene {
        let mut builder = SceneBuilder::new();
        builder.pane(
            [-20.0, 2.005],
            [20.0, 2.005],
            -5.0,
            5.0,
            Material::COATED_GLASS,
        );
        builder.cuboid([0.0, -1.1, 0.0], [40.0, 0.2, 10.0], 0.0, Material::WALL);
        builder.build()
    }

    #[test]
    fn a_ghost_is_the_exact_mirror_image_of_the_wall() {
        let scene = corridor_with_pane();
        for degrees in [20.0_f64, 45.0, 70.0] {
            let (along, across) = degrees.to_radians().sin_cos();
            let echoes = echoes_of(&scene, [0.0; 3], [along, across, 0.0]);
            let ghost = echoes
                .iter()
                .find(|e| e.label == ReturnLabel::Ghost)
                .unwrap();
            // The wall at y = -1 mirrored in y = 2 stands at y = 5.
            let y = f64::from(ghost.distance) * across;
            assert!((y - 5.0).abs() < 1e-4, "at {degrees} degrees y = {y}");
            assert!(ghost.intensity < 15.0, "{ghost:?}");
        }
    }

    #[test]
    fn glass_answers_weakly_head_on_and_hardly_at_an_angle() {
        let scene = corridor_with_pane();
        let surface = |direction| {
            let echoes = echoes_of(&scene, [0.0; 3], direction);
            *echoes
                .iter()
                .find(|e| e.label == ReturnLabel::GlassSurface)
                .unwrap()
        };
        let head_on = surface([0.0, 1.0, 0.0]);
        assert!((head_on.distance - 2.0).abs() < 1e-5);
        assert!(
            head_on.intensity > 5.0 && head_on.intensity < 15.0,
            "{head_on:?}"
        );
        let aslant = surface([0.6, 0.8, 0.0]);
        assert!(aslant.power < head_on.power / 100.0, "{aslant:?}");
    }

    #[test]
    fn what_is_behind_glass_is_seen_where_it_is_but_darker() {
        let mut builder = SceneBuilder::new();
        builder.pane([-2.0, 2.0], [2.0, 2.0], -1.0, 1.0, Material::CLEAR_GLASS);
        builder.cuboid([0.0, 5.5, 0.0], [4.0, 1.0, 2.0], 0.0, Material::WALL);
        let scene = builder.build();
        let echoes = echoes_of(&scene, [0.0; 3], [0.0, 1.0, 0.0]);
        let wall = echoes
            .iter()
            .find(|e| e.label == ReturnLabel::ThroughGlass)
            .unwrap();
        assert!((wall.distance - 5.0).abs() < 1e-5);
        // Passed twice: (1 - 0.08 - 0.04)^2 of 62.
        assert!(
            (wall.intensity - 62.0 * 0.88 * 0.88).abs() < 0.01,
            "{wall:?}"
        );
    }

    #[test]
    fn leaving_out_weak_branches_does_not_change_the_strongest_echo() {
        let world = crate::Preset::GlassCorridor.world(3);
        let strongest = |wanted, azimuth: f64, up: f64| {
            let mut echoes = Echoes::new();
            let ray = beam([1.0, 0.1, 0.6], [azimuth.cos(), azimuth.sin(), up]);
            let dir = ray.dir.normalize();
            let ray = Ray::new(ray.origin, dir);
            let moment = Moment {
                scene: &world.scene,
                bodies: &[],
            };
            let hit = world.scene.cast(&ray, 100.0, None);
            trace(moment, ray, hit, 1.0, 100.0, wanted, &mut echoes);
            echoes
                .as_slice()
                .iter()
                .filter(|e| e.distance >= MIN_RANGE_M && e.power >= MIN_POWER)
                .max_by(|a, b| a.power.total_cmp(&b.power))
                .copied()
        };
        for i in 0..5000 {
            let (azimuth, up) = (f64::from(i) * 0.0131, f64::from(i % 17) * 0.03 - 0.25);
            assert_eq!(
                strongest(Wanted::Every, azimuth, up),
                strongest(Wanted::Strongest, azimuth, up)
            );
        }
    }

    #[test]
    fn a_polished_floor_shows_the_wall_below_the_floor() {
        let mut builder = SceneBuilder::new();
        builder.floor_slab([-10.0, -10.0], [10.0, 10.0], 0.0, Material::POLISHED_FLOOR);
        builder.cuboid([5.5, 0.0, 2.0], [1.0, 4.0, 4.0], 0.0, Material::WALL);
        let scene = builder.build();
        // From 1 m up, 45 degrees down: the mirrored ray meets the wall at x = 5.
        let half = 0.5_f64.sqrt();
        let echoes = echoes_of(&scene, [0.0, 0.0, 1.0], [half, 0.0, -half]);
        let ghost = echoes
            .iter()
            .find(|e| e.label == ReturnLabel::FloorGhost)
            .unwrap();
        assert!((f64::from(ghost.distance) - 5.0 * 2f64.sqrt()).abs() < 1e-4);
        assert!(echoes.iter().any(|e| e.label == ReturnLabel::Floor));
    }

    #[test]
    fn a_floor_at_grazing_incidence_is_darker_than_a_wall_head_on() {
        let mut builder = SceneBuilder::new();
        builder.floor_slab([-50.0, -50.0], [50.0, 50.0], 0.0, Material::FLOOR);
        let scene = builder.build();
        for (degrees, counts) in [(15.0_f64, 7.765), (5.0, 2.615), (1.0, 0.524)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let echoes = echoes_of(&scene, [0.0, 0.0, 0.65], [cos, 0.0, -sin]);
            assert!((f64::from(echoes[0].intensity) - counts).abs() < 0.01); // 30 sin
            assert_eq!(echoes[0].label, ReturnLabel::Floor);
        }
    }
}
