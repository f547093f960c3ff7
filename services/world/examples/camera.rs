//! One second of the simulated camera in the office, with two people who walk by: the last frame as
//! `color.ppm` and `depth.pgm` (16 bits, mm) in a folder, and how long a frame takes.
//! `cargo run --release -p hachi-world --example camera -- FOLDER`
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use hachi_world::{CameraConfig, Outfit, Person, Preset, SimulatedCamera, SimulationConfig, Visit};

const SIZE: (u32, u32) = (848, 480);
/// When the robot looks down the corridor, ns.
const BEGIN_NS: i64 = 3_000_000_000;
const FRAMES: u32 = 10;

fn walker(id: u32, top: [u8; 3], path: [[f64; 2]; 2]) -> Person {
    Person {
        id,
        height_m: 1.7 + 0.08 * f64::from(id),
        skin: [220, 180, 150],
        hair: [60, 40, 30],
        visits: vec![Visit {
            begins_s: 0.0,
            path: path.to_vec(),
            speed_m_s: 0.6,
            stays_s: 60.0,
            outfit: Outfit {
                top,
                trousers: [50, 60, 110],
                shoes: [30, 30, 30],
            },
        }],
    }
}

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let simulation = SimulationConfig {
        people: [
            walker(1, [190, 40, 40], [[2.5, 0.6], [6.5, 0.3]]),
            walker(2, [40, 140, 70], [[7.0, -0.4], [4.0, -0.4]]),
        ]
        .into(),
        ..SimulationConfig::preset(Preset::Office, 1, 20.0)
    };
    let mut camera = SimulatedCamera::new(&simulation, CameraConfig::d455(SIZE.0, SIZE.1, 0.2));
    camera.skip_to(simulation.start + BEGIN_NS);
    let begun = Instant::now();
    for _ in 1..FRAMES {
        camera.next_frame();
    }
    let Some(frame) = camera.next_frame() else {
        return Ok(());
    };
    let each = begun.elapsed().as_secs_f64() * 1e3 / f64::from(FRAMES);
    println!("{each:.0} ms a frame of {} x {}, twice", SIZE.0, SIZE.1);
    for person in &frame.people {
        println!(
            "person {}: {:?}, {:.0} % of it seen",
            person.id,
            person.visible,
            100.0 * person.visible_share()
        );
    }
    let mut color = fs::File::create(Path::new(&folder).join("color.ppm"))?;
    write!(color, "P6\n{} {}\n255\n", SIZE.0, SIZE.1)?;
    for pair in frame.color.chunks_exact(4) {
        let (u, v) = (f64::from(pair[1]) - 128.0, f64::from(pair[3]) - 128.0);
        for y in [pair[0], pair[2]] {
            // ITU-R BT.601, studio range.
            let y = 1.164 * (f64::from(y) - 16.0);
            let rgb = [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u];
            color.write_all(&rgb.map(|c| c.clamp(0.0, 255.0) as u8))?;
        }
    }
    let mut depth = fs::File::create(Path::new(&folder).join("depth.pgm"))?;
    write!(depth, "P5\n{} {}\n65535\n", SIZE.0, SIZE.1)?;
    for count in frame.depth.chunks_exact(2) {
        depth.write_all(&[count[1], count[0]])?;
    }
    Ok(())
}
