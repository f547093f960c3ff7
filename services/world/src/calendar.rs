//! Civil time for sensors that speak NMEA: a UNIX time as date, time of day and GPRMC sentence.

/// A moment of UNIX time, to the microsecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Utc {
    /// Whole seconds since 1970.
    pub seconds: u64,
    /// Microseconds of the second.
    pub micros: u32,
}

impl Utc {
    /// From nanoseconds since 1970, rounded down; times before 1970 become 1970.
    pub fn from_nanos(nanos: i64) -> Self {
        let nanos = nanos.max(0) as u64;
        Self {
            seconds: nanos / 1_000_000_000,
            micros: (nanos % 1_000_000_000 / 1_000) as u32,
        }
    }

    pub fn micros_past_hour(&self) -> u32 {
        (self.seconds % 3600) as u32 * 1_000_000 + self.micros
    }

    /// Year, month, day. Counts whole 400-year cycles from March of the year 0, so that the leap
    /// day is the last of its year.
    fn date(&self) -> (u64, u64, u64) {
        let days = self.seconds / 86_400 + 719_468;
        let (cycle, day) = (days / 146_097, days % 146_097);
        let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
        let day = day - (365 * year + year / 4 - year / 100);
        let month = (5 * day + 2) / 153;
        let day = day - (153 * month + 2) / 5 + 1;
        let (month, carry) = if month < 10 {
            (month + 3, 0)
        } else {
            (month - 9, 1)
        };
        (400 * cycle + year + carry, month, day)
    }

    /// A GPRMC sentence for a receiver that stands still, with checksum, CR and LF.
    pub fn gprmc(&self) -> String {
        let (year, month, day) = self.date();
        let of_day = self.seconds % 86_400;
        let body = format!(
            "GPRMC,{:02}{:02}{:02}.00,A,4807.038,N,01131.000,E,000.0,000.0,{day:02}{month:02}{:02},,,A",
            of_day / 3600,
            of_day / 60 % 60,
            of_day % 60,
            year % 100,
        );
        let checksum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{checksum:02X}\r\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gprmc_sentence_has_the_right_date_and_checksum() {
        // 2026-11-22 12:00:00 UTC, and the checksum of this sentence worked out by hand.
        let utc = Utc::from_nanos(1_795_348_800_000_000_000);
        assert_eq!(
            utc.gprmc(),
            "$GPRMC,120000.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B\r\n"
        );
    }

    #[test]
    fn leap_days_are_days() {
        let date = |seconds| Utc { seconds, micros: 0 }.date();
        assert_eq!(date(0), (1970, 1, 1));
        assert_eq!(date(1_709_164_800), (2024, 2, 29));
        assert_eq!(date(1_709_251_200), (2024, 3, 1));
    }
}
