//! The clock that tasks live on: the computer's, or one that an executor moves.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use hachi_hal::{Clock, Stamp};

/// A clock shared by all tasks of a table.
#[derive(Clone)]
pub struct TaskClock(Arc<dyn Clock + Send + Sync>);

impl TaskClock {
    /// Tasks that live on this clock.
    pub fn new(clock: impl Clock + Send + Sync + 'static) -> Self {
        Self(Arc::new(clock))
    }
}

impl Clock for TaskClock {
    fn now(&self) -> Stamp {
        self.0.now()
    }
}

impl fmt::Debug for TaskClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TaskClock({})", self.now())
    }
}

/// A clock that stands still until it is moved. Clones show the same time.
#[derive(Debug, Clone)]
pub struct VirtualClock(Arc<AtomicI64>);

impl VirtualClock {
    /// A clock that shows `start`.
    pub fn starting_at(start: Stamp) -> Self {
        Self(Arc::new(AtomicI64::new(start.as_nanos())))
    }

    /// Moves it on to `to`; it never goes back.
    pub fn advance_to(&self, to: Stamp) {
        self.0.fetch_max(to.as_nanos(), Ordering::Relaxed);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.0.load(Ordering::Relaxed))
    }
}
