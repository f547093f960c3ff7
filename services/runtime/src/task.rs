//! A row of the task table, and what a task does.

use hachi_hal::Stamp;

/// When a task runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Every so many nanoseconds.
    Period {
        /// From one release to the next, ns.
        period_ns: i64,
    },
    /// When its bell is rung.
    Input {
        /// It is not rung more often than this, ns: what its budget is reserved for.
        shortest_ns: i64,
    },
}

impl Trigger {
    /// From one release to the next, at the fastest, ns.
    pub const fn interval_ns(&self) -> i64 {
        match self {
            Self::Period { period_ns } => *period_ns,
            Self::Input { shortest_ns } => *shortest_ns,
        }
    }
}

/// What happens when a run takes longer than the budget. Releases that pass meanwhile are left
/// out in any case: running after them in a burst would help nobody.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Overrun {
    /// It is counted, and that is all.
    Skip,
    /// Three in a row lead one step down the ladder.
    Degrade,
    /// The robot stands still until the budget was kept again for a while.
    Stop,
}

impl Overrun {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Skip => "skip",
            Self::Degrade => "degrade",
            Self::Stop => "stop",
        }
    }
}

/// A row of the task table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskSpec {
    /// Its name.
    pub name: &'static str,
    /// When it runs.
    pub trigger: Trigger,
    /// How long one run may take, ns.
    pub budget_ns: i64,
    /// 1 to 99: of two tasks that could run, the one with more does.
    pub priority: u8,
    /// The core it keeps to.
    pub core: Option<usize>,
    /// Whether it works with helper threads. It then waits for them by yielding, which under
    /// `SCHED_DEADLINE` gives up the rest of the period's budget (`sched_yield(2)`): measured,
    /// 8 ms of odometry took 300. Such a task runs under `SCHED_FIFO`.
    pub parallel: bool,
    /// What happens when a run takes longer.
    pub overrun: Overrun,
    /// Whether an overrun breaks a promise, and its silence means that the program hangs.
    pub hard: bool,
    /// What it leaves out, step by step, when it takes too long.
    pub ladder: &'static [&'static str],
}

/// Whether a task has more to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Until it is released again there is nothing to do.
    Done,
    /// More input waits: it is released again at once.
    More,
}

/// What a task does. It never waits: it takes what is there.
pub trait Work: Send {
    /// One run.
    fn run(&mut self, now: Stamp) -> Progress;

    /// From now on works at this step of its ladder; 0 leaves nothing out.
    fn degrade(&mut self, _level: usize) {}
}

/// A function as a task.
impl<F: FnMut(Stamp) -> Progress + Send> Work for F {
    fn run(&mut self, now: Stamp) -> Progress {
        self(now)
    }
}
