//! One thread runs all tasks in virtual time, and always in the same order.
//!
//! In: a table on a [`VirtualClock`]. Out: the tasks' effects, the same bytes every time. Time
//! stands still while a task runs. Of the tasks that are released at one moment the one with the
//! highest priority runs first, and of equals the one that was added first.
//!
//! How long a run really took is recorded, and decides nothing: what counts against the budget, and
//! for how long a task is busy, is what `cost` says. Usually that is nothing; a test of what happens
//! when a task is slow makes it more.

use std::sync::Arc;
use std::time::Instant;

use hachi_hal::{Clock, Stamp};

use crate::clock::VirtualClock;
use crate::table::{Task, TaskTable};
use crate::task::{Progress, TaskSpec, Trigger};
use crate::telemetry::Telemetry;

/// How long runs of a task take in virtual time, ns: the task, the moment.
pub type Cost = Box<dyn FnMut(&TaskSpec, Stamp) -> i64 + Send>;

/// A table that runs in virtual time.
pub struct VirtualTime {
    clock: VirtualClock,
    tasks: Vec<Timed>,
    telemetry: Arc<Telemetry>,
    cost: Option<Cost>,
}

struct Timed {
    task: Task,
    /// Its next release by period; never by input.
    due: Option<Stamp>,
    /// Released again at once: it said that more waits.
    again: Option<Stamp>,
    busy_until: Stamp,
}

impl Timed {
    /// When it can run next, and when it was released, as far as is known now.
    fn next(&self, now: Stamp) -> Option<Stamp> {
        let rung = self.task.bell.is_rung() && self.due.is_none();
        let released = match (self.again, self.due) {
            (Some(again), _) => again,
            (None, Some(due)) => due,
            (None, None) if rung => now,
            (None, None) => return None,
        };
        Some(released.max(self.busy_until))
    }

    /// Takes the release; when it was.
    fn take(&mut self, now: Stamp) -> Stamp {
        if let Some(again) = self.again.take() {
            return again;
        }
        let (Some(due), Trigger::Period { period_ns }) = (self.due, self.task.spec.trigger) else {
            return self.task.bell.hear().unwrap_or(now);
        };
        let period_ns = period_ns.max(1);
        let missed = now.nanos_since(due) / period_ns;
        self.task.record.skip(missed);
        self.due = Some(due + (missed + 1) * period_ns);
        due
    }
}

impl VirtualTime {
    /// Ready to run from the clock's time on. The table must have been made on the same clock.
    pub fn new(table: TaskTable, clock: VirtualClock) -> Self {
        let start = clock.now();
        let (_, tasks, telemetry) = table.into_parts();
        let timed = |task: Task| Timed {
            due: matches!(task.spec.trigger, Trigger::Period { .. }).then_some(start),
            again: None,
            busy_until: start,
            task,
        };
        Self {
            clock,
            tasks: tasks.into_iter().map(timed).collect(),
            telemetry,
            cost: None,
        }
    }

    /// With runs that take time.
    #[must_use]
    pub fn with_cost(mut self, cost: Cost) -> Self {
        self.cost = Some(cost);
        self
    }

    /// What the tasks did.
    pub fn telemetry(&self) -> &Arc<Telemetry> {
        &self.telemetry
    }

    /// Runs what is released before `until`, and leaves the clock there.
    pub fn run_until(&mut self, until: Stamp) {
        while self.step(until) {}
        self.clock.advance_to(until);
    }

    /// Runs the next task; whether there was one before `until`.
    fn step(&mut self, until: Stamp) -> bool {
        let now = self.clock.now();
        let mut chosen: Option<(Stamp, u8, usize)> = None;
        for (index, timed) in self.tasks.iter().enumerate() {
            let Some(at) = timed.next(now) else { continue };
            let at = at.max(now);
            let priority = timed.task.spec.priority;
            let first =
                chosen.is_none_or(|(best, most, _)| at < best || (at == best && priority > most));
            if at < until && first {
                chosen = Some((at, priority, index));
            }
        }
        let Some((at, _, index)) = chosen else {
            return false;
        };
        self.clock.advance_to(at);
        let timed = &mut self.tasks[index];
        let released = timed.take(at);
        let started = Instant::now();
        let progress = timed.task.run(released, at);
        let took_ns = i64::try_from(started.elapsed().as_nanos()).unwrap_or(i64::MAX);
        let cost_ns = match &mut self.cost {
            Some(cost) => cost(&timed.task.spec, at).max(0),
            None => 0,
        };
        timed.busy_until = at + cost_ns;
        timed.task.account(took_ns, cost_ns);
        if progress == Progress::More {
            timed.again = Some(timed.busy_until);
        }
        true
    }
}
