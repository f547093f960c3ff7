//! From the sensor's time within the hour to a full date.

use hachi_hal::Stamp;

/// Microseconds in an hour, where the sensor's stamp starts again.
pub const HOUR_US: u32 = 3_600_000_000;

/// The UNIX time of a stamp that counts microseconds from the top of the UTC hour, given a clock
/// that is right to within half an hour.
///
/// Meaningful only if the sensor is locked to GPS; otherwise its stamp counts from power-on.
pub fn utc_from_hour_stamp(host: Stamp, hour_us: u32) -> Stamp {
    const HOUR_NS: i64 = HOUR_US as i64 * 1_000;
    let into_hour = host.as_nanos().rem_euclid(HOUR_NS);
    let difference = i64::from(hour_us) * 1_000 - into_hour;
    let nearest = if difference > HOUR_NS / 2 {
        difference - HOUR_NS
    } else if difference < -HOUR_NS / 2 {
        difference + HOUR_NS
    } else {
        difference
    };
    host.offset(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2022-11-26 12:00:00 UTC.
    const NOON_S: i64 = 1_669_464_000;

    fn host(seconds_after_noon: i64) -> Stamp {
        Stamp::from_nanos((NOON_S + seconds_after_noon) * 1_000_000_000)
    }

    fn utc(seconds_after_noon: i64, hour_s: u32) -> i64 {
        utc_from_hour_stamp(host(seconds_after_noon), hour_s * 1_000_000).as_nanos() / 1_000_000_000
    }

    #[test]
    fn within_the_hour_the_stamp_is_added_to_its_top() {
        assert_eq!(utc(100, 101), NOON_S + 101);
        assert_eq!(utc(100, 90), NOON_S + 90);
    }

    #[test]
    fn a_sensor_ahead_across_the_hour_is_in_the_next_one() {
        // Host 12:59:59, sensor already at 0 s.
        assert_eq!(utc(3_599, 0), NOON_S + 3_600);
    }

    #[test]
    fn a_packet_from_before_the_hour_is_in_the_previous_one() {
        // Host 12:00:01, sensor at 3599 s: 11:59:59.
        assert_eq!(utc(1, 3_599), NOON_S - 1);
    }
}
