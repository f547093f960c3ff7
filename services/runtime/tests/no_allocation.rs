//! Running tasks, passing values and counting takes no memory.

mod rows;

use std::alloc::System;

use hachi_hal::Stamp;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Progress, TaskClock, TaskTable, VirtualClock, WhenFull, bounded};
use rows::{MS, by_input, by_period};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

fn main() {
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
    let before = allocations();
    run.run_until(Stamp::from_nanos(500_000 * MS));
    assert_eq!(allocations() - before, 0);
    let runs: u64 = run
        .telemetry()
        .rows()
        .iter()
        .map(|r| r.execution.runs)
        .sum();
    assert_eq!(runs, 1_000_000);
}
