//! The offset from a sensor's clock to the robot's, from when packets arrive.
//!
//! A packet can arrive late, never early: the smallest `arrival - sensor time` is the one with the
//! least delay in it, and the delays of a wire are far steadier at their minimum than on average.
//! The minimum is taken over the last few seconds, so that two crystals that drift apart are
//! followed. The same packets give the same offset, whatever the machine.

use hachi_hal::Stamp;

/// Length of one window of the minimum, on the sensor's clock, ns.
const WINDOW_NS: i64 = 1_000_000_000;
/// Windows kept. At 100 ppm of drift the minimum of 4 s is at most 0.4 ms old.
const WINDOWS: usize = 4;
/// An arrival this much earlier than possible means that the receiver's clock was set back, ns.
const STEP_NS: i64 = 500_000_000;
/// So many arrivals in a row are needed to believe that.
const STEP_ARRIVALS: u32 = 8;

/// Smallest offset seen in each of the last windows.
#[derive(Debug, Clone, Default)]
pub struct ClockMap {
    minima: [Option<i64>; WINDOWS],
    window_start_ns: i64,
    /// Added to arrivals since the receiver's clock was set back.
    correction_ns: i64,
    early: u32,
    steps: u64,
}

impl ClockMap {
    /// A map that knows nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// A packet whose last shot was at `sensor_ns` arrived at `received`.
    pub fn observe(&mut self, sensor_ns: i64, received: Stamp) {
        let difference_ns = received.as_nanos().saturating_sub(sensor_ns);
        let mut offset_ns = difference_ns.saturating_add(self.correction_ns);
        if let Some(known_ns) = self.offset_ns() {
            let early_ns = known_ns.saturating_sub(offset_ns);
            if early_ns > STEP_NS {
                self.early += 1;
                if self.early < STEP_ARRIVALS {
                    return;
                }
                // The receiver's clock was set back. Time that was given out cannot be taken back,
                // so the map stays on the clock as it was before.
                self.correction_ns = self.correction_ns.saturating_add(early_ns);
                offset_ns = known_ns;
                self.steps += 1;
            }
        }
        self.early = 0;
        let first = self.minima[0].is_none();
        let elapsed_ns = sensor_ns.saturating_sub(self.window_start_ns);
        if first || elapsed_ns < 0 {
            self.window_start_ns = sensor_ns;
        } else if elapsed_ns >= WINDOW_NS {
            self.window_start_ns = sensor_ns;
            self.minima.rotate_right(1);
            self.minima[0] = None;
        }
        let minimum = self.minima[0].map_or(offset_ns, |m| m.min(offset_ns));
        self.minima[0] = Some(minimum);
    }

    /// What to add to the sensor's time to get the robot's, ns; `None` before the first packet.
    pub fn offset_ns(&self) -> Option<i64> {
        self.minima.iter().flatten().min().copied()
    }

    /// How often the receiver's clock was set back by more than half a second.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Forgets everything: the sensor's clock began anew.
    pub fn reset(&mut self) {
        *self = Self {
            steps: self.steps,
            ..Self::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn at(ns: i64) -> Stamp {
        Stamp::from_nanos(ns)
    }

    #[test]
    fn jitter_does_not_move_the_offset() {
        let mut map = ClockMap::new();
        for n in 0..1_000 {
            let late = [3, 1, 0, 7, 2][n as usize % 5] * MS;
            map.observe(n * MS, at(5_000 * MS + n * MS + late));
        }
        assert_eq!(map.offset_ns(), Some(5_000 * MS));
    }

    #[test]
    fn drift_is_followed_within_a_few_seconds_of_it() {
        let mut map = ClockMap::new();
        // The sensor's crystal is 100 ppm slow: 0.1 ms a second.
        for n in 0..60_000_i64 {
            map.observe(n * MS, at(n * MS + n * 100));
        }
        let lag_ns = 60_000 * 100 - map.offset_ns().unwrap();
        assert!((0..=400_000 + 100).contains(&lag_ns), "{lag_ns}");
    }

    #[test]
    fn a_receiver_set_back_does_not_take_time_back() {
        let mut map = ClockMap::new();
        for n in 0..100 {
            map.observe(n * MS, at(10_000 * MS + n * MS));
        }
        for n in 100..10_000 {
            map.observe(n * MS, at(8_000 * MS + n * MS));
        }
        assert_eq!(map.offset_ns(), Some(10_000 * MS));
        assert_eq!(map.steps(), 1);
    }

    #[test]
    fn one_wrong_stamp_is_not_believed() {
        let mut map = ClockMap::new();
        for n in 0..100 {
            let received = if n == 50 { 0 } else { 10_000 * MS + n * MS };
            map.observe(n * MS, at(received));
        }
        assert_eq!(map.offset_ns(), Some(10_000 * MS));
        assert_eq!(map.steps(), 0);
    }
}
