//! Where values lie, but for a few stray ones, without keeping them.
//!
//! In: values one by one. Out: the bounds between which all but a share of them lie, to one of 4096
//! steps over everything seen.

const STEPS: usize = 4096;
/// A step to begin with, metres; it doubles whenever a value lies farther out.
const FIRST_STEP_M: f64 = 0.01;

/// A histogram that widens.
#[derive(Debug)]
pub(super) struct Spread {
    counts: Vec<u64>,
    low_m: f64,
    step_m: f64,
    all: u64,
}

impl Spread {
    pub(super) fn new() -> Self {
        Self {
            counts: vec![0; STEPS],
            low_m: 0.0,
            step_m: FIRST_STEP_M,
            all: 0,
        }
    }

    /// One more value, metres. One that is not finite is passed over.
    pub(super) fn add(&mut self, value_m: f64) {
        if !value_m.is_finite() {
            return;
        }
        if self.all == 0 {
            self.low_m = value_m - FIRST_STEP_M * (STEPS / 2) as f64;
        }
        loop {
            let step = ((value_m - self.low_m) / self.step_m).floor();
            if step >= 0.0 && step < STEPS as f64 {
                self.counts[step as usize] += 1;
                self.all += 1;
                return;
            }
            self.widen(step < 0.0);
        }
    }

    /// Pairs of steps become one; the room that is won lies below or above.
    fn widen(&mut self, below: bool) {
        let half = STEPS / 2;
        for i in 0..half {
            self.counts[i] = self.counts[2 * i] + self.counts[2 * i + 1];
        }
        self.counts[half..].fill(0);
        if below {
            self.counts.rotate_right(half);
            self.low_m -= self.step_m * STEPS as f64;
        }
        self.step_m *= 2.0;
    }

    /// The bounds outside of which lies no more than `stray` of all values on either side, metres.
    /// `None` if there was no value.
    pub(super) fn bounds(&self, stray: f64) -> Option<(f64, f64)> {
        let passed_over = (self.all as f64 * stray) as u64;
        let beyond = |sum: &mut u64, count: &u64| {
            *sum += count;
            Some(*sum > passed_over)
        };
        let mut sums = self.counts.iter().scan(0, beyond);
        let low = sums.position(|is_beyond| is_beyond)?;
        let mut sums = self.counts.iter().rev().scan(0, beyond);
        let high = STEPS - sums.position(|is_beyond| is_beyond)?;
        let at = |step: usize| self.low_m + self.step_m * step as f64;
        Some((at(low), at(high)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_stray_values_move_no_bound_however_far_they_lie() {
        let mut spread = Spread::new();
        assert_eq!(spread.bounds(0.1), None);
        spread.add(f64::NAN);
        spread.add(-3e5);
        for i in 0..10_000 {
            spread.add(2.0 + f64::from(i) * 0.01);
        }
        spread.add(9e5);
        let step = spread.step_m;
        // 1.2 million metres over 4096 steps, doubled from a hundredth: 327 m each.
        assert!((300.0..700.0).contains(&step), "{step}");
        let (low, high) = spread.bounds(0.002).unwrap();
        assert!(low <= 2.2 && low > 2.2 - step, "{low}");
        assert!(high >= 101.8 && high < 101.8 + step, "{high}");
    }

    #[test]
    fn bounds_are_as_fine_as_the_values_lie_close() {
        let mut spread = Spread::new();
        for i in 0..1_000 {
            spread.add(f64::from(i) * 0.02 - 10.0);
        }
        let (low, high) = spread.bounds(0.01).unwrap();
        assert!((low + 9.8).abs() < 0.02, "{low}");
        assert!((high - 9.8).abs() < 0.02, "{high}");
    }
}
