//! Once a camera streams, frames cost no allocation: from the kernel's buffers to aligned depth.

mod camera;

use std::alloc::System;

use camera::{Act, Camera, PIXELS, Plugged, frame_bytes, metadata_bytes};
use hachi_hal::{RgbdCamera, RgbdImages, Stamp};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::device::{Part, Stream};
use hachi_realsense::{RealSense, RealSenseConfig};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

/// Pairs with everything that can happen to them: late colour, missing pictures, missing metadata.
fn acts() -> Vec<Act> {
    let mut acts = Vec::new();
    for n in 0..40_u32 {
        let us = 1_000_000 + n * 33_333;
        for stream in Stream::BOTH {
            let act = |part, bytes| Act::Buffer {
                stream,
                part,
                sequence: n,
                received: i64::from(us) * 1_000,
                damaged: n % 11 == 7,
                bytes,
            };
            if (n, stream) != (9, Stream::Color) && (n, stream) != (23, Stream::Depth) {
                acts.push(act(Part::Picture, frame_bytes(stream, n)));
            }
            if n % 8 != 5 {
                acts.push(act(Part::Metadata, metadata_bytes(stream, n, us)));
            }
        }
    }
    acts.push(Act::Unplug);
    acts
}

fn main() {
    let simulated = Camera::new(acts());
    let log = simulated.log();
    let plugged = Plugged::once(simulated);
    let mut camera = RealSense::new(plugged, RealSenseConfig::default());
    let (mut depth, mut color) = (vec![0; PIXELS], vec![0; 3 * PIXELS]);
    let mut aligned = vec![0; PIXELS];
    let (mut before, mut after) = (0, 0);
    let mut frames = 0;
    loop {
        let images = RgbdImages {
            depth: &mut depth,
            color: &mut color,
        };
        match camera.read_frame(images, Stamp::from_nanos(i64::MAX)) {
            Ok(header) => assert!(header.is_some()),
            // Pulled out: that is the end, and an error may allocate.
            Err(_) => break,
        }
        let geometry = *camera.geometry().unwrap();
        depth_to_color(&geometry, &depth, &mut aligned).unwrap();
        frames += 1;
        after = allocations();
        if frames == 1 {
            before = after;
        }
    }
    assert_eq!(after - before, 0);
    assert!(frames > 25, "{frames}");
    assert_eq!(log.borrow().last().map(String::as_str), Some("start"));
}
