//! Ready-made worlds.

use std::f64::consts::PI;

use crate::building::{glass_corridor, office, office_people, storey};
use crate::campus::{campus, large_campus};
use crate::cast::Cast;
use crate::material::Material;
use crate::noise::{Purpose, generator};
use crate::person::Person;
use crate::scene::Scene;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, Trajectory, TrajectoryBuilder};

/// A scene, and a robot that patrols it.
#[derive(Debug)]
pub struct World {
    /// What stands where. The floor is at z = 0; the robot starts at the origin and looks along x.
    pub scene: Scene,
    /// Where the robot is.
    pub trajectory: Trajectory,
}

/// Which ready-made world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Preset {
    /// A quadruped on an office floor: corridors, furnished rooms, a ramp.
    Office,
    /// A quadruped in a building with glass on both sides of its long corridors.
    GlassCorridor,
    /// A quadruped in a long corridor without features: its walls say nothing of how far one is.
    Corridor,
    /// The office, with the sensor carried by somebody who hurries, shakes and looks around.
    Stress,
    /// A quadruped at 1 m/s on a storey with corridors on a grid, some of which look alike: more
    /// than 300 m that come back to known corridors in the same and the opposite direction.
    Building,
    /// A quadruped that trots at 2 m/s through the streets of a campus on rolling ground: more
    /// than 2 km, with streets seen again in the same and the opposite direction, some alike.
    Campus,
    /// A robot on wheels at 4 m/s in a campus of ninety blocks: more than 20 km, of which the
    /// greater part leads through streets not seen before.
    CampusLong,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Office,
        Self::GlassCorridor,
        Self::Corridor,
        Self::Stress,
        Self::Building,
        Self::Campus,
        Self::CampusLong,
    ];

    /// Its name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Office => "office",
            Self::GlassCorridor => "glass-corridor",
            Self::Corridor => "corridor",
            Self::Stress => "stress",
            Self::Building => "building",
            Self::Campus => "campus",
            Self::CampusLong => "campus-long",
        }
    }

    /// The preset of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// Who walks about in the world of a seed. In the office: first the robot's person, who walks ahead
    /// of it and looks into rooms on the way, then somebody who goes the same way further ahead, and two
    /// who come towards it. Nobody elsewhere.
    pub fn people(self, seed: u64) -> Vec<Person> {
        if self != Self::Office {
            return Vec::new();
        }
        let mut cast = Cast::new(generator(seed, Purpose::People, u64::MAX));
        let mut random = generator(seed, Purpose::Scene, 0);
        office_people(&mut random, Gait::quadruped(), &mut cast)
    }

    /// The world of a seed; another seed gives another layout.
    pub fn world(self, seed: u64) -> World {
        let mut random = generator(seed, Purpose::Scene, 0);
        match self {
            Self::Office => office(&mut random, Gait::quadruped()),
            Self::GlassCorridor => glass_corridor(&mut random, Gait::quadruped()),
            Self::Corridor => corridor(),
            Self::Stress => office(&mut random, Gait::hand_held()),
            Self::Building => storey(
                seed,
                Gait {
                    corner_cut_m: 1.4,
                    ..Gait::trotting(1.0)
                },
            ),
            Self::Campus => campus(seed, Gait::trotting(2.0)),
            Self::CampusLong => large_campus(seed, Gait::wheeled(4.0)),
        }
    }
}

/// 70 m long, 2.4 m wide, 2.7 m high; the robot walks up and down its middle 50 m.
fn corridor() -> World {
    let (from, to, half_width, height) = (-5.0, 65.0, 1.2, 2.7);
    let (middle, length) = ((from + to) / 2.0, to - from);
    let mut builder = SceneBuilder::new();
    builder.floor_slab([from, -half_width], [to, half_width], 0.0, Material::FLOOR);
    let mut slab = |centre, size, material| builder.cuboid(centre, size, 0.0, material);
    let ceiling = [middle, 0.0, height + 0.1];
    slab(ceiling, [length, 2.0 * half_width, 0.2], Material::CEILING);
    for side in [-1.0, 1.0] {
        let centre = [middle, side * (half_width + 0.1), height / 2.0];
        slab(centre, [length, 0.2, height], Material::WALL);
        let centre = [middle + side * (length / 2.0 + 0.1), 0.0, height / 2.0];
        slab(centre, [0.2, 2.0 * half_width, height], Material::WALL);
    }
    let scene = builder.build();
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::quadruped())
        .stand(1.0)
        .walk(&[[50.0, 0.0]])
        .turn(PI)
        .walk(&[[0.0, 0.0]])
        .turn(PI)
        .build(scene.floor().clone())
        .expect("up, down and two half turns end at the start");
    World { scene, trajectory }
}
