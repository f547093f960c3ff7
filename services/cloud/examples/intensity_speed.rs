//! How many points a second the naive intensity filter labels on one core.
//!
//! `cargo run --release -p hachi-cloud --example intensity_speed`
//!
//! Clouds that fit in cache and clouds that don't, points read in place (32 bytes each) and, for
//! comparison, from arrays of their own (x, y, z, intensity), with and without the time to fill
//! those from the points a driver delivers. Best and median of 15 runs each.
#![allow(clippy::print_stdout, reason = "an example prints its result")]

use std::hint::black_box;
use std::time::Instant;

use hachi_cloud::intensity::label_weak_above_ground;
use hachi_cloud::{Height, Reason, RejectRange};
use hachi_hal::Point;

const MARGIN_M: f32 = 0.05;

#[derive(Default)]
struct Arrays {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    intensity: Vec<f32>,
}

impl Arrays {
    fn fill(&mut self, points: &[Point]) {
        for (array, of) in [
            (&mut self.x, (|p| p.x) as fn(&Point) -> f32),
            (&mut self.y, |p| p.y),
            (&mut self.z, |p| p.z),
            (&mut self.intensity, |p| p.intensity),
        ] {
            array.clear();
            array.extend(points.iter().map(of));
        }
    }

    fn label(&self, reject: RejectRange, height: Height, labels: &mut [Reason]) {
        let coordinates = self.x.iter().zip(&self.y).zip(&self.z);
        for (((x, y), z), (intensity, label)) in coordinates.zip(self.intensity.iter().zip(labels))
        {
            let above = height.of([*x, *y, *z]) >= MARGIN_M;
            let goes = reject.contains(*intensity) & above & label.is_kept();
            *label = if goes { Reason::Suspect } else { *label };
        }
    }
}

/// Points that no branch predictor can learn.
fn cloud(count: usize) -> Vec<Point> {
    let mut state = 1u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    (0..count)
        .map(|_| Point {
            intensity: uniform() * 60.0,
            ..Point::at(
                uniform() * 40.0 - 20.0,
                uniform() * 40.0 - 20.0,
                uniform() * 3.0 - 1.0,
            )
        })
        .collect()
}

/// Best and median of 15 runs, in millions of points a second.
fn speed(points: usize, repeats: usize, mut run: impl FnMut()) -> (f64, f64) {
    let mut rates: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            (0..repeats).for_each(|_| run());
            (points * repeats) as f64 / start.elapsed().as_secs_f64() / 1e6
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    (rates[14], rates[7])
}

fn main() {
    let height = Height {
        up: [0.05, -0.02, 0.998],
        sensor_height_m: 0.6,
    };
    let reject = RejectRange::default();
    println!("millions of points a second, best and median of 15");
    println!(
        "{:>10} {:>20} {:>20} {:>20}",
        "points", "in place", "arrays", "arrays, with filling"
    );
    for count in [30_000, 120_000, 10_000_000] {
        let points = cloud(count);
        let mut labels = vec![Reason::Kept; count];
        let repeats = (3_000_000 / count).max(1);
        let in_place = speed(count, repeats, || {
            labels.fill(Reason::Kept);
            label_weak_above_ground(black_box(&points), reject, height, MARGIN_M, &mut labels);
            black_box(&labels);
        });
        let expected = labels.clone();
        let mut arrays = Arrays::default();
        arrays.fill(&points);
        let ready = speed(count, repeats, || {
            labels.fill(Reason::Kept);
            black_box(&arrays).label(reject, height, &mut labels);
            black_box(&labels);
        });
        let filled = speed(count, repeats, || {
            arrays.fill(black_box(&points));
            labels.fill(Reason::Kept);
            arrays.label(reject, height, &mut labels);
            black_box(&labels);
        });
        assert!(labels == expected, "the layouts disagree");
        let show = |(best, median): (f64, f64)| format!("{best:.0} / {median:.0}");
        println!(
            "{count:>10} {:>20} {:>20} {:>20}",
            show(in_place),
            show(ready),
            show(filled)
        );
    }
}
