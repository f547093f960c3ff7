//! Where a box is and how it moves: one Kalman filter each for middle and size.
//!
//! In: measured boxes and the time between them. Out: the box now, its speed, how sure that is.
//!
//! Constant speed driven by white acceleration (Bar-Shalom, Li and Kirubarajan, *Estimation with
//! Applications to Tracking and Navigation*, 6.2.2). The noise of the four numbers is independent,
//! so that a filter of eight states falls into four of two. All of it grows with the height of the
//! person, which stands for the distance (as in SORT's followers: Wojke, Bewley and Paulus, ICIP
//! 2017); time is in seconds, so that the rate of frames is of no matter.

use crate::BoundingBox;

/// A detector's box is off by so much of the height (standard deviation).
const MEASURED: f64 = 0.05;
/// How much the speed of a person in the image wanders in a second, heights a second: starting or
/// stopping to walk (1.4 m/s, 1.7 m tall) takes two or three.
const SPEED_WANDERS: f64 = 0.5;
/// The same for width and height.
const SIZE_WANDERS: f64 = 0.3;
/// What is not known of the speed of a person who has just come, heights a second.
const FIRST_SPEED: f64 = 1.5;
/// The same for width and height.
const FIRST_SIZE_SPEED: f64 = 0.3;
/// A size that goes on to change without being seen would soon be no person's, seconds.
const SIZE_SETTLES_S: f64 = 0.5;
/// No box shrinks below this, pixels: it would have no overlap with anything.
const LEAST_SIZE: f64 = 1.0;

/// A number and how fast it changes, with their covariance.
#[derive(Debug, Clone, Copy)]
struct Axis {
    value: f64,
    rate: f64,
    value_variance: f64,
    covariance: f64,
    rate_variance: f64,
}

impl Axis {
    fn first(value: f64, measured: f64, rate_deviation: f64) -> Self {
        Self {
            value,
            rate: 0.0,
            value_variance: measured * measured,
            covariance: 0.0,
            rate_variance: rate_deviation * rate_deviation,
        }
    }

    fn predict(&mut self, dt: f64, wanders: f64) {
        let density = wanders * wanders;
        self.value += self.rate * dt;
        self.value_variance +=
            dt * (2.0 * self.covariance + dt * self.rate_variance) + density * dt * dt * dt / 3.0;
        self.covariance += dt * self.rate_variance + density * dt * dt / 2.0;
        self.rate_variance += density * dt;
    }

    fn update(&mut self, measured: f64, deviation: f64) {
        let innovation = measured - self.value;
        let total = self.value_variance + deviation * deviation;
        let (gain, rate_gain) = (self.value_variance / total, self.covariance / total);
        self.value += gain * innovation;
        self.rate += rate_gain * innovation;
        self.rate_variance -= rate_gain * self.covariance;
        self.covariance *= 1.0 - gain;
        self.value_variance *= 1.0 - gain;
    }
}

/// A box that moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoxFilter {
    x: Axis,
    y: Axis,
    width: Axis,
    height: Axis,
}

impl BoxFilter {
    pub(super) fn new(first: &BoundingBox) -> Self {
        let [x, y] = first.middle();
        let (noise, h) = (MEASURED * first.height, first.height);
        Self {
            x: Axis::first(x, noise, FIRST_SPEED * h),
            y: Axis::first(y, noise, FIRST_SPEED * h),
            width: Axis::first(first.width, noise, FIRST_SIZE_SPEED * h),
            height: Axis::first(first.height, noise, FIRST_SIZE_SPEED * h),
        }
    }

    pub(super) fn predict(&mut self, dt_s: f64) {
        let h = self.height.value;
        self.x.predict(dt_s, SPEED_WANDERS * h);
        self.y.predict(dt_s, SPEED_WANDERS * h);
        for size in [&mut self.width, &mut self.height] {
            size.rate *= (-dt_s / SIZE_SETTLES_S).exp();
            size.predict(dt_s, SIZE_WANDERS * h);
            size.value = size.value.max(LEAST_SIZE);
        }
    }

    pub(super) fn update(&mut self, measured: &BoundingBox) {
        let [x, y] = measured.middle();
        let noise = MEASURED * measured.height;
        self.x.update(x, noise);
        self.y.update(y, noise);
        self.width.update(measured.width, noise);
        self.height.update(measured.height, noise);
        self.width.value = self.width.value.max(LEAST_SIZE);
        self.height.value = self.height.value.max(LEAST_SIZE);
    }

    pub(super) fn bounding_box(&self) -> BoundingBox {
        let middle = [self.x.value, self.y.value];
        BoundingBox::around(middle, self.width.value, self.height.value)
    }

    /// How sure the middle is: standard deviation along x and y, pixels.
    pub(super) fn deviation(&self) -> [f64; 2] {
        [self.x.value_variance.sqrt(), self.y.value_variance.sqrt()]
    }

    /// Squared Mahalanobis distance of a measured middle from the predicted one; with two degrees
    /// of freedom, if the person is the same.
    pub(super) fn middle_distance(&self, measured: &BoundingBox) -> f64 {
        let [x, y] = measured.middle();
        let noise = MEASURED * measured.height;
        let part = |axis: &Axis, value: f64| {
            (value - axis.value).powi(2) / (axis.value_variance + noise * noise)
        };
        part(&self.x, x) + part(&self.y, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_walk_is_learnt_and_carried_on() {
        let at = |t: f64| BoundingBox::new(100.0 + 60.0 * t, 50.0, 40.0, 100.0);
        let mut filter = BoxFilter::new(&at(0.0));
        for k in 1..=50 {
            filter.predict(0.04);
            filter.update(&at(0.04 * f64::from(k)));
        }
        assert!((filter.x.rate - 60.0).abs() < 1.0, "{filter:?}");
        let sure = filter.deviation()[0];
        filter.predict(0.5);
        let expected = at(2.5).middle();
        assert!((filter.bounding_box().middle()[0] - expected[0]).abs() < 1.0);
        assert!(filter.deviation()[0] > 4.0 * sure);
    }

    #[test]
    fn two_half_steps_are_one_whole_step() {
        let mut once = BoxFilter::new(&BoundingBox::new(0.0, 0.0, 40.0, 100.0));
        once.predict(0.04);
        once.update(&BoundingBox::new(3.0, 1.0, 40.0, 100.0));
        let mut twice = once;
        once.predict(0.4);
        twice.predict(0.2);
        twice.predict(0.2);
        let [a, b] = [once.bounding_box(), twice.bounding_box()].map(|b| b.middle());
        assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9);
        assert!((once.deviation()[0] - twice.deviation()[0]).abs() < 1e-9);
    }
}
