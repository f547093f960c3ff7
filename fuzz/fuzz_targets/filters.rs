//! Arbitrary points through every filter: no panic, one label for each point, and the labels and
//! the kept points agree.
//!
//! The first four bytes choose switches, how often the points are repeated and how far each
//! repetition is moved; the next 24 a transform; the rest are points of 16 bytes.
#![no_main]

use hachi_cloud::{BodyBox, FilterConfig, Filters, IntensityMode, Reason, RejectRange, ScanFrames};
use hachi_hal::{Point, Pose, Vector3};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((head, rest)) = data.split_at_checked(28) else {
        return;
    };
    let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let switches = head[0];
    let pose = Pose::new(
        Vector3::from_fn(|i, _| f64::from(number(&head[4 + 4 * i..]))),
        Vector3::from_fn(|i, _| f64::from(number(&head[16 + 4 * i..]))),
    );
    let frames = ScanFrames {
        base_from_lidar: pose,
        footprint_from_lidar: (switches & 1 != 0).then_some(pose),
    };
    let config = FilterConfig {
        body: vec![BodyBox {
            min_m: [-1.0; 3],
            max_m: [0.5; 3],
        }],
        intensity: match switches >> 1 & 3 {
            0 => IntensityMode::None,
            1 => IntensityMode::Intensity,
            2 => IntensityMode::Naive,
            _ => IntensityMode::Normal,
        },
        reject: RejectRange {
            low: 0.0,
            high: f32::from(head[3]),
        },
        adaptive_reject: switches & 8 != 0,
        outliers: switches & 16 != 0,
        ghosts: switches & 32 != 0,
        ceiling: switches & 64 != 0,
        ..FilterConfig::default()
    };
    let read: Vec<Point> = rest
        .chunks_exact(16)
        .take(192)
        .map(|bytes| Point {
            intensity: number(&bytes[12..]),
            ..Point::at(number(bytes), number(&bytes[4..]), number(&bytes[8..]))
        })
        .collect();
    let step = f32::from(head[2] as i8) * 0.01;
    let points: Vec<Point> = (0..=head[1] % 8)
        .flat_map(|time| {
            let moved = f32::from(time) * step;
            read.iter().map(move |p| Point {
                x: p.x + moved,
                y: p.y - moved * 0.5,
                ..*p
            })
        })
        .collect();

    let mut filters = Filters::new(config).expect("a config that works");
    let mut kept = Vec::new();
    // Twice: the second scan meets what the first left behind.
    for _ in 0..2 {
        let done = filters.step(&points, &frames, &mut kept);
        let labels = filters.labels();
        assert_eq!(labels.len(), points.len());
        assert_eq!(done.counts.kept() as usize, kept.len());
        assert_eq!(
            done.counts.kept() + done.counts.removed(),
            points.len() as u64
        );
        for (point, label) in points.iter().zip(labels) {
            assert_eq!(!point.is_finite(), *label == Reason::NonFinite);
        }
        assert!(
            kept.iter()
                .all(|point| point.range_m.is_finite() || point.is_finite())
        );
    }
});
