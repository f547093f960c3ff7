//! What the time field of a cloud's points means.
//!
//! Drivers agree on neither unit nor origin: Ouster sends `t` as u32 nanoseconds after the
//! message's stamp, Velodyne `time` as f32 seconds before or after it, Hesai and Livox `timestamp`
//! as f64 seconds or nanoseconds of UNIX time. The numbers tell them apart, because a turn lasts
//! between some milliseconds and two seconds.

use super::scalar::Column;

/// What a cloud's point times say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointTimes {
    /// There are none, they are all equal, or they make no sense for one turn of a LiDAR.
    None,
    /// All points carry the same UNIX time, ns: the scan's, not theirs.
    Same(i64),
    /// Nanoseconds of the first and the last point against the scan's stamp.
    Relative(i64, i64),
    /// UNIX nanoseconds of the first and the last point.
    Absolute(i64, i64),
}

/// The longest turn, s. A VLP-16 at its slowest takes 0.2 s, a solid-state scan at 1 Hz a whole
/// second.
const LONGEST_SCAN_S: f64 = 2.0;
/// The farthest a scan's stamp may be from its points, s.
const FARTHEST_STAMP_S: f64 = 10.0;
/// UNIX times are later than 1973, s; no offset is that long.
const EARLIEST_UNIX_S: f64 = 1e8;

/// Reads the times of one cloud's points, then says what they mean.
#[derive(Debug, Default)]
pub(crate) struct TimeReader {
    /// One per point; floats as their value, integers in `whole`. One of the two is empty.
    float: Vec<f64>,
    whole: Vec<i64>,
    /// Nanoseconds in one unit, once a cloud of this stream settled it.
    unit_ns: Option<f64>,
}

impl TimeReader {
    pub(crate) fn clear(&mut self) {
        self.float.clear();
        self.whole.clear();
    }

    pub(crate) fn push(&mut self, column: Column, row: &[u8]) {
        if column.scalar.is_float() {
            self.float.push(column.f64(row));
        } else {
            self.whole.push(column.i64(row));
        }
    }

    /// Settles the unit and calls `set(point, offset)` with each point's nanoseconds after the
    /// first one.
    pub(crate) fn finish(&mut self, mut set: impl FnMut(usize, u32)) -> PointTimes {
        let Some((low, high)) = self.extent() else {
            return PointTimes::None;
        };
        let Some(unit_ns) = self.unit(low, high) else {
            return PointTimes::None;
        };
        let nanos_of = |value: f64| value * unit_ns;
        let unix = nanos_of(low) > EARLIEST_UNIX_S * 1e9;
        if !unix && nanos_of(low).abs().max(nanos_of(high).abs()) > FARTHEST_STAMP_S * 1e9 {
            return PointTimes::None;
        }
        if nanos_of(high) - nanos_of(low) > LONGEST_SCAN_S * 1e9 || nanos_of(high) > 9.2e18 {
            return PointTimes::None;
        }
        let (first, last) = if self.whole.is_empty() {
            // Subtracted before it is scaled: seconds of UNIX time have no digits to spare.
            for (index, &value) in self.float.iter().enumerate() {
                let after = if value.is_finite() { value - low } else { 0.0 };
                set(index, (after * unit_ns).round() as u32);
            }
            let first = (low * unit_ns).round() as i64;
            (first, first + ((high - low) * unit_ns).round() as i64)
        } else {
            let unit = unit_ns as i64;
            let least = self.whole.iter().copied().min().unwrap_or(0);
            let most = self.whole.iter().copied().max().unwrap_or(0);
            for (index, &value) in self.whole.iter().enumerate() {
                let after = value.saturating_sub(least).saturating_mul(unit);
                set(index, u32::try_from(after).unwrap_or(u32::MAX));
            }
            (least.saturating_mul(unit), most.saturating_mul(unit))
        };
        match (unix, first == last) {
            (true, true) => PointTimes::Same(first),
            (false, true) => PointTimes::None,
            (true, false) => PointTimes::Absolute(first, last),
            (false, false) => PointTimes::Relative(first, last),
        }
    }

    /// Smallest and largest finite value.
    fn extent(&self) -> Option<(f64, f64)> {
        let floats = self.float.iter().copied().filter(|v| v.is_finite());
        let wholes = self.whole.iter().map(|&v| v as f64);
        let mut extent = None;
        for value in floats.chain(wholes) {
            let (low, high) = extent.unwrap_or((value, value));
            extent = Some((value.min(low), value.max(high)));
        }
        extent
    }

    /// Nanoseconds in one unit of these values; remembered once a spread has settled it.
    fn unit(&mut self, low: f64, high: f64) -> Option<f64> {
        if let Some(unit) = self.unit_ns {
            return Some(unit);
        }
        let spread = high - low;
        let unit = match high.abs() {
            // UNIX times by their size alone: as offsets they would be hours long.
            size if size >= 1e17 => Some(1.0),
            size if size >= 1e14 => Some(1e3),
            size if size >= 1e11 => Some(1e6),
            _ if self.whole.is_empty() => match spread {
                s if s <= LONGEST_SCAN_S => Some(1e9),
                s if s <= LONGEST_SCAN_S * 1e3 => Some(1e6),
                s if s <= LONGEST_SCAN_S * 1e6 => Some(1e3),
                s if s <= LONGEST_SCAN_S * 1e9 => Some(1.0),
                _ => None,
            },
            // Whole numbers are nanoseconds, or microseconds where a turn would otherwise last
            // under two milliseconds.
            _ => match spread {
                s if (2e3..2e6).contains(&s) => Some(1e3),
                s if s <= LONGEST_SCAN_S * 1e9 => Some(1.0),
                _ => None,
            },
        };
        if spread > 0.0 {
            self.unit_ns = unit;
        }
        unit
    }
}

#[cfg(test)]
mod tests {
    use super::super::scalar::Scalar;
    use super::*;

    fn read(scalar: Scalar, values: &[&str]) -> (PointTimes, Vec<u32>) {
        let column = Column {
            offset: 0,
            scalar,
            big_endian: false,
        };
        let mut reader = TimeReader::default();
        for value in values {
            let mut row = Vec::new();
            assert!(scalar.push_text(value, &mut row));
            reader.push(column, &row);
        }
        let mut offsets = vec![0; values.len()];
        let times = reader.finish(|index, offset| offsets[index] = offset);
        (times, offsets)
    }

    #[test]
    fn whole_numbers_of_a_tenth_second_turn_are_nanoseconds() {
        let (times, offsets) = read(Scalar::U32, &["0", "50000000", "99900000"]);
        assert_eq!(times, PointTimes::Relative(0, 99_900_000));
        assert_eq!(offsets, [0, 50_000_000, 99_900_000]);
    }

    #[test]
    fn floats_are_seconds_before_the_stamp_too() {
        let (times, offsets) = read(Scalar::F32, &["-0.0625", "-0.03125", "0"]);
        assert_eq!(times, PointTimes::Relative(-62_500_000, 0));
        assert_eq!(offsets, [0, 31_250_000, 62_500_000]);
    }

    #[test]
    fn unix_times_are_recognised_in_seconds_and_nanoseconds() {
        let (times, offsets) = read(Scalar::F64, &["1673400472.5", "1673400472.5625"]);
        assert_eq!(
            times,
            PointTimes::Absolute(1_673_400_472_500_000_000, 1_673_400_472_562_500_000)
        );
        assert_eq!(offsets, [0, 62_500_000]);
        let (times, _) = read(Scalar::U64, &["1673400472500000001", "1673400472562500003"]);
        assert_eq!(
            times,
            PointTimes::Absolute(1_673_400_472_500_000_001, 1_673_400_472_562_500_003)
        );
    }

    #[test]
    fn whole_microseconds_are_told_by_their_spread() {
        let (times, _) = read(Scalar::U32, &["0", "99900"]);
        assert_eq!(times, PointTimes::Relative(0, 99_900_000));
    }

    #[test]
    fn one_time_for_all_points_is_no_point_time() {
        assert_eq!(read(Scalar::U32, &["1483724884"; 3]).0, PointTimes::None);
        assert_eq!(
            read(Scalar::F64, &["1673400472.5"; 2]).0,
            PointTimes::Same(1_673_400_472_500_000_000)
        );
    }

    #[test]
    fn times_that_fit_no_turn_are_left_out() {
        assert_eq!(read(Scalar::F64, &["0", "1e12"]).0, PointTimes::None);
        assert_eq!(read(Scalar::F64, &["nan", "inf"]).0, PointTimes::None);
        assert_eq!(read(Scalar::I64, &["-9e18", "9e18"]).0, PointTimes::None);
    }
}
