//! Tasks by threads, in real time.

mod rows;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hachi_hal::{Clock, Stamp};
use hachi_runtime::executor::threads::{ThreadsConfig, ThreadsError, run};
use hachi_runtime::{Progress, TaskClock, TaskTable, Trouble, WhenFull, bounded, prometheus};
use rows::{MS, by_input, by_period};

struct Monotonic(Instant);

impl Clock for Monotonic {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.0.elapsed().as_nanos() as i64)
    }
}

fn table() -> TaskTable {
    TaskTable::new(TaskClock::new(Monotonic(Instant::now())))
}

#[test]
fn values_pass_from_task_to_task_until_the_stop() {
    let mut table = table();
    let bell = table.bell();
    let (sender, receiver) = bounded("stamps", 8, WhenFull::DropOldest, &bell);
    let path = table.latency("source to sink");
    let source = move |now: Stamp| {
        let _ = sender.send(now);
        Progress::Done
    };
    table.add(
        by_period("source", 2, 50),
        table.bell(),
        vec![],
        Box::new(source),
    );
    let received = Arc::new(AtomicU64::new(0));
    let (count, gauge) = (Arc::clone(&received), receiver.gauge());
    let sink = move |now: Stamp| {
        if let Some(sent) = receiver.receive() {
            path.record_signed_ns(now.nanos_since(sent));
            count.fetch_add(1, Ordering::Relaxed);
        }
        match receiver.is_empty() {
            true => Progress::Done,
            false => Progress::More,
        }
    };
    table.add(by_input("sink", 2, 40), bell, vec![gauge], Box::new(sink));
    let health = table.health().clone();
    let mut seen = None;
    run(table, ThreadsConfig::default(), |_, telemetry| {
        seen = Some(Arc::clone(telemetry));
        received.load(Ordering::Relaxed) < 100
    })
    .unwrap();
    let telemetry = seen.unwrap();
    let rows = telemetry.rows();
    assert!(rows[0].execution.runs >= 100, "{rows:?}");
    assert!(rows[1].execution.runs >= 100, "{rows:?}");
    assert!(
        rows.iter().all(|row| row.scheduling != "virtual"),
        "{rows:?}"
    );
    assert!(telemetry.latency_rows()[0].times.runs >= 100);
    // Every metric line is a name, labels and one number.
    let text = prometheus::text(&telemetry, &health);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.rsplit_once(' ').unwrap();
        assert!(name.starts_with("hachi_") && name.ends_with('}'), "{line}");
        assert!(value.parse::<f64>().unwrap().is_finite(), "{line}");
    }
    let runs = format!(
        "hachi_task_execution_seconds_count{{task=\"source\"}} {}",
        rows[0].execution.runs
    );
    assert!(text.contains(&runs), "{text}");
}

/// No burst afterwards: what was missed is left out and counted.
#[test]
fn releases_that_pass_during_a_long_run_are_skipped() {
    let mut table = table();
    let mut runs = 0;
    let work = move |_| {
        runs += 1;
        if runs == 3 {
            std::thread::sleep(Duration::from_millis(50));
        }
        Progress::Done
    };
    table.add(
        by_period("hiccup", 10, 50),
        table.bell(),
        vec![],
        Box::new(work),
    );
    let mut skipped = 0;
    run(table, ThreadsConfig::default(), |_, telemetry| {
        let (_, record) = telemetry.tasks().next().unwrap();
        skipped = record.skipped();
        record.execution.runs() < 8
    })
    .unwrap();
    assert!(skipped >= 4, "{skipped}");
}

#[test]
fn a_task_that_panics_ends_the_run_by_name_and_holds_the_robot() {
    let mut table = table();
    let (health, halt) = (table.health().clone(), table.halt().clone());
    let other = |_| Progress::Done;
    table.add(
        by_period("other", 5, 50),
        table.bell(),
        vec![],
        Box::new(other),
    );
    let broken = |_: Stamp| -> Progress { panic!("as the test wants it") };
    table.add(
        by_period("broken", 5, 40),
        table.bell(),
        vec![],
        Box::new(broken),
    );
    let started = Instant::now();
    let patience = Duration::from_secs(20);
    let outcome = run(table, ThreadsConfig::default(), |_, _| {
        started.elapsed() < patience
    });
    assert!(matches!(
        outcome,
        Err(ThreadsError::Died { task: "broken" })
    ));
    assert!(health.has(Trouble::TaskDied));
    assert!(halt.is_asked_for());
}

/// A task that sleeps without a period wakes up within the time that a stop may take.
#[test]
fn a_stop_reaches_tasks_that_wait_for_input() {
    let mut table = table();
    let idle = |_| Progress::Done;
    table.add(
        by_input("idle", 1_000, 10),
        table.bell(),
        vec![],
        Box::new(idle),
    );
    table.add(
        by_period("rare", 600_000, 10),
        table.bell(),
        vec![],
        Box::new(idle),
    );
    let started = Instant::now();
    run(table, ThreadsConfig::default(), |now, _| {
        now.as_nanos() < 50 * MS
    })
    .unwrap();
    assert!(started.elapsed() < Duration::from_secs(10));
}
