//! The robot's clock on a computer with an operating system.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use hachi_hal::{Clock, Stamp};

/// A clock that runs with the monotonic clock and was set to UNIX time once, when it was made.
///
/// It never jumps when the computer's date is corrected; every part of one program that stamps
/// data shares one copy.
#[derive(Debug, Clone, Copy)]
pub struct SystemClock {
    anchor: Instant,
    unix_at_anchor_ns: i64,
}

impl SystemClock {
    /// A clock set to the computer's date, now.
    pub fn new() -> Self {
        Self {
            anchor: Instant::now(),
            unix_at_anchor_ns: unix_now_ns(),
        }
    }

    /// The stamp of a moment that the computer's date clock called `unix_ns`: as long ago on this
    /// clock as it is on that one, if that can be ([`Clock::ago`]).
    pub fn stamp_of_unix(&self, unix_ns: i64) -> Stamp {
        self.ago(unix_now_ns().saturating_sub(unix_ns))
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Stamp {
        let elapsed_ns = i64::try_from(self.anchor.elapsed().as_nanos()).unwrap_or(i64::MAX);
        Stamp::from_nanos(self.unix_at_anchor_ns.saturating_add(elapsed_ns))
    }
}

/// The computer's date as UNIX time, ns; zero if it is set to before 1970.
fn unix_now_ns() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .ok()
        .and_then(|since| i64::try_from(since.as_nanos()).ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_stamp_keeps_its_age() {
        let clock = SystemClock::new();
        let stamp = clock.stamp_of_unix(unix_now_ns() - 5_000_000);
        let age_ns = clock.now().nanos_since(stamp);
        assert!((5_000_000..1_000_000_000).contains(&age_ns), "{age_ns}");
    }

    #[test]
    fn a_date_that_was_set_in_between_does_not_move_the_clock() {
        let clock = SystemClock::new();
        for wrong_ns in [
            unix_now_ns() - 3_600_000_000_000,
            unix_now_ns() + 9_000_000_000,
        ] {
            let before = clock.now();
            let stamp = clock.stamp_of_unix(wrong_ns);
            assert!(stamp >= before && stamp <= clock.now(), "{stamp}");
        }
    }
}
