//! Signs of life that tasks leave for each other: when, in atomics, so that nobody waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU8, AtomicU32, AtomicU64, Ordering};

use hachi_behaviour::Causes;
use hachi_hal::Stamp;
use hachi_imu::ImuCounters;

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

/// A word that changes, one of few.
#[derive(Debug)]
pub struct Word {
    words: &'static [&'static str],
    index: AtomicU8,
}

/// Conditions of localisation.
const PLACE_CONDITIONS: &[&str] = &["UNKNOWN", "OK", "DEGRADED", "LOST", "RECOVERING"];

/// Conditions of a person; nothing where the robot knows nobody.
const PERSON_CONDITIONS: &[&str] = &["", "SEEN", "FOUND", "UNSURE", "LOST", "SEARCHING"];

impl Word {
    const fn of(words: &'static [&'static str]) -> Self {
        Self {
            words,
            index: AtomicU8::new(0),
        }
    }

    /// Sets the word; one that is none of them is the first.
    pub fn set(&self, name: &str) {
        let index = self.words.iter().position(|word| *word == name);
        self.index
            .store(index.unwrap_or(0) as u8, Ordering::Relaxed);
    }

    /// The word.
    pub fn get(&self) -> &'static str {
        let index = usize::from(self.index.load(Ordering::Relaxed));
        self.words.get(index).copied().unwrap_or(self.words[0])
    }
}

/// What an inertial sensor leaves.
#[derive(Debug, Default)]
pub struct ImuSigns {
    /// When it last measured.
    pub last: Mark,
    /// How often it was started, or that was tried.
    pub starts: AtomicU64,
    /// Reads, and attempts to start it, that failed.
    pub faults: AtomicU64,
    /// Samples that were left out because up was not where it should be.
    pub tilted: AtomicU64,
    samples: AtomicU64,
    missed: AtomicU64,
    not_measured: AtomicU64,
    saturated: AtomicU64,
    restarts: AtomicU64,
}

impl ImuSigns {
    /// Sets what its driver counted.
    pub fn set(&self, counters: &ImuCounters) {
        let ImuCounters {
            samples,
            missed,
            not_measured,
            saturated,
            restarts,
        } = *counters;
        for (sign, count) in [
            (&self.samples, samples),
            (&self.missed, missed),
            (&self.not_measured, not_measured),
            (&self.saturated, saturated),
            (&self.restarts, restarts),
        ] {
            sign.store(count, Ordering::Relaxed);
        }
    }

    /// What its driver counted.
    pub fn counters(&self) -> ImuCounters {
        let count = |sign: &AtomicU64| sign.load(Ordering::Relaxed);
        ImuCounters {
            samples: count(&self.samples),
            missed: count(&self.missed),
            not_measured: count(&self.not_measured),
            saturated: count(&self.saturated),
            restarts: count(&self.restarts),
        }
    }
}

/// What all tasks leave.
#[derive(Debug)]
pub struct Signs {
    /// The end of the last scan.
    pub scan: Mark,
    /// The last picture.
    pub camera: Mark,
    /// The robot's last new state.
    pub robot: Mark,
    /// When the emergency stop's node was last well: heard, in operation, its contacts agreeing.
    pub stop_node: Mark,
    /// Of the inertial sensor on a bus.
    pub imu: ImuSigns,
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
    /// A network that was asked for is not there, or is none.
    pub model_missing: AtomicBool,
    /// A network gave no answer to the last picture.
    pub network_fails: AtomicBool,
    /// How many people are in view.
    pub people_in_view: AtomicU32,
    /// What is known of the robot's person, or the first whom it knows.
    pub person: Word,
    /// Whether somebody is being enrolled.
    pub enrolling: AtomicBool,
    /// Whether the patrol gave up its last place because things stood in the way.
    pub way_blocked: AtomicBool,
    /// Commands that were cut to a limit.
    pub limited: AtomicU64,
    /// Charge of the battery, per cent; 0 while it is unknown.
    pub battery_percent: AtomicU32,
}

impl Default for Signs {
    fn default() -> Self {
        Self {
            scan: Mark::default(),
            camera: Mark::default(),
            robot: Mark::default(),
            event_loop: Mark::default(),
            stop_node: Mark::default(),
            imu: ImuSigns::default(),
            condition: Word::of(PLACE_CONDITIONS),
            causes: AtomicU32::default(),
            loops: AtomicU64::default(),
            nodes: AtomicU64::default(),
            store_fails: AtomicBool::default(),
            recording_fails: AtomicBool::default(),
            model_missing: AtomicBool::default(),
            network_fails: AtomicBool::default(),
            people_in_view: AtomicU32::default(),
            person: Word::of(PERSON_CONDITIONS),
            enrolling: AtomicBool::default(),
            way_blocked: AtomicBool::default(),
            limited: AtomicU64::default(),
            battery_percent: AtomicU32::default(),
        }
    }
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
