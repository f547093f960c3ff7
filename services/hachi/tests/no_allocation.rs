//! From packet to pose and from pose to command nothing is allocated once everything has been seen
//! at its largest: the whole service in virtual time, task by task.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use hachi::config::{MotionInput, Settings};
use hachi::service::settings::Platform;
use hachi::service::simulator::{MemoryPackets, SimulatorTask, Truth, WalkingBody};
use hachi::service::wiring::{Devices, Running, assemble};
use hachi_bridge::message::Sensor;
use hachi_hal::Stamp;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{Overrun, TaskClock, TaskSpec, Trigger, VirtualClock};
use hachi_slam::{MemoryStore, Slam};
use hachi_unitree::device::{HighClient, MemoryLink, SimulatedRobotConfig, SimulatedService};
use hachi_world::{LiveLidar, Preset, SimulationConfig};

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
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Walks to and fro three times before this, s: what comes afterwards has been seen.
const WARM_S: i64 = 28;
const COUNTED_S: i64 = 4;

const SIMULATOR: TaskSpec = TaskSpec {
    name: "simulator",
    trigger: Trigger::Period {
        period_ns: 1_000_000,
    },
    budget_ns: i64::MAX,
    priority: 99,
    core: None,
    parallel: true,
    overrun: Overrun::Skip,
    hard: false,
    ladder: &[],
};

#[test]
fn the_tasks_of_a_walking_robot_allocate_nothing_once_warm() {
    let platform = Platform::of_name("b1").unwrap();
    let mut settings = Settings::load(Some("b1"), None).unwrap();
    settings.motion = MotionInput::Odometry;
    settings.patrol.places = vec![[0.9, 0.0], [0.0, 0.0]];
    let mut world = SimulationConfig::preset(Preset::Office, 1, f64::MAX);
    world.base_from_lidar = settings.base_from_lidar.pose();
    let clock = VirtualClock::starting_at(world.start);
    let link = MemoryLink::new(clock.clone());
    let packets = MemoryPackets::default();
    let client = HighClient::over(
        platform.robot,
        platform.client(&settings.robot),
        link.clone(),
    );
    let devices = Devices {
        platform,
        client: client.unwrap(),
        packets: packets.clone(),
        sensor: Sensor::Velodyne,
    };
    let slam = Slam::new(settings.slam.clone(), Box::new(MemoryStore::default()));
    let tasks = TaskClock::new(clock.clone());
    // As with threads: without an end, so that no path is kept.
    let running = Running::Threads(1);
    let mut service = assemble(&settings, devices, slam, tasks, running, None).unwrap();
    let robot = platform.robot;
    let body = WalkingBody::standing(&platform, &world);
    let simulator = SimulatorTask {
        robot: SimulatedService::new(&robot.layout, body, SimulatedRobotConfig::for_robot(robot)),
        link,
        lidar: LiveLidar::new(world.clone()),
        packets,
        truth: Truth::default(),
    };
    let table = &mut service.table;
    table.add(SIMULATOR, table.bell(), vec![], Box::new(simulator));

    // Asked after each run: what was allocated since the last one is that task's.
    let counts: Arc<Mutex<BTreeMap<&'static str, u64>>> = Arc::default();
    let kept = Arc::clone(&counts);
    let warm = world.start + WARM_S * 1_000_000_000;
    let mut before = 0;
    let cost = move |spec: &TaskSpec, now: Stamp| {
        let allocated = ALLOCATIONS.load(Ordering::Relaxed);
        if now >= warm {
            *kept.lock().unwrap().entry(spec.name).or_default() += allocated - before;
        }
        before = ALLOCATIONS.load(Ordering::Relaxed);
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
        "legs",
        "supervisor",
        "filter",
        "odometry",
        "behaviour",
    ] {
        assert_eq!(counts.get(task), Some(&0), "{task}: {counts:?}");
    }
}
