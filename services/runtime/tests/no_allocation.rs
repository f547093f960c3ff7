//! Running tasks, passing values and counting takes no memory.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

mod rows;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use hachi_hal::Stamp;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Progress, TaskClock, TaskTable, VirtualClock, WhenFull, bounded};
use rows::{MS, by_input, by_period};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is handed to the system's allocator unchanged; counting touches no memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_million_releases_allocate_nothing() {
    let clock = VirtualClock::starting_at(Stamp::default());
    let mut table = TaskTable::new(TaskClock::new(clock.clone()));
    let bell = table.bell();
    let (sender, receiver) = bounded("boxes", 2, WhenFull::DropOldest, &bell);
    let (back, empty) = bounded("empty boxes", 2, WhenFull::DropNewest, &table.bell());
    let _ = back.send(Box::new([0u8; 4096]));
    let _ = back.send(Box::new([0u8; 4096]));
    let (gauge, spare) = (receiver.gauge(), back.clone());
    let source = move |_| {
        // What can't be sent comes back and is used again.
        if let Some(gone) = empty.receive().and_then(|full| sender.send(full)) {
            let _ = spare.send(gone);
        }
        Progress::Done
    };
    let sink = move |_| {
        if let Some(full) = receiver.receive() {
            let _ = back.send(full);
        }
        Progress::Done
    };
    table.add(
        by_period("source", 1, 50),
        table.bell(),
        vec![],
        Box::new(source),
    );
    table.add(by_input("sink", 1, 40), bell, vec![gauge], Box::new(sink));
    let mut run = VirtualTime::new(table, clock);
    run.run_until(Stamp::from_nanos(10 * MS));
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    run.run_until(Stamp::from_nanos(500_000 * MS));
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
    let runs: u64 = run
        .telemetry()
        .rows()
        .iter()
        .map(|r| r.execution.runs)
        .sum();
    assert_eq!(runs, 1_000_000);
}
