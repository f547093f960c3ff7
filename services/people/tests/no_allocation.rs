//! Once warm, following twenty people and knowing three of them allocates nothing, and takes
//! little time.
#![allow(
    clippy::print_stdout,
    reason = "the time is printed, not judged: the machine is shared"
)]

use std::alloc::System;
use std::time::Instant;

use hachi_people::BoundingBox;
use hachi_people::identify::{AppearanceModel, Condition, Identifier, IdentifierConfig};
use hachi_people::track::{Detection, Features, Frame, Tracker, TrackerConfig};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

const PEOPLE: usize = 20;
const DIMENSION: usize = 512;
/// Frames until the scene has shown all it has: afterwards frames are counted.
const CYCLES: usize = 2000;

/// Twenty people who walk to and fro at their own pace, cross, and are hidden now and then.
fn people_at(frame: usize, detections: &mut Vec<Detection>, features: &mut Vec<f32>) {
    detections.clear();
    features.clear();
    for person in 0..PEOPLE {
        if (frame + 13 * person) % 60 < 4 {
            continue;
        }
        let pace = 0.02 + 0.001 * person as f64;
        let x = 600.0 + 500.0 * (pace * frame as f64 + person as f64).sin();
        detections.push(Detection {
            bounding_box: BoundingBox::new(x, 100.0 + 8.0 * person as f64, 60.0, 150.0),
            score: if (frame + person).is_multiple_of(7) {
                0.3
            } else {
                0.9
            },
        });
        features.extend((0..DIMENSION).map(|k| f32::from(k % PEOPLE == person) / 5.1));
    }
}

fn main() {
    let mut tracker = Tracker::new(TrackerConfig::default());
    let mut identifier = Identifier::new(IdentifierConfig::default());
    let (mut detections, mut features) = (Vec::new(), Vec::new());
    let mut allocated = 0;
    let mut times_ms = Vec::with_capacity(CYCLES);
    for frame in 0..2 * CYCLES {
        people_at(frame, &mut detections, &mut features);
        let features = Features {
            dimension: DIMENSION,
            values: &features,
            same_person_distance: 0.5,
        };
        let before = allocations();
        let begun = Instant::now();
        tracker.step(&Frame {
            dt_s: 1.0 / 30.0,
            detections: &detections,
            features: Some(features),
        });
        if frame == 100 {
            let seen = tracker.tracks().iter().filter(|track| track.is_seen());
            for track in seen.take(3) {
                let feature = features.get(track.detection.unwrap()).unwrap();
                let model = AppearanceModel::first(feature).unwrap();
                identifier.enrol(model, Some(track.id));
            }
        }
        identifier.step(tracker.tracks(), Some(features), Some(1920), 1.0 / 30.0);
        if frame >= CYCLES {
            allocated += allocations() - before;
            times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        }
    }
    times_ms.sort_by(f64::total_cmp);
    println!("median step: {:.3} ms", times_ms[times_ms.len() / 2]);
    assert_eq!(allocated, 0, "allocations");
    let known = identifier
        .statuses()
        .filter(|s| s.condition != Condition::Searching);
    assert_eq!(known.count(), 3);
    let believed = tracker.tracks().iter().filter(|t| t.is_confirmed());
    assert_eq!(believed.count(), PEOPLE);
}
