//! What wakes a task that waits for input.
//!
//! Ringing takes a few atomic operations and, where the task sleeps, one system call: never a lock.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::Thread;
use std::time::Duration;

use hachi_hal::{Clock, Stamp};

use crate::clock::TaskClock;

/// No ring since the bell was last heard.
const SILENT: i64 = i64::MIN;

#[derive(Debug)]
struct Inner {
    /// When it was first rung since it was last heard, ns.
    rung: AtomicI64,
    sleeper: OnceLock<Thread>,
    clock: TaskClock,
}

/// A bell. Clones are the same bell.
#[derive(Debug, Clone)]
pub struct Bell(Arc<Inner>);

impl Bell {
    /// A silent bell on a clock.
    pub fn new(clock: TaskClock) -> Self {
        Self(Arc::new(Inner {
            rung: AtomicI64::new(SILENT),
            sleeper: OnceLock::new(),
            clock,
        }))
    }

    /// Wakes whoever listens. Rings that nobody has heard yet are one.
    pub fn ring(&self) {
        let now = self.0.clock.now().as_nanos();
        // The first ring stays: how long it took to be heard is measured from it.
        let first = self
            .0
            .rung
            .compare_exchange(SILENT, now, Ordering::AcqRel, Ordering::Acquire);
        if first.is_ok() {
            self.wake();
        }
    }

    /// Ends the listener's sleep without a ring: to look whether it shall stop.
    pub fn wake(&self) {
        if let Some(sleeper) = self.0.sleeper.get() {
            sleeper.unpark();
        }
    }

    /// When it was rung, if it was since it was last heard.
    pub fn hear(&self) -> Option<Stamp> {
        match self.0.rung.swap(SILENT, Ordering::AcqRel) {
            SILENT => None,
            nanos => Some(Stamp::from_nanos(nanos)),
        }
    }

    /// Whether it waits to be heard.
    pub fn is_rung(&self) -> bool {
        self.0.rung.load(Ordering::Acquire) != SILENT
    }

    /// From now on this thread is the one that is woken; one bell has one listener.
    pub(crate) fn listen_here(&self) {
        // A second listener would be woken by nobody: there is none, the table hands each bell out
        // to one task.
        let _ = self.0.sleeper.set(std::thread::current());
    }

    /// Sleeps until it is rung or woken, or for `most`.
    pub(crate) fn sleep(&self, most: Duration) {
        if !self.is_rung() {
            std::thread::park_timeout(most);
        }
    }
}
