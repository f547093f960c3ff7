//! Once warm, the filters allocate nothing.

mod scene;

use std::alloc::System;

use hachi_cloud::{FilterConfig, Filters, IntensityMode, ScanFrames};
use scene::{Finish, Scene, standing};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

fn main() {
    let mut scene = Scene::default();
    scene
        .slab([-10.0, -1.2], [10.0, 1.2], 0.0, Finish::Solid(4.0))
        .wall([-10.0, -1.2], [10.0, -1.2], 0.0, 2.7, Finish::Solid(60.0))
        .wall([10.0, -1.2], [10.0, 1.2], 0.0, 2.7, Finish::Solid(60.0))
        .wall(
            [-10.0, 1.2],
            [10.0, 1.2],
            0.0,
            2.7,
            Finish::Glass {
                dust: 0.05,
                clear: false,
            },
        )
        .slab([-10.0, -1.2], [10.0, 1.2], 2.7, Finish::Solid(60.0));
    let first = scene.scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let second = scene.scan(standing(0.55, 2.0, -3.0), 16, 1700);
    for intensity in [
        IntensityMode::None,
        IntensityMode::Intensity,
        IntensityMode::Naive,
        IntensityMode::Normal,
    ] {
        for adaptive_reject in [false, true] {
            let mut filters = Filters::new(FilterConfig {
                intensity,
                adaptive_reject,
                ceiling: true,
                ..FilterConfig::default()
            })
            .expect("a config that works");
            let mut kept = Vec::with_capacity(first.points.len());
            let frames = ScanFrames::default();
            filters.step(&first.points, &frames, &mut kept);
            filters.step(&second.points, &frames, &mut kept);
            let before = allocations();
            filters.step(&second.points, &frames, &mut kept);
            filters.step(&first.points, &frames, &mut kept);
            let allocations = allocations() - before;
            assert_eq!(allocations, 0, "{intensity:?}, adaptive {adaptive_reject}");
        }
    }
}
