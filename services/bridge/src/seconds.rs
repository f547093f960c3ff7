//! Decimal seconds to integer nanoseconds, exactly.
//!
//! UNIX times need 19 digits and an `f64` has 16: going through it would move stamps by 0.2 µs.

use hachi_hal::Stamp;

/// A time in seconds, written in decimal, as a stamp.
///
/// Plain decimals are exact (digits past the ninth are cut); numbers with an exponent go through
/// `f64`, whose error is below a nanosecond for times under 48 days. `None` for anything that is
/// not a finite number or does not fit.
pub(crate) fn stamp_from_seconds(text: &str) -> Option<Stamp> {
    let text = text.trim();
    if text.contains(['e', 'E']) {
        let nanos = text.parse::<f64>().ok()? * 1e9;
        return (nanos.abs() < 9.2e18).then(|| Stamp::from_nanos(nanos.round() as i64));
    }
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let only_digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if (whole.is_empty() && fraction.is_empty()) || !only_digits(whole) || !only_digits(fraction) {
        return None;
    }
    let seconds: i64 = match whole {
        "" => 0,
        _ => whole.parse().ok()?,
    };
    let mut nanos = 0_i64;
    for place in 0..9 {
        let digit = fraction.as_bytes().get(place).map_or(0, |b| b - b'0');
        nanos = nanos * 10 + i64::from(digit);
    }
    let total = seconds.checked_mul(1_000_000_000)?.checked_add(nanos)?;
    Some(Stamp::from_nanos(if negative { -total } else { total }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_seconds_keep_every_nanosecond() {
        let cases = [
            ("1647090478.710633039", 1_647_090_478_710_633_039),
            ("1577836980.0991046", 1_577_836_980_099_104_600),
            ("0.103600", 103_600_000),
            ("1.036000e-01", 103_600_000),
            ("-0.5", -500_000_000),
            (" 12 ", 12_000_000_000),
            (".25", 250_000_000),
        ];
        for (text, nanos) in cases {
            assert_eq!(stamp_from_seconds(text), Some(Stamp::from_nanos(nanos)));
        }
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "",
            ".",
            "nan",
            "inf",
            "1e300",
            "12a",
            "1.2.3",
            "99999999999999",
            "--1",
        ] {
            assert_eq!(stamp_from_seconds(text), None, "{text}");
        }
    }
}
