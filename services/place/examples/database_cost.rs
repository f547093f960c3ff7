//! What a keyframe costs against the number of places known: a table up to 50,000.
//!
//! A robot drives up and down through a city made of blocks, one place every 2 m. For each size of
//! the database: the search for known places seen again from half a metre aside and turned, with
//! the outdoor profile's three views; the mean and the worst insertion since the row before; memory
//! by place. Half of the searches take no longer than the first figure: on a busy machine it says
//! more than the mean. Describing is timed on a cloud of 30,000 points.
//!
//! `cargo run --release -p hachi-place --example database_cost -- [PICTURE.svg]`

#![allow(clippy::print_stdout, reason = "a program's output")]

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use hachi_place::{Database, Describer, DescriberConfig, Descriptor, Kind, Profile};
use plotters::prelude::*;

const SIZES: [usize; 7] = [100, 1_000, 5_000, 10_000, 20_000, 35_000, 50_000];
/// Searches for each row.
const SEARCHES: usize = 200;
const GAP_M: f32 = 2.0;
/// The robot turns round after this many places; the next lane is 25 m away.
const LANE: usize = 1000;
const LANE_GAP_M: f32 = 25.0;
/// Edge of a block of the city.
const BLOCK_M: f32 = 9.0;

fn main() -> Result<(), Box<dyn Error>> {
    describing();
    let mut describer = Describer::new(Profile::OUTDOOR, DescriberConfig::default());
    let mut database = Database::default();
    let mut cloud = Vec::new();
    let mut views = Vec::new();
    let mut one = Descriptor::default();
    let mut matches = Vec::new();
    println!("\nplaces   search ms: half  p99   found   insert ms: mean  worst   file kB/place");
    let mut inserted = Vec::new();
    let mut costs = Vec::new();
    for place in 0..=SIZES[SIZES.len() - 1] {
        if SIZES.contains(&place) {
            let mut searched = Vec::new();
            let mut found = 0;
            for i in 0..SEARCHES {
                let known = i * (place - 1) / (SEARCHES - 1);
                let [x, y, yaw] = pose(known);
                look_around([x + 0.3, y + 0.4, yaw + 0.7], 180, 20, &mut cloud);
                describer.describe_views(&cloud, &mut views);
                let start = Instant::now();
                database.query(&views, |_| true, 5, &mut matches)?;
                searched.push(start.elapsed());
                let near = |id: u64| id.abs_diff(known as u64) <= 2;
                found += usize::from(matches.first().is_some_and(|m| near(m.id)));
            }
            let cost = [0.5, 0.99].map(|share| ms(quantile(&mut searched, share)));
            costs.push((place as f64, cost));
            println!(
                "{place:>6}            {:>6.3} {:>5.3}   {:>3} %              {:>6.4} {:>6.2}   {:>13.2}",
                cost[0],
                cost[1],
                found * 100 / SEARCHES,
                ms(mean(&inserted)),
                ms(inserted.iter().max().copied().unwrap_or_default()),
                database.to_bytes().len() as f64 / 1e3 / place as f64,
            );
            inserted.clear();
        }
        look_around(pose(place), 180, 20, &mut cloud);
        describer.describe(&cloud, &mut one);
        let start = Instant::now();
        database.insert(place as u64, &one)?;
        inserted.push(start.elapsed());
    }
    match std::env::args_os().nth(1) {
        Some(path) => draw(path.as_ref(), &costs),
        None => Ok(()),
    }
}

/// The search's cost over the places known: half of the searches, and 99 of 100, take no longer.
fn draw(path: &Path, costs: &[(f64, [f64; 2])]) -> Result<(), Box<dyn Error>> {
    let most = costs.iter().map(|(_, cost)| cost[1]).fold(0.0, f64::max);
    let root = SVGBackend::new(path, (800, 440)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .set_label_area_size(LabelAreaPosition::Left, 56)
        .set_label_area_size(LabelAreaPosition::Bottom, 48)
        .build_cartesian_2d(0.0..50_000.0, 0.0..1.1 * most)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc("places known").y_desc("search, ms");
    mesh.x_label_formatter(&|x| format!("{x:.0}"));
    mesh.light_line_style(TRANSPARENT).draw()?;
    for (which, colour) in [(1, RGBColor(178, 24, 43)), (0, RGBColor(33, 102, 172))] {
        let line = costs.iter().map(|(places, cost)| (*places, cost[which]));
        chart.draw_series(LineSeries::new(line.clone(), colour.stroke_width(2)))?;
        chart.draw_series(line.map(|at| Circle::new(at, 4, colour.filled())))?;
    }
    root.present()?;
    Ok(())
}

/// Times of the descriptors of one cloud of 30,000 points.
fn describing() {
    let mut cloud = Vec::new();
    look_around(pose(70), 1000, 29, &mut cloud);
    cloud.truncate(30_000);
    println!(
        "describing {} points, ms (median of 51): one view, three views",
        cloud.len()
    );
    for kind in Kind::ALL {
        let mut describer = Describer::new(Profile::OUTDOOR, DescriberConfig::for_kind(kind));
        let (mut one, mut views) = (Descriptor::default(), Vec::new());
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..51 {
            let start = Instant::now();
            describer.describe(&cloud, &mut one);
            times[0].push(start.elapsed());
            let start = Instant::now();
            describer.describe_views(&cloud, &mut views);
            times[1].push(start.elapsed());
        }
        let [one, three] = times.map(|mut t| ms(quantile(&mut t, 0.5)));
        println!("{:<14} {one:>6.3} {three:>6.3}", kind.name());
    }
}

/// Where the robot is: lane after lane, up and down.
fn pose(place: usize) -> [f32; 3] {
    let (lane, along) = (place / LANE, (place % LANE) as f32 * GAP_M);
    let (x, yaw) = match lane % 2 {
        0 => (along, 0.0),
        _ => (LANE as f32 * GAP_M - along, std::f32::consts::PI),
    };
    [x, lane as f32 * LANE_GAP_M, yaw]
}

/// What stands at a block of the city: 0 for nothing, or a height in metres. Decided by the block's
/// coordinates alone (the finaliser of MurmurHash3).
fn height(x: f32, y: f32) -> f32 {
    let [bx, by] = [x, y].map(|c| (c / BLOCK_M).floor() as i32 as u32);
    let mut h = bx.wrapping_mul(0x9E37_79B1) ^ by.wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    h ^= h >> 16;
    match h % 8 {
        0 => 2.0 + (h >> 8) as f32 % 16.0,
        _ => 0.0,
    }
}

/// The cloud from a place, in the robot's frame: what each of the rays meets first, as a column of
/// points, and the ground before it.
fn look_around([x, y, yaw]: [f32; 3], rays: usize, column: usize, cloud: &mut Vec<[f32; 4]>) {
    cloud.clear();
    for ray in 0..rays {
        let angle = ray as f32 / rays as f32 * std::f32::consts::TAU;
        let (sin, cos) = angle.sin_cos();
        let (map_sin, map_cos) = (angle + yaw).sin_cos();
        let hit = (2..160).map(|i| i as f32 * 0.5).find_map(|range| {
            let tall = height(x + range * map_cos, y + range * map_sin);
            (tall > 0.0).then_some((range, tall))
        });
        if let Some((range, tall)) = hit {
            cloud.extend((0..column).map(|i| {
                let z = tall * i as f32 / column as f32;
                [range * cos, range * sin, z, 40.0]
            }));
        }
        let free = hit.map_or(80.0, |(range, _)| range).min(25.0);
        cloud.extend((2..10).map(|i| {
            let range = free * i as f32 / 10.0;
            [range * cos, range * sin, 0.0, 15.0]
        }));
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn mean(times: &[Duration]) -> Duration {
    times.iter().sum::<Duration>() / times.len().max(1) as u32
}

fn quantile(times: &mut [Duration], share: f64) -> Duration {
    times.sort_unstable();
    let at = (times.len() as f64 * share) as usize;
    times.get(at).copied().unwrap_or_default()
}
