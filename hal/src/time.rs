//! One clock for the whole robot: nanoseconds, as integers.

use core::fmt;
use core::ops::{Add, Sub};

/// A moment on the robot's clock, in nanoseconds.
///
/// On the robot this clock is monotonic; in a recording it is the capture's UNIX clock. No
/// algorithm reads a clock: stamps come in with the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stamp(i64);

impl Stamp {
    /// The stamp `nanos` nanoseconds after the clock's zero.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// The stamp of a second and the nanoseconds after it; `None` if it does not fit.
    pub const fn from_secs_nanos(secs: i64, nanos: u32) -> Option<Self> {
        match secs.checked_mul(1_000_000_000) {
            Some(s) => match s.checked_add(nanos as i64) {
                Some(n) => Some(Self(n)),
                None => None,
            },
            None => None,
        }
    }

    /// Nanoseconds since the clock's zero.
    pub const fn as_nanos(self) -> i64 {
        self.0
    }

    /// Seconds since the clock's zero. Exact to about 0.2 µs for UNIX times of this century.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Nanoseconds from `earlier` to `self`; negative if `earlier` is later. Saturates.
    pub const fn nanos_since(self, earlier: Self) -> i64 {
        self.0.saturating_sub(earlier.0)
    }

    /// Seconds from `earlier` to `self`.
    pub fn secs_since(self, earlier: Self) -> f64 {
        self.nanos_since(earlier) as f64 * 1e-9
    }

    /// The stamp `nanos` later (earlier if negative), saturating at the ends of the clock.
    pub const fn offset(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }
}

/// Adds nanoseconds, saturating.
impl Add<i64> for Stamp {
    type Output = Self;
    fn add(self, nanos: i64) -> Self {
        self.offset(nanos)
    }
}

/// Nanoseconds between two stamps, saturating.
impl Sub for Stamp {
    type Output = i64;
    fn sub(self, earlier: Self) -> i64 {
        self.nanos_since(earlier)
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let nanos = self.0.unsigned_abs();
        let (s, n) = (nanos / 1_000_000_000, nanos % 1_000_000_000);
        write!(f, "{sign}{s}.{n:09}")
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn stamps_are_printed_as_seconds_on_both_sides_of_zero() {
        let printed = |nanos| Stamp::from_nanos(nanos).to_string();
        assert_eq!(printed(1_500_000_000), "1.500000000");
        assert_eq!(printed(-1_500_000_000), "-1.500000000");
        assert_eq!(printed(-1), "-0.000000001");
        assert_eq!(printed(i64::MIN), "-9223372036.854775808");
    }
}
