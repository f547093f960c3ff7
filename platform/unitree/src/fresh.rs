//! Whether a state is newer than the last: a LowState counts milliseconds, a HighState does not.
//!
//! In: the tick, or the bytes, of each state that arrives. Out: new, repeated, late. A HighState
//! can only be told from the last by its contents; those of a robot that lives never stay the same,
//! because its inertial sensor has noise.

use hachi_hal::Stamp;

use crate::frame::LONGEST_FRAME;

/// What a tick says of its state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TickVerdict {
    /// Newer than the last one by this much, ms.
    New {
        /// Milliseconds since the last one; 0 for the first.
        after_ms: u32,
    },
    /// The last one once more.
    Repeated,
    /// Older than the last one by this much, ms: overtaken on the way, or played again.
    Late {
        /// Milliseconds.
        by_ms: u32,
    },
    /// So far back that the robot's controller must have been started anew.
    Restarted,
}

/// A tick this much older is a restart rather than a datagram that lost its way, ms.
const RESTART_MS: u32 = 5_000;

/// Follows the ticks of LowStates. The counter wraps after 49.7 days, which is no step back.
#[derive(Debug, Clone, Copy, Default)]
pub struct TickWatch {
    last: Option<u32>,
}

impl TickWatch {
    /// Judges the next tick.
    pub fn judge(&mut self, tick_ms: u32) -> TickVerdict {
        let Some(last) = self.last else {
            self.last = Some(tick_ms);
            return TickVerdict::New { after_ms: 0 };
        };
        let ahead = tick_ms.wrapping_sub(last);
        let back = last.wrapping_sub(tick_ms);
        let verdict = if ahead == 0 {
            TickVerdict::Repeated
        } else if ahead < u32::MAX / 2 {
            TickVerdict::New { after_ms: ahead }
        } else if back <= RESTART_MS {
            TickVerdict::Late { by_ms: back }
        } else {
            TickVerdict::Restarted
        };
        if matches!(verdict, TickVerdict::New { .. } | TickVerdict::Restarted) {
            self.last = Some(tick_ms);
        }
        verdict
    }
}

/// How the link to a robot is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkHealth {
    /// Nothing was heard yet.
    Unheard,
    /// States arrive and are new.
    Alive,
    /// States arrive, but always the same one, for this long, ns.
    Frozen {
        /// Nanoseconds.
        for_ns: i64,
    },
    /// No state arrived for this long, ns.
    Silent {
        /// Nanoseconds.
        for_ns: i64,
    },
}

/// Follows the contents of HighStates.
#[derive(Debug, Clone)]
pub struct ContentWatch {
    last: [u8; LONGEST_FRAME],
    len: usize,
    heard: Option<Stamp>,
    changed: Option<Stamp>,
}

impl Default for ContentWatch {
    fn default() -> Self {
        Self {
            last: [0; LONGEST_FRAME],
            len: 0,
            heard: None,
            changed: None,
        }
    }
}

impl ContentWatch {
    /// Whether a frame differs from the last one.
    pub fn is_new(&mut self, frame: &[u8], now: Stamp) -> bool {
        self.heard = Some(now);
        if frame == &self.last[..self.len] {
            return false;
        }
        // Frames are no longer than the longest; anything else would count as always new.
        self.len = frame.len().min(LONGEST_FRAME);
        self.last[..self.len].copy_from_slice(&frame[..self.len]);
        self.changed = Some(now);
        true
    }

    /// How the link is at `now`, if states must come every `silent_ns` and change every
    /// `frozen_ns`.
    pub fn health(&self, now: Stamp, silent_ns: i64, frozen_ns: i64) -> LinkHealth {
        let (Some(heard), Some(changed)) = (self.heard, self.changed) else {
            return LinkHealth::Unheard;
        };
        let since = |stamp: Stamp| now.nanos_since(stamp);
        if since(heard) > silent_ns {
            LinkHealth::Silent {
                for_ns: since(heard),
            }
        } else if since(changed) > frozen_ns {
            LinkHealth::Frozen {
                for_ns: since(changed),
            }
        } else {
            LinkHealth::Alive
        }
    }
}
