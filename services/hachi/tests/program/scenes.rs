//! Recordings made here, with known truth: a room seen from a sensor that moves 10 cm a scan.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use hachi_world::{Preset, Simulation, SimulationConfig, write_pcap};

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
