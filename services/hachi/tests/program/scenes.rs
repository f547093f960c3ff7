//! Recordings made here, with known truth: a room seen from a sensor that moves 10 cm a scan, and
//! frames of a person.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use hachi_world::{
    CameraConfig, Outfit, Person, Preset, SimulatedCamera, Simulation, SimulationConfig, Visit,
    write_pcap,
};

/// x, y, z, intensity.
pub type Row = [f32; 4];

/// How far the sensor moves along x from one scan of [`room`] to the next, metres.
pub const STEP_M: f32 = 0.1;

/// A room of 8 by 6 by 3 metres with a pillar, 6,000 points spread evenly, from `x` metres along.
pub fn room(x: f32) -> Vec<Row> {
    let mut points = Vec::new();
    // The plastic sequence: evenly spread in two dimensions without a grid of its own.
    let spread = |i: usize, ratio: f64| (i as f64 * ratio).fract() as f32;
    for i in 0..1000 {
        let (a, b) = (spread(i, 0.754_877_666), spread(i, 0.569_840_291));
        let (along, across, up) = (-4.0 + 8.0 * a, -3.0 + 6.0 * b, -1.0 + 3.0 * b);
        points.extend([
            [along, across, -1.0],
            [along, across, 2.0],
            [-4.0, -3.0 + 6.0 * a, up],
            [4.0, -3.0 + 6.0 * a, up],
            [along, -3.0, up],
            [along, 3.0, up],
        ]);
        if i % 4 == 0 {
            points.extend([[2.0, 1.0 + 0.5 * a, up], [2.0 + 0.5 * a, 1.0, up]]);
        }
    }
    points
        .iter()
        .map(|p| [p[0] - x, p[1], p[2], 100.0])
        .collect()
}

/// A scan in KITTI's layout.
pub fn write_bin(folder: &Path, number: usize, points: &[Row]) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let bytes: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let path = folder.join(format!("{number:06}.bin"));
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A folder of `count` scans of [`room`].
pub fn walk(folder: &Path, count: usize) -> PathBuf {
    let scans = folder.join("scans");
    for number in 0..count {
        write_bin(&scans, number, &room(number as f32 * STEP_M));
    }
    scans
}

/// A folder that takes minutes to replay: the same twelve scans there and back, by hard links.
pub fn long_walk(folder: &Path) -> PathBuf {
    const TWELVE: usize = 12;
    let scans = walk(folder, TWELVE);
    for number in TWELVE..20_000 {
        let place = number % (2 * TWELVE);
        let from = place.min(2 * TWELVE - 1 - place);
        std::fs::hard_link(
            scans.join(format!("{from:06}.bin")),
            scans.join(format!("{number:06}.bin")),
        )
        .unwrap();
    }
    scans
}

/// A capture of the simulated VLP-16 in an office.
pub fn capture(folder: &Path, seconds: f64) -> PathBuf {
    let path = folder.join("walk.pcap");
    let mut simulation = Simulation::new(SimulationConfig::preset(Preset::Office, 1, seconds));
    let file = BufWriter::new(std::fs::File::create(&path).unwrap());
    write_pcap(&mut simulation, file).unwrap();
    path
}

/// Somebody in red and blue who walks away from the robot.
pub fn somebody() -> Person {
    Person {
        id: 1,
        height_m: 1.75,
        skin: [220, 180, 150],
        hair: [60, 40, 30],
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![[2.5, 0.5], [6.5, 0.2]],
            speed_m_s: 0.6,
            stays_s: 60.0,
            outfit: Outfit {
                top: [190, 40, 40],
                trousers: [50, 60, 110],
                shoes: [30, 30, 30],
            },
        }],
    }
}

/// Frames of the simulated camera with one person, as PNG files.
pub fn frames_of(person: &Person, folder: &Path) {
    let simulation = SimulationConfig {
        people: [person.clone()].into(),
        ..SimulationConfig::preset(Preset::Office, 1, 20.0)
    };
    let mut camera = SimulatedCamera::new(&simulation, CameraConfig::d455(640, 360, 0.2));
    for number in 0..14 {
        camera.skip_to(simulation.start + 3_000_000_000 + number * 200_000_000);
        let frame = camera.next_frame().unwrap();
        let mut pixels = Vec::new();
        for pair in frame.color.chunks_exact(4) {
            let (u, v) = (f64::from(pair[1]) - 128.0, f64::from(pair[3]) - 128.0);
            for y in [pair[0], pair[2]] {
                // ITU-R BT.601, studio range.
                let y = 1.164 * (f64::from(y) - 16.0);
                let rgb = [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u];
                pixels.extend(rgb.map(|c| c.clamp(0.0, 255.0) as u8));
            }
        }
        let image = ::hachi::images::Rgb {
            width: 640,
            height: 360,
            pixels,
        };
        let path = folder.join(format!("{number}.png"));
        std::fs::write(path, image.to_png().unwrap()).unwrap();
    }
}
