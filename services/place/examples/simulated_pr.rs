//! Precision and recall in simulated buildings and on a campus, with a sensor that gets worse.
//!
//! Four descriptors side by side as they come (Scan Context++ as published), and Gaussian Scan
//! Context with the thesis's own formula and comparison. Radius 5 m, the last 50 keyframes left
//! out.
//!
//! `cargo run --release -p hachi-place --example simulated_pr [PRESET...] [--seed N]`

#![allow(clippy::print_stdout, reason = "a program's output")]

#[path = "support/keyframes.rs"]
mod keyframes;

use std::error::Error;

use hachi_place::precision_recall::{Curve, Detection, Outcome, distance_m, may_match, revisits};
use hachi_place::{
    Comparison, Database, DatabaseConfig, Describer, DescriberConfig, Formula, Kind, Profile,
    RingKey,
};
use hachi_world::Preset;
use keyframes::{Keyframe, LEVELS, walk};

const RADIUS_M: f64 = 5.0;
const EXCLUDE: usize = 50;

/// A way to recognise places.
struct Method {
    name: &'static str,
    describer: DescriberConfig,
    database: DatabaseConfig,
}

fn methods() -> Vec<Method> {
    let as_it_comes = |name, kind| Method {
        name,
        describer: DescriberConfig::for_kind(kind),
        database: DatabaseConfig::for_kind(kind),
    };
    let huber = as_it_comes("gsc-huber", Kind::GscHuber);
    let printed = Method {
        name: "gsc-huber, thesis's formula",
        describer: DescriberConfig {
            formula: Formula::Variance,
            min_points: 1,
            min_share: 0.0,
            ..huber.describer
        },
        database: DatabaseConfig {
            comparison: Comparison::Frobenius,
            ring_key: RingKey::Occupancy,
            ..huber.database
        },
    };
    let improved = Method {
        name: "sc, five points, centred",
        describer: DescriberConfig {
            kind: Kind::ScanContext,
            ..huber.describer
        },
        database: huber.database,
    };
    vec![
        as_it_comes("sc++", Kind::ScanContext),
        as_it_comes("gsc-height", Kind::GscHeight),
        huber,
        as_it_comes("gsc-intensity", Kind::GscIntensity),
        printed,
        improved,
    ]
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut presets = Vec::new();
    let mut seed = 1;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--seed" {
            seed = arguments.next().ok_or("--seed needs a number")?.parse()?;
        } else {
            let preset = Preset::from_name(&argument);
            presets.push(preset.ok_or_else(|| format!("{argument} is no preset"))?);
        }
    }
    if presets.is_empty() {
        presets = vec![Preset::GlassCorridor, Preset::Building, Preset::Campus];
    }
    for preset in presets {
        for level in LEVELS {
            let keyframes = walk(preset, seed, level);
            let clouds = || keyframes.iter().map(|k| k.points.as_slice());
            let profile = Profile::for_clouds(clouds().take(10));
            println!(
                "\n{} seed {seed}, {} (range noise {} m, {} % outliers): {} keyframes of {} points, \
                 grid to {} m",
                preset.name(),
                level.name,
                level.range_sigma_m,
                level.outliers * 100.0,
                keyframes.len(),
                clouds().map(<[_]>::len).sum::<usize>() / keyframes.len().max(1),
                profile.max_range_m(),
            );
            for method in methods() {
                let curve = recognise(&keyframes, profile, &method)?;
                println!(
                    "{:<28} revisits {:>4}  area {:.3}  recall at full precision {:>5.1} %",
                    method.name,
                    curve.revisits(),
                    curve.area(),
                    curve.at_full_precision().map_or(0.0, |p| p.recall()) * 100.0,
                );
            }
        }
    }
    Ok(())
}

fn recognise(
    keyframes: &[Keyframe],
    profile: Profile,
    method: &Method,
) -> Result<Curve, Box<dyn Error>> {
    let positions: Vec<[f64; 3]> = keyframes.iter().map(|k| k.position).collect();
    let known = revisits(&positions, EXCLUDE, RADIUS_M);
    let mut describer = Describer::new(profile, method.describer);
    let mut config = method.database;
    config.search.min_similarity = f32::MIN;
    let mut database = Database::new(config);
    let (mut views, mut matches, mut outcomes) = (Vec::new(), Vec::new(), Vec::new());
    for (n, keyframe) in keyframes.iter().enumerate() {
        describer.describe_views(&keyframe.points, &mut views);
        let accept = |earlier: u64| may_match(n, earlier as usize, EXCLUDE);
        database.query(&views, accept, 1, &mut matches)?;
        database.insert(n as u64, &views[0])?;
        outcomes.push(Outcome {
            detection: matches.first().map(|found| Detection {
                similarity: found.similarity.into(),
                distance_m: distance_m(&positions[n], &positions[found.id as usize]),
            }),
            is_revisit: known[n],
        });
    }
    Ok(Curve::new(&outcomes, RADIUS_M))
}
