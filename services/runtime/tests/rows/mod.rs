//! Rows of task tables for tests.
#![allow(dead_code, reason = "each test file uses its own part of this")]

use hachi_runtime::{Overrun, TaskSpec, Trigger};

pub const MS: i64 = 1_000_000;

/// A row with a budget of half its period.
pub fn by_period(name: &'static str, period_ms: i64, priority: u8) -> TaskSpec {
    TaskSpec {
        name,
        trigger: Trigger::Period {
            period_ns: period_ms * MS,
        },
        budget_ns: period_ms * MS / 2,
        priority,
        core: None,
        parallel: false,
        overrun: Overrun::Skip,
        hard: true,
        ladder: &[],
    }
}

/// The same, released by input.
pub fn by_input(name: &'static str, shortest_ms: i64, priority: u8) -> TaskSpec {
    TaskSpec {
        trigger: Trigger::Input {
            shortest_ns: shortest_ms * MS,
        },
        ..by_period(name, shortest_ms, priority)
    }
}
