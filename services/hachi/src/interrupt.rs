//! Ctrl-C: a flag that long work looks at between scans.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::exit::Failure;

/// Whether the user wants the work to stop. Clones share one flag.
#[derive(Debug, Clone, Default)]
pub struct Cancelled(Arc<AtomicBool>);

impl Cancelled {
    /// A flag that Ctrl-C, SIGTERM and a closed terminal raise. The second time they end the
    /// program at once, for work that does not look.
    ///
    /// Only commands that look at the flag call this; in others Ctrl-C ends the program as usual.
    ///
    /// # Errors
    /// The system refused the handler.
    pub fn on_interrupt() -> Result<Self, Failure> {
        let flag = Self::default();
        let raised = flag.clone();
        ctrlc::set_handler(move || {
            if raised.0.swap(true, Ordering::Relaxed) {
                std::process::exit(1);
            }
        })
        .map_err(|error| {
            Failure::new(
                format_args!("Ctrl-C can't be caught: {error}"),
                "run hachi from an ordinary shell",
            )
        })?;
        Ok(flag)
    }

    /// Whether to stop at the next good place.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Waits for so many tenths of a second, or until it is raised.
    pub fn pause(&self, tenths: u32) {
        for _ in 0..tenths {
            if self.is_cancelled() {
                break;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Asks for a stop, as Ctrl-C does.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
