//! What each filter costs on a scan of 16 beams and 1800 firings in a corridor of glass, and on
//! any scans named: files of float32 x, y, z, intensity (0 to 1), as KITTI has them.
//!
//! `cargo run --release -p hachi-cloud --example filter_times [-- SCAN.bin...]`
//!
//! Median and best of 41 runs of the whole pipeline, with one filter after another switched on.
#![allow(clippy::print_stdout, reason = "an example prints its result")]

use std::time::Instant;

use hachi_cloud::{FilterConfig, Filters, IntensityMode, ScanFrames};
use hachi_hal::{Point, Pose};

/// A corridor 2.4 m wide: floor, a wall on the right, its mirror image behind glass on the left.
fn corridor() -> Vec<Point> {
    let mut points = Vec::new();
    for step in 0..1800usize {
        for ring in 0..16usize {
            let azimuth = step as f32 * 0.2f32.to_radians();
            let elevation = (ring as f32 * 2.0 - 15.0).to_radians();
            let (x, y, z) = (
                elevation.cos() * azimuth.cos(),
                elevation.cos() * azimuth.sin(),
                elevation.sin(),
            );
            let seed = (step * 16 + ring).wrapping_mul(2_654_435_761) >> 12;
            let is_dust = y * 1.0 > 0.985 || (y > 0.0 && seed % 20 == 0);
            let to_side = match (y > 0.0, is_dust) {
                (true, true) => 1.2 / y,
                (true, false) => 3.6 / y,
                (false, _) => -1.2 / y.min(-1e-6),
            };
            let to_floor = if z < 0.0 { -0.6 / z } else { f32::INFINITY };
            let to_end = 12.0 / x.abs().max(1e-6);
            let distance = to_side.min(to_floor).min(to_end) + (seed % 100) as f32 * 3e-4;
            let intensity = if is_dust || to_floor < to_side {
                5.0
            } else {
                60.0
            };
            points.push(Point {
                intensity,
                ..Point::at(x * distance, y * distance, z * distance)
            });
        }
    }
    points
}

/// float32 x y z intensity (0 to 1).
fn read_bin(path: &str) -> std::io::Result<Vec<Point>> {
    let bytes = std::fs::read(path)?;
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let points = bytes.chunks_exact(16).map(|b| Point {
        intensity: number(&b[12..]) * 255.0,
        ..Point::at(number(b), number(&b[4..]), number(&b[8..]))
    });
    Ok(points.collect())
}

fn main() -> std::io::Result<()> {
    report("a corridor", &corridor(), 0.6);
    for path in std::env::args().skip(1) {
        // The data set's sensor setup: 1.73 m above the road.
        report(&path, &read_bin(&path)?, 1.73);
    }
    Ok(())
}

/// Times one filter after another on a scan of a sensor `height_m` above the ground.
fn report(name: &str, points: &[Point], height_m: f64) {
    let given = ScanFrames {
        footprint_from_lidar: Some(Pose::translation(0.0, 0.0, height_m)),
        ..ScanFrames::default()
    };
    let off = FilterConfig {
        outliers: false,
        intensity: IntensityMode::None,
        ghosts: false,
        ..FilterConfig::default()
    };
    let outliers = FilterConfig {
        outliers: true,
        ..off.clone()
    };
    let naive = FilterConfig {
        intensity: IntensityMode::Naive,
        ..off.clone()
    };
    let normal = FilterConfig {
        intensity: IntensityMode::Normal,
        ..off.clone()
    };
    let ghosts = FilterConfig {
        ghosts: true,
        ..off.clone()
    };
    let ceiling = FilterConfig {
        ceiling: true,
        ..off.clone()
    };
    let (all, unknown) = (FilterConfig::default(), ScanFrames::default());
    println!("{name}: {} points; median and best of 41, ms", points.len());
    for (name, config, frames) in [
        ("crop and compaction", off, given),
        ("... and outliers", outliers, given),
        ("... and naive intensity", naive.clone(), given),
        ("... and normal intensity", normal, given),
        ("... and ghosts", ghosts, given),
        ("... and ceiling", ceiling, given),
        ("naive, ground found in the scan", naive, unknown),
        ("all defaults, ground given", all.clone(), given),
        ("all defaults, ground found", all, unknown),
    ] {
        let Ok(mut filters) = Filters::new(config) else {
            continue;
        };
        let mut kept = Vec::new();
        let mut times: Vec<f64> = (0..41)
            .map(|_| {
                let start = Instant::now();
                filters.step(points, &frames, &mut kept);
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!(
            "{name:>32} {:8.3} {:8.3}   {} kept",
            times[20],
            times[0],
            kept.len()
        );
    }
}
