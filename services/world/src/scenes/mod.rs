//! Ten scripted scenes with people, two to three minutes each: what knowing one's person is measured
//! on.
//!
//! In: which scene, a seed. Out: a hall with a robot in it, people who walk as the script says, and
//! which of them the user picks, when. The seed decides who plays, in which clothes, how fast they
//! walk and where exactly. Elsewhere: pictures of it and the truth about them (`camera`).
//!
//! People come from out of the camera's sight and go there; nobody appears in the middle of it.

mod hall;
mod scripts;

use crate::camera::CameraConfig;
use crate::cast::Cast;
use crate::noise::{Purpose, generator};
use crate::simulation::SimulationConfig;

/// Which scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Script {
    /// The person leaves and comes back, five times, somebody else being about.
    Return,
    /// Others walk to and fro between the person and the camera.
    Crossing,
    /// The person comes back in another jacket, with the same trousers and shoes.
    Jacket,
    /// The person changes everything, piece by piece in view, and comes back in the new clothes.
    Wardrobe,
    /// Somebody in similar clothes is about while the person is away.
    Similar,
    /// Somebody in the very same clothes.
    Twin,
    /// The light grows dim and warm and comes back.
    Light,
    /// Eight people come and go.
    Crowd,
    /// The person goes far away and comes near, a slow robot behind.
    Far,
    /// The robot turns away from the person and back.
    Turning,
}

/// A scene, ready to be filmed.
#[derive(Debug, Clone)]
pub struct ScriptedScene {
    /// Hall, people, light and robot.
    pub simulation: SimulationConfig,
    /// The camera on the robot.
    pub camera: CameraConfig,
    /// The identity that the user picks.
    pub target: u32,
    /// When, seconds after the beginning.
    pub picked_at_s: f64,
}

/// Columns and rows of the pictures: the smallest that a D455 sends.
const SIZE: (u32, u32) = (424, 240);
/// How far the camera looks up, radians: a person's head is in view from 1.6 m on.
const UP_RAD: f64 = 0.2;
/// Ten frames a second.
const PERIOD_NS: i64 = 100_000_000;
/// When the user picks, seconds.
const PICKED_AT_S: f64 = 3.0;

impl Script {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Return,
        Self::Crossing,
        Self::Jacket,
        Self::Wardrobe,
        Self::Similar,
        Self::Twin,
        Self::Light,
        Self::Crowd,
        Self::Far,
        Self::Turning,
    ];

    /// Its name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Return => "return",
            Self::Crossing => "crossing",
            Self::Jacket => "jacket",
            Self::Wardrobe => "wardrobe",
            Self::Similar => "similar",
            Self::Twin => "twin",
            Self::Light => "light",
            Self::Crowd => "crowd",
            Self::Far => "far",
            Self::Turning => "turning",
        }
    }

    /// The script of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|script| script.name() == name)
    }

    /// The scene of a seed.
    pub fn scene(self, seed: u64) -> ScriptedScene {
        let random = generator(seed, Purpose::People, self as u64);
        let mut cast = Cast::new(random);
        let play = scripts::write(self, &mut cast);
        let simulation = SimulationConfig {
            people: play.people.into(),
            ..SimulationConfig::new(hall::hall(play.robot), seed, play.lasts_s)
        };
        let camera = CameraConfig {
            period_ns: PERIOD_NS,
            light: play.light,
            ..CameraConfig::d455(SIZE.0, SIZE.1, UP_RAD)
        };
        ScriptedScene {
            simulation,
            camera,
            target: scripts::TARGET,
            picked_at_s: PICKED_AT_S,
        }
    }
}
