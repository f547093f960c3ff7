//! Once warm, the filters allocate nothing.
#![allow(
    unsafe_code,
    reason = "a global allocator that counts can't be written without"
)]

mod scene;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use hachi_cloud::{FilterConfig, Filters, IntensityMode, ScanFrames};
use scene::{Finish, Scene, standing};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged; the counter is atomic.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// One test alone in its file: another thread's allocations would count.
#[test]
fn warm_filters_allocate_nothing_in_any_mode() {
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
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            filters.step(&second.points, &frames, &mut kept);
            filters.step(&first.points, &frames, &mut kept);
            let allocations = ALLOCATIONS.load(Ordering::Relaxed) - before;
            assert_eq!(allocations, 0, "{intensity:?}, adaptive {adaptive_reject}");
        }
    }
}
