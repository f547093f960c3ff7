//! The task table as people read it: one line a task.

use std::fmt::Write;

use crate::service::web::Status;

/// To the upper left, and everything below it gone.
pub const CLEAR: &str = "\x1b[H\x1b[J";

/// The table in place of what is on the screen.
pub fn on_screen(status: &Status) -> String {
    format!("{CLEAR}{}", text(status))
}

/// The table with what stands above and below it.
pub fn text(status: &Status) -> String {
    let mut out = String::new();
    // Writing to a String can't fail.
    let _ = writeln!(
        out,
        "{}  {}  localisation {}  map {} nodes, {} loops{}{}",
        status.platform,
        status.health,
        status.localisation,
        status.nodes,
        status.loops,
        match &status.person {
            Some(condition) => format!("  person {condition}"),
            None => String::new(),
        },
        match status.battery_percent {
            Some(percent) => format!("  battery {percent} %"),
            None => String::new(),
        }
    );
    let standing = status.standing.join("; ");
    let _ = writeln!(
        out,
        "{}",
        if standing.is_empty() {
            "going"
        } else {
            &standing
        }
    );
    let _ = writeln!(
        out,
        "{:<14} {:<14} {:>7} {:>8} {:>9} {:>8} {:>8} {:>8} {:>9} {:>5} {:>5} {:>5}  LEAVES OUT",
        "TASK",
        "SCHEDULING",
        "EVERY",
        "BUDGET",
        "RUNS",
        "P50",
        "P99",
        "MAX",
        "JITTER",
        "OVER",
        "SKIP",
        "DROP"
    );
    for task in &status.tasks {
        let times = &task.execution;
        let _ = writeln!(
            out,
            "{:<14} {:<14} {:>7} {:>8} {:>9} {:>8} {:>8} {:>8} {:>9} {:>5} {:>5} {:>5}  {}",
            format!("{}{}", task.name, if task.hard { " *" } else { "" }),
            task.scheduling,
            milliseconds(task.interval_ms),
            milliseconds(task.budget_ms),
            times.runs,
            milliseconds(times.p50_ms),
            milliseconds(times.p99_ms),
            milliseconds(times.max_ms),
            milliseconds(task.jitter.p99_ms),
            task.overruns,
            task.skipped,
            task.dropped,
            task.leaves_out.join(", "),
        );
    }
    for latency in &status.latencies {
        let times = &latency.times;
        let _ = writeln!(
            out,
            "{}: {} p50, {} p99, {} max",
            latency.name,
            milliseconds(times.p50_ms),
            milliseconds(times.p99_ms),
            milliseconds(times.max_ms)
        );
    }
    let _ = write!(
        out,
        "times in ms; * an overrun breaks a promise; JITTER is the 99th percentile"
    );
    out
}

/// Milliseconds with three figures.
fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 1.0 => format!("{ms:.3}"),
        ms if ms < 10.0 => format!("{ms:.2}"),
        ms if ms < 100.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}
