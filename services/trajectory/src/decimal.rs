//! Decimal text to whole nanoseconds, exactly.
//!
//! A UNIX time in seconds does not fit a double to better than 0.2 µs, so times never pass
//! through one: the digits are read as an integer and shifted.

use hachi_hal::Stamp;

/// Digits beyond these change nothing that fits a [`Stamp`] (19 digits) and would overflow.
const MAX_DIGITS: u32 = 30;

/// The time written in `text` as a number of seconds (`unit_exponent` 9) or nanoseconds (0).
///
/// Accepts what `printf` and numpy write: sign, digits, a point, an exponent. Digits below a
/// nanosecond are rounded to the nearest, halves away from zero. `None` if it is not such a
/// number or does not fit ±292 years.
pub(crate) fn parse_stamp(text: &str, unit_exponent: i32) -> Option<Stamp> {
    let (negative, text) = match text.as_bytes().first()? {
        b'-' => (true, &text[1..]),
        b'+' => (false, &text[1..]),
        _ => (false, text),
    };
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }

    let mut digits: i128 = 0;
    let mut used = 0;
    let mut shift = i64::from(exponent) + i64::from(unit_exponent);
    for (byte, after_point) in whole
        .bytes()
        .map(|b| (b, false))
        .chain(fraction.bytes().map(|b| (b, true)))
    {
        if !byte.is_ascii_digit() {
            return None;
        }
        if used == MAX_DIGITS {
            shift += i64::from(!after_point);
            continue;
        }
        digits = digits * 10 + i128::from(byte - b'0');
        used += u32::from(digits != 0);
        shift -= i64::from(after_point);
    }

    let nanos = match u32::try_from(shift.unsigned_abs()) {
        _ if digits == 0 => 0,
        Ok(places) if shift >= 0 => digits.checked_mul(10i128.checked_pow(places)?)?,
        Ok(places) => match 10i128.checked_pow(places) {
            Some(divisor) => (digits + divisor / 2) / divisor,
            None => 0,
        },
        Err(_) if shift < 0 => 0,
        Err(_) => return None,
    };
    let nanos = i64::try_from(if negative { -nanos } else { nanos }).ok()?;
    Some(Stamp::from_nanos(nanos))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn seconds(text: &str) -> Option<i64> {
        parse_stamp(text, 9).map(Stamp::as_nanos)
    }

    #[test]
    fn unix_times_keep_every_nanosecond() {
        assert_eq!(seconds("1403636579.763555584"), Some(1403636579763555584));
        assert_eq!(
            seconds("1.403636579763555584e+09"),
            Some(1403636579763555584)
        );
        assert_eq!(
            parse_stamp("1403636579763555584", 0),
            Some(Stamp::from_nanos(1403636579763555584))
        );
        assert_eq!(
            parse_stamp("1.403636579763555584e18", 0),
            Some(Stamp::from_nanos(1403636579763555584))
        );
    }

    #[test]
    fn digits_below_a_nanosecond_are_rounded() {
        assert_eq!(seconds("0.0000000014"), Some(1));
        assert_eq!(seconds("0.0000000015"), Some(2));
        assert_eq!(seconds("-0.5"), Some(-500_000_000));
        assert_eq!(seconds("1e-400"), Some(0));
        assert_eq!(
            seconds("0.1000000000000000000000000000000000000000001"),
            Some(100_000_000)
        );
    }

    #[test]
    fn what_is_no_number_or_does_not_fit_is_refused() {
        for text in [
            "",
            "-",
            ".",
            "e5",
            "1.2.3",
            "nan",
            "inf",
            "1e",
            "0x10",
            "1e30",
            "99999999999",
            "1 2",
        ] {
            assert_eq!(seconds(text), None, "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn whole_nanoseconds_survive_writing_and_reading(nanos in any::<i64>()) {
            let text = format!(
                "{}{}.{:09}",
                if nanos < 0 { "-" } else { "" },
                nanos.unsigned_abs() / 1_000_000_000,
                nanos.unsigned_abs() % 1_000_000_000,
            );
            // i64::MIN itself has no positive counterpart, but fits as i128 before the sign.
            prop_assert_eq!(seconds(&text), Some(nanos));
        }

        #[test]
        fn any_text_is_answered(text in ".{0,40}") {
            let _ = parse_stamp(&text, 9);
        }
    }
}
