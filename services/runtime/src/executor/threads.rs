//! A thread for each task, under real-time scheduling where the process may.
//!
//! In: a table on the computer's clock. Out: the tasks' effects, until somebody asks for a stop. The
//! calling thread supervises: it is woken a few dozen times a second, and stops everything when it
//! says so or when a task ends that should not have.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use hachi_hal::{Clock, Stamp};

use crate::clock::TaskClock;
use crate::realtime::{self, Scheduling};
use crate::table::{Task, TaskTable};
use crate::task::{Progress, Trigger};
use crate::telemetry::Telemetry;

/// A task that waits for input looks this often whether it shall stop.
const LOOK_UP: Duration = Duration::from_millis(100);

/// How the threads are run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ThreadsConfig {
    /// Whether real-time scheduling and locked memory are asked for.
    pub real_time: bool,
    /// How often the supervisor is woken, ns.
    pub supervise_ns: i64,
}

impl Default for ThreadsConfig {
    fn default() -> Self {
        Self {
            real_time: true,
            supervise_ns: 20_000_000,
        }
    }
}

/// Why the threads stopped before anybody asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsError {
    /// The system gives no thread.
    #[error("the thread of task {task} can't be started: {source}")]
    Start {
        /// The task.
        task: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A task panicked.
    #[error("task {task} ended unexpectedly; the log has the reason")]
    Died {
        /// The task.
        task: &'static str,
    },
}

/// What all threads share.
struct Shared {
    stop: AtomicBool,
    dead: AtomicUsize,
    ready: AtomicUsize,
    clock: TaskClock,
    real_time: bool,
}

/// No task is dead.
const NONE: usize = usize::MAX;

/// Runs the tasks until `supervise` answers `false`: it is given the telemetry, in the calling
/// thread.
///
/// # Errors
/// A thread can't be started, or a task panicked; the other tasks were stopped.
pub fn run(
    table: TaskTable,
    config: ThreadsConfig,
    mut supervise: impl FnMut(Stamp, &Arc<Telemetry>) -> bool,
) -> Result<(), ThreadsError> {
    let (clock, tasks, telemetry) = table.into_parts();
    if config.real_time
        && let Err(error) = realtime::lock_memory()
    {
        tracing::info!(%error, "memory is not locked");
    }
    let names: Vec<_> = tasks.iter().map(|t| t.spec.name).collect();
    let bells: Vec<_> = tasks.iter().map(|t| t.bell.clone()).collect();
    let shared = Shared {
        stop: AtomicBool::new(false),
        dead: AtomicUsize::new(NONE),
        ready: AtomicUsize::new(0),
        clock: clock.clone(),
        real_time: config.real_time,
    };
    std::thread::scope(|scope| {
        let mut outcome = Ok(());
        for (index, mut task) in tasks.into_iter().enumerate() {
            let shared = &shared;
            let name = task.spec.name;
            let started = std::thread::Builder::new()
                .name(name.to_owned())
                .spawn_scoped(scope, move || life(&mut task, index, shared));
            if let Err(source) = started {
                outcome = Err(ThreadsError::Start { task: name, source });
                break;
            }
        }
        if outcome.is_ok() {
            outcome = supervised(&names, &shared, config, &telemetry, &mut supervise);
        }
        shared.stop.store(true, Ordering::Release);
        bells.iter().for_each(crate::Bell::wake);
        outcome
    })
}

fn supervised(
    names: &[&'static str],
    shared: &Shared,
    config: ThreadsConfig,
    telemetry: &Arc<Telemetry>,
    supervise: &mut impl FnMut(Stamp, &Arc<Telemetry>) -> bool,
) -> Result<(), ThreadsError> {
    let mut said = false;
    let period = Duration::from_nanos(config.supervise_ns.max(1).unsigned_abs());
    loop {
        if !said && shared.ready.load(Ordering::Acquire) == names.len() {
            say_scheduling(telemetry);
            said = true;
        }
        if let Some(&task) = names.get(shared.dead.load(Ordering::Acquire)) {
            return Err(ThreadsError::Died { task });
        }
        if !supervise(shared.clock.now(), telemetry) {
            return Ok(());
        }
        std::thread::sleep(period);
    }
}

/// Says once which classes the kernel granted.
fn say_scheduling(telemetry: &Telemetry) {
    let rows = telemetry.rows();
    let of = |class: Scheduling| {
        let names = rows.iter().filter(|row| row.scheduling == class.name());
        names
            .map(|row| row.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    tracing::info!(
        deadline = of(Scheduling::Deadline),
        fifo = of(Scheduling::Fifo),
        normal = of(Scheduling::Normal),
        "tasks are scheduled"
    );
}

/// From the first release of a task to the stop.
fn life(task: &mut Task, index: usize, shared: &Shared) {
    task.bell.listen_here();
    let granted = match shared.real_time {
        true => realtime::schedule(&task.spec),
        false => Scheduling::Normal,
    };
    let code = granted as u8;
    task.record.scheduling.store(code, Ordering::Relaxed);
    realtime::touch_stack();
    shared.ready.fetch_add(1, Ordering::AcqRel);
    // What a panicking task leaves half done is not looked at again: everything stops.
    let lived = catch_unwind(AssertUnwindSafe(|| match task.spec.trigger {
        Trigger::Period { period_ns } => by_period(task, period_ns.max(1), shared),
        Trigger::Input { .. } => by_input(task, shared),
    }));
    if lived.is_err() {
        task.died();
        shared.dead.store(index, Ordering::Release);
    }
}

fn by_period(task: &mut Task, period_ns: i64, shared: &Shared) {
    let mut release = shared.clock.now();
    loop {
        let Some(begun) = wait_until(release, shared) else {
            return;
        };
        run_once(task, release, begun);
        release = release + period_ns;
        let missed = shared.clock.now().nanos_since(release) / period_ns;
        if missed > 0 {
            task.record.skip(missed);
            release = release + missed * period_ns;
        }
    }
}

/// Sleeps until `release`; the time then, or `None` if it shall stop.
fn wait_until(release: Stamp, shared: &Shared) -> Option<Stamp> {
    loop {
        if shared.stop.load(Ordering::Acquire) {
            return None;
        }
        let now = shared.clock.now();
        match u64::try_from(release.nanos_since(now)) {
            Ok(left) if left > 0 => std::thread::park_timeout(Duration::from_nanos(left)),
            _ => return Some(now),
        }
    }
}

fn by_input(task: &mut Task, shared: &Shared) {
    while !shared.stop.load(Ordering::Acquire) {
        let Some(mut released) = task.bell.hear() else {
            task.bell.sleep(LOOK_UP);
            continue;
        };
        loop {
            let begun = shared.clock.now();
            let progress = run_once(task, released, begun);
            if progress == Progress::Done || shared.stop.load(Ordering::Acquire) {
                break;
            }
            released = shared.clock.now();
        }
    }
}

fn run_once(task: &mut Task, released: Stamp, begun: Stamp) -> Progress {
    let started = Instant::now();
    let progress = task.run(released, begun);
    let took_ns = i64::try_from(started.elapsed().as_nanos()).unwrap_or(i64::MAX);
    task.account(took_ns, took_ns);
    progress
}
