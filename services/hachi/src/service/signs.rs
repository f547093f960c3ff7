//! Signs of life that tasks leave for each other: when, in atomics, so that nobody waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU8, AtomicU32, AtomicU64, Ordering};

use hachi_behaviour::Causes;
use hachi_hal::Stamp;

/// When something last happened.
#[derive(Debug)]
pub struct Mark(AtomicI64);

const NEVER: i64 = i64::MIN;

impl Default for Mark {
    fn default() -> Self {
        Self(AtomicI64::new(NEVER))
    }
}

impl Mark {
    /// It happened at `stamp`.
    pub fn set(&self, stamp: Stamp) {
        self.0.store(stamp.as_nanos(), Ordering::Release);
    }

    /// When it did, if ever.
    pub fn get(&self) -> Option<Stamp> {
        match self.0.load(Ordering::Acquire) {
            NEVER => None,
            nanos => Some(Stamp::from_nanos(nanos)),
        }
    }

    /// Whether it happened no longer than `limit_ns` before `now`.
    pub fn is_fresh(&self, now: Stamp, limit_ns: i64) -> bool {
        self.get()
            .is_some_and(|stamp| now.nanos_since(stamp) <= limit_ns)
    }
}

/// A word that changes.
#[derive(Debug, Default)]
pub struct Word(AtomicU8);

/// Conditions of localisation, by their number in a [`Word`].
const CONDITIONS: [&str; 5] = ["UNKNOWN", "OK", "DEGRADED", "LOST", "RECOVERING"];

impl Word {
    /// Sets the word; one that is none of the conditions is `UNKNOWN`.
    pub fn set(&self, name: &str) {
        let index = CONDITIONS.iter().position(|c| *c == name).unwrap_or(0);
        self.0.store(index as u8, Ordering::Relaxed);
    }

    /// The word.
    pub fn get(&self) -> &'static str {
        let index = usize::from(self.0.load(Ordering::Relaxed));
        CONDITIONS.get(index).copied().unwrap_or(CONDITIONS[0])
    }
}

/// What all tasks leave.
#[derive(Debug, Default)]
pub struct Signs {
    /// The end of the last scan.
    pub scan: Mark,
    /// The robot's last new state.
    pub robot: Mark,
    /// When the emergency stop's node was last well: heard, in operation, its contacts agreeing.
    pub stop_node: Mark,
    /// The supervisor's last round: the event loop.
    pub event_loop: Mark,
    /// How far the place is to be trusted.
    pub condition: Word,
    causes: AtomicU32,
    /// Loops that were closed.
    pub loops: AtomicU64,
    /// Nodes of the map.
    pub nodes: AtomicU64,
    /// Whether the map can't be kept.
    pub store_fails: AtomicBool,
    /// Whether the recording can't be written.
    pub recording_fails: AtomicBool,
    /// Commands that were cut to a limit.
    pub limited: AtomicU64,
    /// Charge of the battery, per cent; 0 while it is unknown.
    pub battery_percent: AtomicU32,
}

/// The signs, shared.
pub type SharedSigns = Arc<Signs>;

impl Signs {
    /// Why the robot stands, or is slower than was wished.
    pub fn causes(&self) -> Causes {
        Causes::from_bits(self.causes.load(Ordering::Acquire))
    }

    /// Sets why.
    pub fn set_causes(&self, causes: Causes) {
        self.causes.store(causes.bits(), Ordering::Release);
    }
}
