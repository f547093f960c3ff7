//! Which bin of the polar grid a point falls into.
//!
//! In: positions. Out: a bin's index for each, sector by sector, or [`OUTSIDE`]. The index, counted
//! from 1, is `i = clamp(ceil(r / r_max * N_r), 1, N_r)` for rings and likewise
//! `j = clamp(ceil(theta / 2 pi * N_s), 1, N_s)` for sectors, `theta` in `[0, 2 pi)` anticlockwise
//! from x. Returns beyond `r_max` are outside the grid.

use crate::profile::Profile;

/// Not in the grid: too far, or not finite.
pub(crate) const OUTSIDE: u16 = u16::MAX;

/// Writes the bin of every point, as seen from `lateral_m` to the left of the origin.
pub(crate) fn bins(profile: &Profile, points: &[[f32; 4]], lateral_m: f32, out: &mut Vec<u16>) {
    let (rings, sectors) = (profile.rings() as i32, profile.sectors() as i32);
    let rings_per_metre = rings as f32 / profile.max_range_m();
    let reach_sq = profile.max_range_m() * profile.max_range_m();
    out.clear();
    out.extend(points.iter().map(|&[x, y, z, _]| {
        let y = y - lateral_m;
        let range_sq = x * x + y * y;
        let ring = ceil(range_sq.sqrt() * rings_per_metre).clamp(1, rings) - 1;
        let sector = ceil(turn(y, x) * sectors as f32).clamp(1, sectors) - 1;
        // Not so for NaN; an infinite z is no height.
        let inside = range_sq <= reach_sq && z.abs() < f32::INFINITY;
        if inside {
            (sector * rings + ring) as u16
        } else {
            OUTSIDE
        }
    }));
}

/// The least whole number not below a number; more than any grid has for large ones and NaN.
#[inline(always)]
fn ceil(value: f32) -> i32 {
    // `f32::ceil` is a function call on processors before SSE 4.1.
    let value = value.min(65_536.0);
    let whole = value as i32;
    whole + i32::from(value > whole as f32)
}

/// The angle of `(x, y)` as a share of a full turn, in `[0, 1]`; 0 for the origin.
///
/// Polynomial of Cephes' `atanf` (Moshier, 1989), good to the last bits of an `f32`, without a
/// branch: several points at a time.
#[inline(always)]
fn turn(y: f32, x: f32) -> f32 {
    const TAN_PI_8: f32 = 0.414_213_56;
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = (ax.min(ay), ax.max(ay));
    // In [0, 1]; a positive divisor even at the origin.
    let ratio = small / large.max(f32::MIN_POSITIVE);
    let steep = ratio > TAN_PI_8;
    let reduced = if steep {
        (ratio - 1.0) / (ratio + 1.0)
    } else {
        ratio
    };
    let s = reduced * reduced;
    let series = ((8.053_744_5e-2 * s - 1.387_768_6e-1) * s + 1.997_771_1e-1) * s - 3.333_295e-1;
    let angle = series * s * reduced + reduced;
    let angle = if steep {
        angle + std::f32::consts::FRAC_PI_4
    } else {
        angle
    };
    let angle = if ay > ax {
        std::f32::consts::FRAC_PI_2 - angle
    } else {
        angle
    };
    let angle = if x < 0.0 {
        std::f32::consts::PI - angle
    } else {
        angle
    };
    let turn = angle / std::f32::consts::TAU;
    if y < 0.0 { 1.0 - turn } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_turn_agrees_with_the_library_arc_tangent() {
        for step in 0..20_000 {
            let angle = step as f32 / 20_000.0 * std::f32::consts::TAU;
            let (x, y) = (angle.cos() * 7.3, angle.sin() * 7.3);
            let exact = f64::from(y).atan2(f64::from(x)) / std::f64::consts::TAU;
            let exact = if exact < 0.0 { exact + 1.0 } else { exact };
            let error = (f64::from(turn(y, x)) - exact).abs();
            assert!(!(2e-7..=1.0 - 2e-7).contains(&error), "{angle}: {error}");
        }
        assert_eq!(turn(0.0, 0.0), 0.0);
        assert_eq!(turn(-0.0, 1.0), 0.0);
    }

    /// `i = clamp(ceil(r / r_max * N_r), 1, N_r)` with 20 rings and 60 sectors to 80 m, worked out
    /// by hand: rings of 4 m, sectors of 6 degrees.
    #[test]
    fn bins_are_those_of_the_formula() {
        let at = |x: f32, y: f32| {
            let mut out = Vec::new();
            bins(&Profile::OUTDOOR, &[[x, y, 1.0, 0.0]], 0.0, &mut out);
            (out[0] != OUTSIDE).then(|| (out[0] % 20 + 1, out[0] / 20 + 1))
        };
        assert_eq!(at(0.0, 0.0), Some((1, 1)));
        assert_eq!(at(4.0, 0.0), Some((1, 1))); // ceil(1) = 1
        assert_eq!(at(4.001, 0.0), Some((2, 1)));
        assert_eq!(at(80.0, 0.0), Some((20, 1)));
        assert_eq!(at(80.01, 0.0), None);
        assert_eq!(at(10.0, 0.1), Some((3, 1)));
        assert_eq!(at(0.001, 10.0), Some((3, 15))); // just before 90 degrees
        assert_eq!(at(-0.001, 10.0), Some((3, 16)));
        assert_eq!(at(-10.0, 0.001), Some((3, 30)));
        assert_eq!(at(-10.0, -0.001), Some((3, 31)));
        assert_eq!(at(10.0, -0.001), Some((3, 60)));
        assert_eq!(at(f32::NAN, 0.0), None);
        assert_eq!(at(f32::INFINITY, 1.0), None);
        assert_eq!(at(1e30, -1e30), None);
    }

    #[test]
    fn a_view_from_the_left_sees_the_cloud_to_its_right() {
        let mut out = Vec::new();
        bins(&Profile::OUTDOOR, &[[0.0, 0.0, 1.0, 0.0]], 2.0, &mut out);
        // 2 m away, at -90 degrees: ring 1, sector 45 or 46 (270 / 6 = 45).
        assert_eq!(out[0] % 20, 0);
        assert_eq!(out[0] / 20, 44);
    }
}
