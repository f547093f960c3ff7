//! Sine and cosine of a whole number of hundredths of a degree, from two small tables.
//!
//! One table has whole degrees, the other hundredths of one; the addition theorem joins them.
//! 3.7 kB instead of the 288 kB of a full table, which would push the points out of the cache.
//! The result is within 2e-7 of the truth: 20 µm at 100 m.

/// Sine and cosine.
#[derive(Clone, Copy)]
pub(super) struct SinCos {
    pub(super) sin: f32,
    pub(super) cos: f32,
}

static DEGREES: [SinCos; 360] = table::<360>(1.0);
static HUNDREDTHS: [SinCos; 100] = table::<100>(0.01);

/// Sine and cosine of `azimuth` hundredths of a degree; `azimuth` is below 36000.
pub(super) fn sin_cos(azimuth: u16) -> SinCos {
    let whole = DEGREES[usize::from(azimuth / 100) % 360];
    let part = HUNDREDTHS[usize::from(azimuth % 100)];
    SinCos {
        sin: whole.sin * part.cos + whole.cos * part.sin,
        cos: whole.cos * part.cos - whole.sin * part.sin,
    }
}

const fn table<const N: usize>(step_deg: f64) -> [SinCos; N] {
    let mut entries = [SinCos { sin: 0.0, cos: 0.0 }; N];
    let mut index = 0;
    while index < N {
        let mut degrees = index as f64 * step_deg;
        if degrees > 180.0 {
            degrees -= 360.0;
        }
        entries[index] = series(degrees * core::f64::consts::PI / 180.0);
        index += 1;
    }
    entries
}

/// Taylor series around zero: 20 terms leave less than 1e-17 at ±π.
const fn series(x: f64) -> SinCos {
    let (mut sin, mut cos) = (0.0, 0.0);
    let (mut term, mut n) = (1.0, 0);
    while n < 40 {
        let sign = if n % 4 < 2 { 1.0 } else { -1.0 };
        if n % 2 == 0 {
            cos += sign * term;
        } else {
            sin += sign * term;
        }
        n += 1;
        term = term * x / n as f64;
    }
    SinCos {
        sin: sin as f32,
        cos: cos as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_azimuth_is_within_two_tenths_of_a_millionth() {
        for azimuth in 0..36_000_u16 {
            let (sin, cos) = libm::sincos(f64::from(azimuth).to_radians() / 100.0);
            let got = sin_cos(azimuth);
            let error = (f64::from(got.sin) - sin)
                .abs()
                .max((f64::from(got.cos) - cos).abs());
            assert!(error < 2e-7, "{azimuth}: {error:e}");
        }
    }
}
