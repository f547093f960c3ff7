//! The computer: cores, vector instructions, memory, kernel, clocks.

use std::fs;
use std::thread;
use std::time::Instant;

use super::finding::Finding;

/// Mapping a VLP-16 in real time has been measured on two cores.
const CORES_NEEDED: usize = 2;
/// A map of a building and the working buffers fit in this, MiB.
const MEMORY_NEEDED_MB: u64 = 1024;

pub(super) fn check() -> Vec<Finding> {
    vec![cores(), vector_instructions(), memory(), kernel(), clock()]
}

fn cores() -> Finding {
    const NAME: &str = "cores";
    let model = field_of("/proc/cpuinfo", "model name").unwrap_or_default();
    match thread::available_parallelism().map(usize::from) {
        Ok(cores) if cores >= CORES_NEEDED => {
            Finding::ok(NAME, format!("{cores} {model}").trim_end())
        }
        Ok(cores) => Finding::warn(
            NAME,
            format!("{cores} {model}").trim_end(),
            "a live LiDAR needs two cores: give this process more",
        ),
        Err(error) => Finding::warn(NAME, format!("unknown: {error}"), "use --threads"),
    }
}

fn vector_instructions() -> Finding {
    const NAME: &str = "vector instructions";
    Finding::ok(NAME, instructions())
}

#[cfg(target_arch = "x86_64")]
fn instructions() -> String {
    let all = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    let present = all.iter().filter(|(_, here)| *here).map(|(name, _)| *name);
    format!("x86-64: sse2 {}", present.collect::<Vec<_>>().join(" "))
}

#[cfg(target_arch = "aarch64")]
fn instructions() -> String {
    "aarch64: neon".to_owned()
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn instructions() -> String {
    format!("{}: none used", std::env::consts::ARCH)
}

fn memory() -> Finding {
    const NAME: &str = "memory";
    let megabytes = |key| {
        let text = field_of("/proc/meminfo", key)?;
        let kilobytes: u64 = text.split_whitespace().next()?.parse().ok()?;
        Some(kilobytes / 1024)
    };
    match (megabytes("MemTotal"), megabytes("MemAvailable")) {
        (Some(total), Some(free)) if free >= MEMORY_NEEDED_MB => {
            Finding::ok(NAME, format!("{free} of {total} MiB available"))
        }
        (Some(total), Some(free)) => Finding::warn(
            NAME,
            format!("{free} of {total} MiB available"),
            "end other programs: a large map takes about 1 GiB",
        ),
        _ => Finding::ok(NAME, "this system does not say"),
    }
}

fn kernel() -> Finding {
    const NAME: &str = "kernel";
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let realtime = fs::read_to_string("/sys/kernel/realtime").is_ok_and(|t| t.trim() == "1");
    let kind = if realtime { ", real-time" } else { "" };
    let system = std::env::consts::OS;
    let what = format!("{system} {}{kind}", release.trim());
    if cfg!(target_os = "linux") {
        Finding::ok(NAME, what)
    } else {
        Finding::warn(
            NAME,
            what.trim_end(),
            "run live robots on Linux; recordings are fine here",
        )
    }
}

/// The kernel's clock source, and the finest step the monotonic clock is seen to make.
fn clock() -> Finding {
    const NAME: &str = "clock";
    const SOURCES: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    /// A step of the clock above this, µs, is seen in the times of points: one firing of a VLP-16
    /// takes 2.3 µs.
    const COARSEST_US: f64 = 50.0;
    let step_us = finest_step_us();
    let source = fs::read_to_string(SOURCES).map_or_else(
        |_| "unknown source".to_owned(),
        |text| format!("source {}", text.trim()),
    );
    let what = format!("{source}, step {step_us:.2} us");
    let slow = ["jiffies", "refined-jiffies", "acpi_pm"];
    if step_us <= COARSEST_US && !slow.iter().any(|name| source.ends_with(name)) {
        Finding::ok(NAME, what)
    } else {
        Finding::warn(
            NAME,
            what,
            "choose a finer clock source: echo tsc (or arch_sys_counter) into current_clocksource",
        )
    }
}

fn finest_step_us() -> f64 {
    let mut finest = f64::INFINITY;
    for _ in 0..100 {
        let before = Instant::now();
        // A clock that never moves would spin for ever.
        for _ in 0..100_000 {
            let step = before.elapsed();
            if !step.is_zero() {
                finest = finest.min(step.as_secs_f64() * 1e6);
                break;
            }
        }
    }
    finest
}

/// The text after `key` and a colon in a file of such lines.
fn field_of(path: &str, key: &str) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim_start().strip_prefix(':')?.trim().to_owned())
}
