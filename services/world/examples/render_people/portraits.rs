//! People one by one, each in many pictures: from all sides, near and far, in any light, cut off by
//! the picture's edge where they are near.
//!
//! Of each picture of 640 x 360 only the part around the person is rendered, in an empty place:
//! what is behind is black for whoever tells people apart. `portraits.bin` holds one record after
//! the other: id, width and height in pixels (u32, little-endian), YUYV, masks (0 or 1).

use std::f64::consts::PI;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use hachi_hal::{Distortion, Intrinsics, Pose, Vector3};
use hachi_world::camera::looking_ahead;
use hachi_world::preset::World;
use hachi_world::{
    CameraConfig, Gait, Material, Person, SceneBuilder, SimulatedCamera, SimulationConfig,
    TrajectoryBuilder, Visit,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::people::{jacket, light, person};

const EACH: usize = 12;
const PICTURE: [f64; 2] = [640.0, 360.0];
/// Half of how wide a person is with arms and legs apart, metres.
const HALF_PERSON_M: f64 = 0.4;
/// Ids do not meet those of the buildings' people.
const FIRST_ID: u32 = 1_000_000;

/// Renders this many people into the folder.
pub fn render(folder: &Path, first_seed: u64, people: u64) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(folder.join("portraits.bin"))?);
    let mut simulation = empty_place();
    for seed in first_seed..first_seed + people {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Else they would be the first people of the buildings with the same seeds.
        random.set_stream(1);
        let mut somebody = person(FIRST_ID + seed as u32, None, &mut random);
        // One in two changes the jacket, and is who they were.
        let changes = random.random_bool(0.5);
        for number in 0..EACH {
            if changes && number == EACH / 2 {
                somebody.visits[0].outfit.top = jacket(&mut random);
            }
            portrait(&somebody, &mut simulation, &mut random, &mut file)?;
        }
    }
    println!("{people} people");
    Ok(())
}

/// A robot that stands on a floor, and nothing else.
fn empty_place() -> SimulationConfig {
    let mut builder = SceneBuilder::new();
    builder.floor_slab([-20.0, -20.0], [20.0, 20.0], 0.0, Material::FLOOR);
    let scene = builder.build();
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::quadruped())
        .stand(60.0)
        .build(scene.floor().clone())
        .expect("who stands ends where they begin");
    SimulationConfig::new(World { scene, trajectory }, 1, 60.0)
}

fn portrait(
    somebody: &Person,
    simulation: &mut SimulationConfig,
    random: &mut ChaCha8Rng,
    file: &mut impl Write,
) -> std::io::Result<()> {
    let distance: f64 = 1.0 + 8.0 * random.random::<f64>();
    let bearing: f64 = random.random_range(-0.6..0.6);
    let place = [distance * bearing.cos(), distance * bearing.sin()];
    let heading = random.random_range(-PI..PI);
    let walked_m: f64 = random.random_range(0.0..1.4);
    let from = [
        place[0] - walked_m * heading.cos(),
        place[1] - walked_m * heading.sin(),
    ];
    let beyond = [from[0] + 2.0 * heading.cos(), from[1] + 2.0 * heading.sin()];
    let mut somebody = somebody.clone();
    somebody.visits[0] = Visit {
        begins_s: -walked_m,
        path: vec![from, beyond],
        speed_m_s: 1.0,
        stays_s: 0.0,
        outfit: somebody.visits[0].outfit,
    };
    let height_m = somebody.height_m;
    simulation.people = [somebody].into();
    let mut config = CameraConfig::d455(PICTURE[0] as u32, PICTURE[1] as u32, 0.0);
    let over_base = random.random_range(0.0..0.25);
    config.base_from_depth = looking_ahead([0.3, 0.0, over_base], random.random_range(0.0..0.35));
    config.light = light(random);
    config.luma_sigma = random.random_range(1.0..4.0);
    let map_from_camera = simulation.map_from_base(simulation.start) * config.base_from_depth;
    let Some(window) = window(&config.geometry.color, &map_from_camera, place, height_m) else {
        return Ok(());
    };
    config.geometry.color = window;
    let mut camera = SimulatedCamera::new(simulation, config);
    let Some(frame) = camera.next_color_frame() else {
        return Ok(());
    };
    let id = frame.people.first().map_or(0, |truth| truth.id);
    for number in [id, window.width, window.height] {
        file.write_all(&number.to_le_bytes())?;
    }
    file.write_all(&frame.color)?;
    file.write_all(&frame.masks)
}

/// The part of a picture in which somebody stands at a place; `None` if it is hardly any. The lens
/// is taken as perfect: over a person it bends by less than a pixel.
fn window(
    optics: &Intrinsics,
    map_from_camera: &Pose,
    [x, y]: [f64; 2],
    height_m: f64,
) -> Option<Intrinsics> {
    let (mut low, mut high) = (PICTURE, [0.0; 2]);
    for corner in 0..8 {
        let side = |bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
        let z = height_m * (0.5 + 0.5 * side(2));
        let corner = Vector3::new(x + HALF_PERSON_M * side(0), y + HALF_PERSON_M * side(1), z);
        let corner = map_from_camera.inverse_transform_point(&corner.into());
        let depth = corner.z.max(0.1);
        for (axis, along) in [corner.x, corner.y].into_iter().enumerate() {
            let pixel = optics.centre[axis] + optics.focal[axis] * along / depth;
            let pixel = pixel.clamp(0.0, PICTURE[axis]);
            (low[axis], high[axis]) = (pixel.min(low[axis]), pixel.max(high[axis]));
        }
    }
    let low = low.map(f64::floor);
    let width = ((high[0] - low[0]) / 2.0).ceil() as u32 * 2;
    let height = (high[1] - low[1]).ceil() as u32;
    (width >= 12 && height >= 24).then(|| Intrinsics {
        width,
        height,
        focal: optics.focal,
        centre: [optics.centre[0] - low[0], optics.centre[1] - low[1]],
        distortion: Distortion::None,
    })
}
