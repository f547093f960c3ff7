//! Pictures of buildings with people in them, from the robot's camera.
//!
//! | file | holds |
//! |---|---|
//! | `color.yuyv` | pictures of 640 x 360, YUYV, one after the other |
//! | `masks.u8` | for each of their pixels whom it shows: 0 is nobody, then the people in the order of `people.csv` |
//! | `people.csv` | `frame,camera,person,id,left,top,right,bottom,visible,whole,distance_m,bearing_deg`: which camera (no two buildings share a number), the box around the visible pixels, pixels seen, pixels if nothing were in the way, how far away, from where seen (0 is the face) |

use std::f64::consts::PI;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use hachi_hal::{Pose, Stamp, Vector3};
use hachi_world::camera::looking_ahead;
use hachi_world::{
    CameraConfig, Person, Preset, SimulatedCamera, SimulationConfig, Trajectory, Visit,
};
use nalgebra::{Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::people::{light, person};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 360;
/// A camera turned less than this looks ahead, radians.
const AHEAD: f64 = 0.3;
/// Half of what the camera sees across, radians.
const HALF_VIEW: f64 = 0.7;
/// People in a building, each in one outfit.
const PEOPLE: u32 = 6;
/// Cameras in a building, each mounted its own way in its own light.
const CAMERAS: usize = 3;
const SHOTS_EACH: usize = 12;
/// Between two shots: nobody is in both.
const SHOT_S: f64 = 3.7;
/// Which buildings, in turns. The corridor is the same whatever its seed, and left out.
const PRESETS: [Preset; 5] = [
    Preset::Office,
    Preset::Building,
    Preset::Office,
    Preset::GlassCorridor,
    Preset::Campus,
];

struct Files {
    color: BufWriter<File>,
    masks: BufWriter<File>,
    people: BufWriter<File>,
    frames: usize,
}

/// Renders this many buildings into the folder; prints how many pictures.
pub fn render(folder: &Path, first_seed: u64, buildings: u64) -> std::io::Result<()> {
    let create = |name: &str| File::create(folder.join(name)).map(BufWriter::new);
    let mut files = Files {
        color: create("color.yuyv")?,
        masks: create("masks.u8")?,
        people: create("people.csv")?,
        frames: 0,
    };
    let columns =
        "frame,camera,person,id,left,top,right,bottom,visible,whole,distance_m,bearing_deg";
    writeln!(files.people, "{columns}")?;
    for seed in first_seed..first_seed + buildings {
        render_building(seed, &mut files)?;
    }
    println!("{} pictures", files.frames);
    Ok(())
}

/// A camera's mount: over the base, and where it looks.
struct Mount {
    base_from_depth: Pose,
    yaw: f64,
}

fn render_building(seed: u64, files: &mut Files) -> std::io::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let preset = PRESETS[(seed % PRESETS.len() as u64) as usize];
    let duration_s = SHOT_S * (CAMERAS * SHOTS_EACH + 1) as f64;
    let mut simulation = SimulationConfig::preset(preset, seed, duration_s);
    let mut people: Vec<Person> = Vec::new();
    for number in 0..PEOPLE {
        let id = seed as u32 * PEOPLE + number;
        let person = person(id, people.last(), &mut random);
        people.push(person);
    }
    let mounts: Vec<Mount> = (0..CAMERAS).map(|_| mount(&mut random)).collect();
    for shot in 0..CAMERAS * SHOTS_EACH {
        let stage = Stage {
            trajectory: &simulation.trajectory,
            time_s: SHOT_S * (shot + 1) as f64,
            yaw: mounts[shot % CAMERAS].yaw,
        };
        stage.put(&mut people, &mut random);
    }
    simulation.people = people.into();
    for (number, mount) in mounts.iter().enumerate() {
        let mut camera = SimulatedCamera::new(&simulation, camera(mount, &mut random));
        let camera_id = seed * CAMERAS as u64 + number as u64;
        for shot in (number..CAMERAS * SHOTS_EACH).step_by(CAMERAS) {
            let time_ns = (SHOT_S * (shot + 1) as f64 * 1e9) as i64;
            camera.skip_to(simulation.start + time_ns);
            write(camera_id, &mut camera, files)?;
        }
    }
    Ok(())
}

fn write(camera_id: u64, camera: &mut SimulatedCamera, files: &mut Files) -> std::io::Result<()> {
    let stamp = camera.next_stamp();
    let map_from_depth = camera.map_from_depth(stamp.unwrap_or(Stamp::from_nanos(0)));
    let Some(frame) = camera.next_color_frame() else {
        return Ok(());
    };
    files.color.write_all(&frame.color)?;
    files.masks.write_all(&frame.masks)?;
    for (number, truth) in frame.people.iter().enumerate() {
        let Some(seen) = truth.visible else { continue };
        let eye = map_from_depth.translation.vector.into();
        let eye = truth.map_from_person.inverse_transform_point(&eye);
        writeln!(
            files.people,
            "{},{camera_id},{},{},{},{},{},{},{},{},{:.3},{:.1}",
            files.frames,
            number + 1,
            truth.id,
            seen.left,
            seen.top,
            seen.right,
            seen.bottom,
            truth.visible_pixels,
            truth.whole_pixels,
            truth.middle_in_color.norm(),
            eye.y.atan2(eye.x).to_degrees(),
        )?;
    }
    files.frames += 1;
    Ok(())
}

fn mount(random: &mut ChaCha8Rng) -> Mount {
    // Half of them look ahead, the others anywhere.
    let yaw = match random.random_bool(0.5) {
        true => random.random_range(-AHEAD..AHEAD),
        false => random.random_range(-PI..PI),
    };
    let up = random.random_range(0.0..0.35);
    let at = [0.3, 0.0, random.random_range(0.0..0.25)];
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Mount {
        base_from_depth: Pose::from_parts(Translation3::identity(), turn) * looking_ahead(at, up),
        yaw,
    }
}

fn camera(mount: &Mount, random: &mut ChaCha8Rng) -> CameraConfig {
    let mut config = CameraConfig::d455(WIDTH, HEIGHT, 0.0);
    config.light = light(random);
    config.luma_sigma = random.random_range(1.0..4.0);
    config.base_from_depth = mount.base_from_depth;
    config
}

/// One shot: where the camera is, and when.
struct Stage<'a> {
    trajectory: &'a Trajectory,
    time_s: f64,
    yaw: f64,
}

impl Stage<'_> {
    /// Lets some of the people be in the picture at that time.
    fn put(&self, people: &mut [Person], random: &mut ChaCha8Rng) {
        let base = self.trajectory.map_from_base(self.time_s);
        let ahead = base.rotation * Vector3::x();
        let heading = ahead.y.atan2(ahead.x) + self.yaw;
        let ahead = self.yaw.abs() < AHEAD;
        let there = [0, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6][random.random_range(0..12)];
        for _ in 0..there {
            let person = &mut people[random.random_range(0..PEOPLE as usize)];
            let begins_s = self.time_s - 0.5;
            let outfit = person.visits[0].outfit;
            let here = |visit: &Visit| visit.ends_s() > begins_s;
            if person.visits.last().is_some_and(here) {
                continue;
            }
            let at = match ahead && random.random_bool(0.6) {
                true => self.on_the_way(random),
                false => self.anywhere(heading, random),
            };
            let walks = random.random_range(-PI..PI);
            // Some stand: they have come a centimetre.
            let speed_m_s = match random.random_bool(0.35) {
                true => 0.02,
                false => random.random_range(0.4..1.7),
            };
            let half = |sign: f64| {
                let way = sign * speed_m_s / 2.0;
                [at[0] + way * walks.cos(), at[1] + way * walks.sin()]
            };
            person.visits.push(Visit {
                begins_s,
                path: vec![half(-1.0), half(1.0)],
                speed_m_s,
                stays_s: 0.0,
                outfit,
            });
        }
    }
}

/// How far away somebody is, metres: more are near than far, but not so that they hide all others.
fn distance(random: &mut ChaCha8Rng) -> f64 {
    0.6 + 9.4 * random.random::<f64>().powf(1.3)
}

impl Stage<'_> {
    /// Beside where the robot is going to be: not in a wall.
    fn on_the_way(&self, random: &mut ChaCha8Rng) -> [f64; 2] {
        let later_s = distance(random) / self.trajectory.gait().speed;
        let there = self.trajectory.map_from_footprint(self.time_s + later_s);
        let beside = Vector3::y() * random.random_range(-0.8..0.8);
        let at = there.transform_point(&beside.into());
        [at.x, at.y]
    }

    /// In the picture, be there a wall or not.
    fn anywhere(&self, heading: f64, random: &mut ChaCha8Rng) -> [f64; 2] {
        let base = self.trajectory.map_from_base(self.time_s).translation;
        let bearing = heading + random.random_range(-HALF_VIEW..HALF_VIEW);
        let distance = distance(random);
        [
            base.x + distance * bearing.cos(),
            base.y + distance * bearing.sin(),
        ]
    }
}
