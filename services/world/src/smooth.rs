//! Smooth steps, from which ramps and speed profiles are made.
//!
//! The quintic step has zero first and second derivatives at both ends, so that what is built
//! from it (a slope, a speed) can be differentiated twice, and what integrates it thrice.

/// From 0 to 1 over `t` in `[0, 1]`, constant outside.
pub(crate) fn step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

/// The derivative of [`step`].
pub(crate) fn step_slope(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    30.0 * t * t * (1.0 - t) * (1.0 - t)
}

/// The integral of [`step`] from 0 to `t`: 0.5 at 1, then rising with slope 1.
pub(crate) fn step_integral(t: f64) -> f64 {
    if t <= 0.0 {
        return 0.0;
    }
    if t >= 1.0 {
        return t - 0.5;
    }
    let t4 = t * t * t * t;
    t4 * (2.5 + t * (t - 3.0))
}

/// A rise from 0 to `total` over `length`, with slope zero at both ends: the slope grows over the
/// first `blend`, is constant, and falls over the last `blend`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rise {
    pub length: f64,
    pub blend: f64,
    /// The constant slope in the middle.
    pub slope: f64,
}

impl Rise {
    /// A rise to `total` over `length`; the two blends take at most the whole length.
    pub fn over(length: f64, total: f64, blend: f64) -> Self {
        let blend = blend.min(length / 2.0);
        Self {
            length,
            blend,
            slope: total / (length - blend),
        }
    }

    /// A rise to `total` whose middle slope is `slope` if `total` leaves room for that, and less
    /// if not; each blend takes `blend`.
    pub fn with_slope(total: f64, slope: f64, blend: f64) -> Self {
        // Both blends together cover `slope * blend`.
        let slope = if slope * blend > total {
            total / blend
        } else {
            slope
        };
        Self {
            length: total / slope + blend,
            blend,
            slope,
        }
    }

    /// The value at `x`.
    pub fn value(&self, x: f64) -> f64 {
        let x = x.clamp(0.0, self.length);
        let fall = x - (self.length - self.blend);
        self.slope * self.blend * step_integral(x / self.blend)
            - self.slope * self.blend * step_integral(fall / self.blend)
    }

    /// The slope at `x`, as a share of the middle slope.
    pub fn slope_share(&self, x: f64) -> f64 {
        step(x / self.blend) - step((x - (self.length - self.blend)) / self.blend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rise_ends_at_its_total_with_its_slope_in_the_middle() {
        let rise = Rise::over(4.0, 0.35, 0.5);
        assert_eq!(rise.value(-1.0), 0.0);
        assert!((rise.value(4.0) - 0.35).abs() < 1e-12);
        assert!((rise.value(2.0) - 0.175).abs() < 1e-12);
        let slope = (rise.value(2.1) - rise.value(1.9)) / 0.2;
        assert!((slope - 0.35 / 3.5).abs() < 1e-12);
    }

    #[test]
    fn a_short_rise_gets_a_gentler_slope() {
        let rise = Rise::with_slope(0.1, 0.6, 0.8);
        assert!((rise.value(rise.length) - 0.1).abs() < 1e-12);
        assert!((rise.slope - 0.125).abs() < 1e-12);
    }
}
