//! What tasks did: counts and times, written by the tasks, read by whoever asks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};

use crate::histogram::{Histogram, Summary};
use crate::queue::Gauge;
use crate::realtime::Scheduling;
use crate::task::{TaskSpec, Trigger};

/// What one task did.
#[derive(Debug, Default)]
pub struct TaskRecord {
    /// How long runs took.
    pub execution: Histogram,
    /// How long after its release each run began.
    pub jitter: Histogram,
    pub(crate) overruns: AtomicU64,
    pub(crate) skipped: AtomicU64,
    pub(crate) level: AtomicUsize,
    pub(crate) scheduling: AtomicU8,
}

impl TaskRecord {
    /// Runs that took longer than the budget.
    pub fn overruns(&self) -> u64 {
        self.overruns.load(Ordering::Relaxed)
    }

    /// Releases that passed while a run was under way.
    pub fn skipped(&self) -> u64 {
        self.skipped.load(Ordering::Relaxed)
    }

    /// The step of its ladder it works at.
    pub fn level(&self) -> usize {
        self.level.load(Ordering::Relaxed)
    }

    /// Counts releases that passed while a run was under way; fewer than none are none.
    pub(crate) fn skip(&self, missed: i64) {
        let missed = u64::try_from(missed).unwrap_or(0);
        self.skipped.fetch_add(missed, Ordering::Relaxed);
    }
}

struct Entry {
    spec: TaskSpec,
    record: Arc<TaskRecord>,
    queues: Vec<Arc<dyn Gauge>>,
}

/// What all tasks did, and how long things took from end to end.
#[derive(Default)]
pub struct Telemetry {
    tasks: Vec<Entry>,
    latencies: Vec<(&'static str, Arc<Histogram>)>,
}

/// A task's row as it is shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskRow {
    /// Its name.
    pub name: String,
    /// `period` or `input`.
    pub trigger: String,
    /// From one release to the next, at the fastest.
    pub interval_ms: f64,
    /// How long a run may take.
    pub budget_ms: f64,
    /// 1 to 99.
    pub priority: u8,
    /// Whether an overrun breaks a promise.
    pub hard: bool,
    /// How the system schedules it.
    pub scheduling: String,
    /// How long runs took.
    pub execution: Summary,
    /// How long after its release each run began.
    pub jitter: Summary,
    /// Runs that took longer than the budget.
    pub overruns: u64,
    /// Releases that passed while a run was under way.
    pub skipped: u64,
    /// The step of its ladder it works at: 0 leaves nothing out.
    pub level: usize,
    /// What it leaves out there.
    pub leaves_out: Vec<String>,
    /// Values that wait in its queues.
    pub queued: usize,
    /// Values that had to go because a queue was full.
    pub dropped: u64,
}

/// A time from one end to the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatencyRow {
    /// From where to where.
    pub name: String,
    /// How long it took.
    pub times: Summary,
}

impl Telemetry {
    pub(crate) fn add(
        &mut self,
        spec: TaskSpec,
        record: &Arc<TaskRecord>,
        queues: Vec<Arc<dyn Gauge>>,
    ) {
        self.tasks.push(Entry {
            spec,
            record: Arc::clone(record),
            queues,
        });
    }

    pub(crate) fn add_latency(&mut self, name: &'static str) -> Arc<Histogram> {
        let histogram = Arc::new(Histogram::new());
        self.latencies.push((name, Arc::clone(&histogram)));
        histogram
    }

    /// Every task with what it did.
    pub fn tasks(&self) -> impl Iterator<Item = (&TaskSpec, &TaskRecord)> {
        self.tasks.iter().map(|t| (&t.spec, &*t.record))
    }

    /// Every queue, with the name of the task that it feeds.
    pub fn queues(&self) -> impl Iterator<Item = (&'static str, &dyn Gauge)> {
        self.tasks
            .iter()
            .flat_map(|task| task.queues.iter().map(|queue| (task.spec.name, &**queue)))
    }

    /// Every time from end to end.
    pub fn latencies(&self) -> impl Iterator<Item = (&'static str, &Histogram)> {
        self.latencies.iter().map(|(name, times)| (*name, &**times))
    }

    /// Overruns of tasks that promised none.
    pub fn hard_overruns(&self) -> u64 {
        let hard = self.tasks().filter(|(spec, _)| spec.hard);
        hard.map(|(_, record)| record.overruns()).sum()
    }

    /// The rows as they are shown. Allocates.
    pub fn rows(&self) -> Vec<TaskRow> {
        self.tasks.iter().map(Entry::row).collect()
    }

    /// Times from end to end as they are shown. Allocates.
    pub fn latency_rows(&self) -> Vec<LatencyRow> {
        let row = |(name, times): (&str, &Histogram)| LatencyRow {
            name: name.to_owned(),
            times: times.summary(),
        };
        self.latencies().map(row).collect()
    }
}

impl Entry {
    fn row(&self) -> TaskRow {
        let Self {
            spec,
            record,
            queues,
        } = self;
        let level = record.level();
        let milliseconds = |nanos: i64| nanos as f64 * 1e-6;
        TaskRow {
            name: spec.name.to_owned(),
            trigger: match spec.trigger {
                Trigger::Period { .. } => "period".to_owned(),
                Trigger::Input { .. } => "input".to_owned(),
            },
            interval_ms: milliseconds(spec.trigger.interval_ns()),
            budget_ms: milliseconds(spec.budget_ns),
            priority: spec.priority,
            hard: spec.hard,
            scheduling: Scheduling::of_code(record.scheduling.load(Ordering::Relaxed))
                .name()
                .to_owned(),
            execution: record.execution.summary(),
            jitter: record.jitter.summary(),
            overruns: record.overruns(),
            skipped: record.skipped(),
            level,
            leaves_out: spec
                .ladder
                .iter()
                .take(level)
                .map(ToString::to_string)
                .collect(),
            queued: queues.iter().map(|q| q.len()).sum(),
            dropped: queues.iter().map(|q| q.dropped()).sum(),
        }
    }
}
