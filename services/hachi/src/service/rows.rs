//! The table's numbers: when each task runs, for how long it may, who goes first.
//!
//! Budgets are several times what a run takes on two cores at 2 GHz (`BENCHMARKS.md`), so that an
//! overrun means something; periods follow from the sensors. What lies nearer to the motors goes
//! first. The budgets of the hard tasks come to less than what `SCHED_DEADLINE` gives away of two
//! cores, 1.9.

use hachi_runtime::{Overrun, TaskSpec, Trigger};

use super::{detection, filter, slam};

const MS: i64 = 1_000_000;

/// From one scan to the next: ten turns a second.
const SCAN: Trigger = Trigger::Input {
    shortest_ns: 100 * MS,
};

/// From one picture to the next: thirty a second.
const PICTURE: Trigger = Trigger::Input {
    shortest_ns: 33 * MS,
};

const fn every(period_ms: i64) -> Trigger {
    Trigger::Period {
        period_ns: period_ms * MS,
    }
}

const fn row(name: &'static str, trigger: Trigger, budget_us: i64, priority: u8) -> TaskSpec {
    TaskSpec {
        name,
        trigger,
        budget_ns: budget_us * 1_000,
        priority,
        core: None,
        parallel: false,
        overrun: Overrun::Skip,
        hard: false,
        ladder: &[],
    }
}

const fn hard(spec: TaskSpec, overrun: Overrun) -> TaskSpec {
    TaskSpec {
        hard: true,
        overrun,
        ..spec
    }
}

const fn parallel(spec: TaskSpec) -> TaskSpec {
    TaskSpec {
        parallel: true,
        ..spec
    }
}

const fn with_ladder(spec: TaskSpec, ladder: &'static [&'static str]) -> TaskSpec {
    TaskSpec { ladder, ..spec }
}

/// The command that reaches the robot. A robot that hears nothing for 10 ms stumbles.
pub const BASE_COMMAND: TaskSpec = hard(row("base command", every(5), 2_000, 90), Overrun::Stop);

/// A stop's node on a bus.
pub const EMERGENCY_STOP: TaskSpec = hard(row("emergency stop", every(5), 500, 85), Overrun::Skip);

/// Packets to scans.
pub const LIDAR_RECEIVE: TaskSpec = hard(row("lidar receive", every(4), 1_500, 80), Overrun::Skip);

/// A chip on a bus at its usual rate ([`super::imu::spec`]): twice in a measurement's time, so that
/// stamps are true.
pub const IMU: TaskSpec = row(
    "imu",
    Trigger::Period {
        period_ns: 2_500_000,
    },
    1_000,
    75,
);

/// States of the robot come every 2 ms.
pub const LEGS: TaskSpec = hard(
    row(
        "legs",
        Trigger::Input {
            shortest_ns: 2 * MS,
        },
        500,
        70,
    ),
    Overrun::Skip,
);

/// What is stale, what is wrong: the event loop.
pub const SUPERVISOR: TaskSpec = row("supervisor", every(50), 1_000, 60);

/// Obstacles and filters.
pub const FILTER: TaskSpec = with_ladder(
    parallel(hard(row("filter", SCAN, 25_000, 50), Overrun::Degrade)),
    filter::LADDER,
);

/// Where a scan was.
pub const ODOMETRY: TaskSpec = parallel(hard(row("odometry", SCAN, 45_000, 45), Overrun::Skip));

/// Pictures wait in the camera's own buffers: four, a tenth of a second.
pub const CAMERA_RECEIVE: TaskSpec = row("camera receive", every(10), 5_000, 43);

/// Wishes.
pub const BEHAVIOUR: TaskSpec = row("behaviour", every(50), 1_000, 40);

/// Who is where.
pub const TRACKING: TaskSpec = row("tracking", PICTURE, 2_000, 38);

/// Nodes, loops, the map.
pub const SLAM: TaskSpec = with_ladder(
    TaskSpec {
        overrun: Overrun::Degrade,
        ..parallel(row("slam", SCAN, 90_000, 20))
    },
    slam::LADDER,
);

/// Who is in a picture: the networks of the program on one core, with time left for everything that
/// goes first.
pub const DETECTION: TaskSpec = with_ladder(
    TaskSpec {
        overrun: Overrun::Degrade,
        ..row("detection", PICTURE, 30_000, 15)
    },
    detection::LADDER,
);

/// What sensors sent, to a file.
pub const RECORDER: TaskSpec = row("recorder", every(50), 20_000, 10);

/// What is learnt of people, to the store: it waits for the disk.
pub const KEEPER: TaskSpec = row("keeper", every(1_000), 300_000, 5);

/// The tasks of a service, in the order of the table.
pub const ALL: [TaskSpec; 15] = [
    BASE_COMMAND,
    EMERGENCY_STOP,
    LIDAR_RECEIVE,
    IMU,
    LEGS,
    SUPERVISOR,
    FILTER,
    ODOMETRY,
    CAMERA_RECEIVE,
    BEHAVIOUR,
    TRACKING,
    SLAM,
    DETECTION,
    RECORDER,
    KEEPER,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_can_set_the_hard_tasks_budgets_aside_on_two_cores() {
        let share = |spec: &TaskSpec| spec.budget_ns as f64 / spec.trigger.interval_ns() as f64;
        let hard: f64 = ALL.iter().filter(|spec| spec.hard).map(share).sum();
        assert!(hard < 1.9, "{hard}");
        assert!(ALL.iter().all(|spec| share(spec) < 1.0));
    }

    #[test]
    fn what_lies_nearer_to_the_motors_goes_first() {
        assert!(
            ALL.iter()
                .skip(1)
                .all(|spec| spec.priority < BASE_COMMAND.priority)
        );
        assert!(ALL.is_sorted_by(|a, b| a.priority > b.priority));
    }
}
