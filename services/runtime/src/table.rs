//! The task table: tasks put together with their queues, ready for an executor.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hachi_hal::Stamp;

use crate::bell::Bell;
use crate::clock::TaskClock;
use crate::health::{Health, Trouble};
use crate::histogram::Histogram;
use crate::ladder::{GOOD_RUNS_UP, Ladder};
use crate::queue::Gauge;
use crate::task::{Overrun, Progress, TaskSpec, Work};
use crate::telemetry::{TaskRecord, Telemetry};

/// A flag for each task, of which any counts. Clones are the same.
#[derive(Debug, Clone, Default)]
struct Flags(Arc<AtomicU64>);

impl Flags {
    /// Sets a task's flag; whether any is set now.
    fn set(&self, task: usize, up: bool) -> bool {
        let bit = 1 << (task % 64);
        match up {
            true => self.0.fetch_or(bit, Ordering::AcqRel) | bit != 0,
            false => self.0.fetch_and(!bit, Ordering::AcqRel) & !bit != 0,
        }
    }
}

/// Whether a task that promised its budget broke it so that the robot must stand still. Clones are
/// the same.
#[derive(Debug, Clone, Default)]
pub struct Halt(Flags);

impl Halt {
    /// Whether the robot must stand still.
    pub fn is_asked_for(&self) -> bool {
        self.0.0.load(Ordering::Acquire) != 0
    }
}

/// Tasks with their rows, in the order in which they were added.
pub struct TaskTable {
    pub(crate) clock: TaskClock,
    pub(crate) tasks: Vec<Task>,
    telemetry: Telemetry,
    health: Health,
    halt: Halt,
    degraded: Flags,
}

impl TaskTable {
    /// No tasks yet.
    pub fn new(clock: TaskClock) -> Self {
        Self {
            clock,
            tasks: Vec::new(),
            telemetry: Telemetry::default(),
            health: Health::default(),
            halt: Halt::default(),
            degraded: Flags::default(),
        }
    }

    /// The clock that all tasks live on.
    pub fn clock(&self) -> &TaskClock {
        &self.clock
    }

    /// The health that tasks report to.
    pub fn health(&self) -> &Health {
        &self.health
    }

    /// Whether a task's overruns hold the robot.
    pub fn halt(&self) -> &Halt {
        &self.halt
    }

    /// A bell for a task that is added later.
    pub fn bell(&self) -> Bell {
        Bell::new(self.clock.clone())
    }

    /// Times from one end to another, under a name.
    pub fn latency(&mut self, name: &'static str) -> Arc<Histogram> {
        self.telemetry.add_latency(name)
    }

    /// Adds a task. `bell` releases it where its row says by input; `queues` are those it empties.
    pub fn add(
        &mut self,
        spec: TaskSpec,
        bell: Bell,
        queues: Vec<Arc<dyn Gauge>>,
        work: Box<dyn Work>,
    ) {
        let record = Arc::new(TaskRecord::default());
        self.telemetry.add(spec, &record, queues);
        self.tasks.push(Task {
            ladder: Ladder::of(spec.ladder.len()),
            good_runs: None,
            index: self.tasks.len(),
            spec,
            bell,
            record,
            work,
            health: self.health.clone(),
            halt: self.halt.clone(),
            degraded: self.degraded.clone(),
        });
    }

    /// Takes the table apart: what runs, and what tells of it.
    pub(crate) fn into_parts(self) -> (TaskClock, Vec<Task>, Arc<Telemetry>) {
        (self.clock, self.tasks, Arc::new(self.telemetry))
    }
}

/// One task with its row and what became of it.
pub(crate) struct Task {
    index: usize,
    pub spec: TaskSpec,
    pub bell: Bell,
    pub record: Arc<TaskRecord>,
    work: Box<dyn Work>,
    ladder: Ladder,
    /// Good runs since the overrun for which the robot is held; `None` while it is not.
    good_runs: Option<u32>,
    health: Health,
    halt: Halt,
    degraded: Flags,
}

impl Task {
    /// One run, released at `released` and begun at `begun`.
    pub fn run(&mut self, released: Stamp, begun: Stamp) -> Progress {
        let late_ns = begun.nanos_since(released);
        self.record.jitter.record_signed_ns(late_ns);
        self.work.run(begun)
    }

    /// Accounts for a run that took so long. `judged_ns` decides whether it took too
    /// long: the same, but in virtual time.
    pub fn account(&mut self, took_ns: i64, judged_ns: i64) {
        let record = &self.record;
        record.execution.record_signed_ns(took_ns);
        let overran = judged_ns > self.spec.budget_ns;
        if overran {
            record.overruns.fetch_add(1, Ordering::Relaxed);
        }
        match self.spec.overrun {
            Overrun::Skip => {}
            Overrun::Degrade => self.degrade(overran),
            Overrun::Stop => self.hold(overran),
        }
    }

    fn degrade(&mut self, overran: bool) {
        let Some(level) = self.ladder.judge(overran) else {
            return;
        };
        self.work.degrade(level);
        self.record.level.store(level, Ordering::Relaxed);
        let any = self.degraded.set(self.index, level > 0);
        self.health.set(Trouble::TaskDegraded, any);
        let (task, steps) = (self.spec.name, &self.spec.ladder[..level]);
        tracing::warn!(
            task,
            level,
            ?steps,
            "the task leaves out what these steps say"
        );
    }

    /// Holds the robot after an overrun until the budget was kept long enough.
    fn hold(&mut self, overran: bool) {
        let good_runs = match (overran, self.good_runs) {
            (true, None) => {
                tracing::error!(task = self.spec.name, "over its budget: the robot is held");
                Some(0)
            }
            (true, Some(_)) => Some(0),
            (false, Some(runs)) if runs + 1 >= GOOD_RUNS_UP => None,
            (false, Some(runs)) => Some(runs + 1),
            (false, None) => return,
        };
        self.good_runs = good_runs;
        self.halt.0.set(self.index, good_runs.is_some());
    }

    /// It ended, and should not have.
    pub fn died(&self) {
        self.health.set(Trouble::TaskDied, true);
        self.halt.0.set(self.index, true);
    }
}
