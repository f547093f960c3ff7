//! Threads that help a task with its parallel work.
//!
//! A task that computes on several cores brings its own helpers, scheduled as it is: with helpers
//! shared between tasks an urgent one would wait for those that a slow one keeps busy.

use hachi_runtime::realtime;
use tracing::warn;

/// A task's helpers.
#[derive(Debug, Default)]
pub struct Crew {
    wanted: Option<(usize, u8)>,
    pool: Option<rayon::ThreadPool>,
}

impl Crew {
    /// Whatever pool the calling thread is in: a single thread runs all tasks.
    pub fn ambient() -> Self {
        Self::default()
    }

    /// `threads` in all, the task's own among them; the others run at `priority` where they may.
    pub fn own(threads: usize, priority: u8) -> Self {
        Self {
            wanted: Some((threads, priority)),
            pool: None,
        }
    }

    /// Called by the task's thread before its work; does something the first time.
    pub fn assemble(&mut self) {
        let Some((threads, priority)) = self.wanted.take() else {
            return;
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .use_current_thread()
            .start_handler(move |index| {
                // Number 0 is the task's own thread, which is scheduled already.
                if index > 0 {
                    // Without the right to it the task has none either, which was said.
                    let _ = realtime::fifo(priority);
                    realtime::touch_stack();
                }
            })
            .build();
        match pool {
            Ok(pool) => self.pool = Some(pool),
            Err(error) => warn!(%error, "the task works alone"),
        }
    }
}
