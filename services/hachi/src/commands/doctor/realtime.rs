//! Rights that keep the pipeline on time: scheduling classes and limits.

use std::thread;

use super::finding::Finding;
use super::system::{Limit, Resource, limit, may_use_deadline, may_use_fifo};

/// The service locks its memory: buffers and code come to less than this, bytes.
const LOCKED_MEMORY_WANTED: u64 = 256 << 20;
/// Enough for sockets, devices, logs and recordings.
const OPEN_FILES_WANTED: u64 = 1024;

pub(super) fn check() -> Vec<Finding> {
    vec![
        fifo(),
        scheduling("SCHED_DEADLINE", may_use_deadline),
        resource(
            "locked memory",
            Resource::LockedMemory,
            LOCKED_MEMORY_WANTED,
            "set LimitMEMLOCK=infinity in the service's unit, or ulimit -l unlimited",
        ),
        resource(
            "open files",
            Resource::OpenFiles,
            OPEN_FILES_WANTED,
            "set LimitNOFILE=4096 in the service's unit, or ulimit -n 4096",
        ),
    ]
}

/// `SCHED_FIFO` comes by capability or by the limit on priorities.
fn fifo() -> Finding {
    let mut finding = scheduling("SCHED_FIFO", may_use_fifo);
    match limit(Resource::RealtimePriority) {
        Some(Limit::At(0)) | None => {}
        Some(Limit::At(highest)) => finding.what += &format!(" (up to priority {highest})"),
        Some(Limit::Unlimited) => finding.what += " (any priority)",
    }
    finding
}

/// Tries a scheduling class on a thread of its own, so that this one keeps its class whatever
/// happens.
fn scheduling(name: &'static str, attempt: fn() -> Option<bool>) -> Finding {
    match thread::spawn(attempt).join().ok().flatten() {
        Some(true) => Finding::ok(name, "allowed"),
        Some(false) => Finding::warn(
            name,
            "not allowed: scans may be late when the machine is busy",
            "run as a service with AmbientCapabilities=CAP_SYS_NICE, or raise rtprio in \
             /etc/security/limits.conf (live robots only)",
        ),
        None => Finding::ok(name, "this system has none"),
    }
}

fn resource(name: &'static str, which: Resource, wanted: u64, next_step: &str) -> Finding {
    match limit(which) {
        Some(Limit::Unlimited) => Finding::ok(name, "unlimited"),
        Some(Limit::At(value)) if value >= wanted => Finding::ok(name, format!("up to {value}")),
        Some(Limit::At(value)) => Finding::warn(
            name,
            format!("up to {value}, {wanted} wanted"),
            format!("{next_step} (live robots only)"),
        ),
        None => Finding::ok(name, "this system does not say"),
    }
}
