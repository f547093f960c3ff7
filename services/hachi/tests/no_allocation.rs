//! From packet to pose and from pose to command nothing is allocated once everything has been seen
//! at its largest: the whole service in virtual time, task by task.

use std::alloc::System;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use hachi::config::{MotionInput, Settings};
use hachi::service::imu::ImuDevice;
use hachi::service::settings::Platform;
use hachi::service::simulated::{Besides, connect};
use hachi::service::wiring::Running;
use hachi_hal::{Rotation, Stamp};
use hachi_imu::simulated::SimulatedChip;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{TaskSpec, VirtualClock};
use hachi_slam::{MemoryStore, Slam};
use hachi_world::{Preset, SimulationConfig};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

/// Walks to and fro three times before this, s: what comes afterwards has been seen.
const WARM_S: i64 = 28;
const COUNTED_S: i64 = 4;

fn main() {
    let platform = Platform::of_name("b1").unwrap();
    let mut settings = Settings::load(Some("b1"), None).unwrap();
    settings.motion = MotionInput::Odometry;
    settings.patrol.places = vec![[0.9, 0.0], [0.0, 0.0]];
    let mut world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
    world.base_from_lidar = settings.base_from_lidar.pose();
    let clock = VirtualClock::starting_at(world.start);
    let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
    // As with threads: without an end, so that no path is kept.
    let running = Running::Threads(1);
    let chip = SimulatedChip::new(clock.clone());
    let imu = ImuDevice {
        open: Box::new(move || Ok(Box::new(chip.clone()))),
        measuring: settings.imu.measuring(),
        base_from_imu: Rotation::identity(),
    };
    let (service, _) = connect(
        &settings,
        &platform,
        &world,
        &clock,
        running,
        (slam, None),
        Besides {
            imu: Some(imu),
            ..Besides::default()
        },
    )
    .unwrap();

    // Asked after each run: what was allocated since the last one is that task's.
    let counts: Arc<Mutex<BTreeMap<&'static str, usize>>> = Arc::default();
    let kept = Arc::clone(&counts);
    let warm = world.start + WARM_S * 1_000_000_000;
    let mut before = 0;
    let cost = move |spec: &TaskSpec, now: Stamp| {
        let allocated = allocations();
        if now >= warm {
            *kept.lock().unwrap().entry(spec.name).or_default() += allocated - before;
        }
        before = allocations();
        0
    };
    let mut run = VirtualTime::new(service.table, clock).with_cost(Box::new(cost));
    run.run_until(warm + COUNTED_S * 1_000_000_000);
    let rows = run.telemetry().rows();
    let scans = rows.iter().find(|row| row.name == "odometry").unwrap();
    assert!(scans.execution.runs > 200, "{scans:?}");
    let counts = counts.lock().unwrap();
    // The simulator is no part of the service; nodes of the map are what SLAM is there for.
    for task in [
        "base command",
        "lidar receive",
        "imu",
        "legs",
        "supervisor",
        "filter",
        "odometry",
        "behaviour",
    ] {
        assert_eq!(counts.get(task), Some(&0), "{task}: {counts:?}");
    }
}
