//! How lively the robot really is: which accelerations are ordinary, learnt from its own way.
//!
//! In: where the sensor was in the middle of each scan that fits. Out: [`Agility`] for the next one, at most that of the
//! settings. Between the few points that a moment of a scan sees, the bound on acceleration alone
//! says how the sensor turned: one made for a trot lets a robot on wheels tilt by a degree where
//! nothing is seen that would hold it, and such tilts add up to metres of height.

use hachi_hal::{Pose, Vector3};
use hachi_registration::Agility;

/// How long what was seen counts, seconds: some steps of a gait, some paving stones.
const MEMORY_S: f64 = 3.0;
/// Before this nothing is known, seconds.
const FIRST_S: f64 = 1.0;
/// What is believed is so many times what was seen: scans average over the quickest motions. Three
/// leave a robot on wheels twice the error on a simulated campus, one and a half mislead where a hand
/// shakes the sensor.
const MARGIN: f64 = 2.0;
/// Nothing that moves is calmer: rad/s² and m/s².
const CALMEST: f64 = 0.5;

/// Mean speeds from the middle of one scan to the middle of the next, sensor frame.
#[derive(Debug, Clone, Copy)]
struct Speed {
    turn_rad_per_s: Vector3,
    shift_m_per_s: Vector3,
}

/// What is known of the robot's accelerations.
#[derive(Debug, Clone, Default)]
pub(crate) struct LearntAgility {
    /// The sensor in the middle of the last scan. What is seen before and after holds it; the end of a
    /// scan is held by one side alone.
    middle: Option<Pose>,
    speed: Option<Speed>,
    /// Squares of the last scan's accelerations, and mean squares; of the axis that is moved most,
    /// (rad/s²)² and (m/s²)².
    last: [f64; 2],
    squares: Option<[f64; 2]>,
    seen_s: f64,
}

impl LearntAgility {
    /// Learns from a scan in whose middle the sensor was at `middle`, `span_s` after the last one's.
    pub(crate) fn learn(&mut self, middle: Pose, span_s: f64) {
        let Some(before) = self.middle.replace(middle) else {
            return;
        };
        let motion = before.inv_mul(&middle);
        let now = Speed {
            turn_rad_per_s: motion.rotation.scaled_axis() / span_s,
            shift_m_per_s: motion.translation.vector / span_s,
        };
        let Some(speed) = self.speed.replace(now) else {
            return;
        };
        let turn = (now.turn_rad_per_s - speed.turn_rad_per_s) / span_s;
        let shift = (now.shift_m_per_s - speed.shift_m_per_s) / span_s;
        let found = [turn, shift].map(|acceleration| acceleration.amax().powi(2));
        self.seen_s += span_s;
        let rate = (span_s / self.seen_s.min(MEMORY_S)).min(1.0);
        let squares = self.squares.get_or_insert(found);
        for i in 0..2 {
            squares[i] += rate * (found[i] - squares[i]);
            // Two scans in a row are a start and believed at once, one alone is a stray: half the
            // square of a sine's peak is its mean square.
            squares[i] = squares[i].max(0.5 * found[i].min(self.last[i]));
        }
        self.last = found;
    }

    /// Moves with the map's origin.
    pub(crate) fn translate(&mut self, by: &Vector3) {
        if let Some(middle) = &mut self.middle {
            middle.translation.vector += by;
        }
    }

    /// Something happened that nobody expected: what was learnt does not hold.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// What is ordinary, for scans cut into so many intervals, each of which may change the speed
    /// on its own account.
    pub(crate) fn agility(&self, most: &Agility, intervals: usize) -> Agility {
        let Some(squares) = self.squares.filter(|_| self.seen_s > FIRST_S) else {
            return *most;
        };
        let [turn, shift] =
            squares.map(|square| (MARGIN * (intervals as f64 * square).sqrt()).max(CALMEST));
        Agility {
            acceleration: shift.min(most.acceleration),
            angular_acceleration: turn.min(most.angular_acceleration),
            ..*most
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::Rotation;

    /// A sensor that goes ahead at 2 m/s and nods, a scan every tenth of a second.
    #[derive(Default)]
    struct Nodder {
        agility: LearntAgility,
        time_s: f64,
    }

    impl Nodder {
        /// Nods by so many radians, so often a second.
        fn nods(&mut self, seconds: f64, amplitude: f64, frequency_hz: f64) {
            for _ in 0..(10.0 * seconds) as u32 {
                self.time_s += 0.1;
                let angle = amplitude * (std::f64::consts::TAU * frequency_hz * self.time_s).sin();
                let place = Vector3::new(2.0 * self.time_s, 0.0, 0.0);
                let turn = Rotation::from_euler_angles(0.0, angle, 0.0);
                self.agility
                    .learn(Pose::from_parts(place.into(), turn), 0.1);
            }
        }

        fn ordinary(&self, intervals: usize) -> Agility {
            self.agility.agility(&Agility::default(), intervals)
        }
    }

    #[test]
    fn what_is_ordinary_follows_from_the_way_it_goes_and_is_at_most_what_was_set() {
        let most = Agility::default();
        let mut sensor = Nodder::default();
        sensor.nods(0.9, 0.0, 1.0);
        assert_eq!(sensor.ordinary(4), most, "too early to say");
        sensor.nods(2.0, 0.0, 1.0);
        let calm = sensor.ordinary(4);
        assert_eq!((calm.angular_acceleration, calm.acceleration), (0.5, 0.5));
        // Half a degree at 1.3 Hz is 0.58 rad/s² at most, 0.41 in the root of its mean square; between
        // scans of a tenth of a second a little less is seen of it.
        sensor.nods(10.0, 0.5_f64.to_radians(), 1.3);
        let wheels = sensor.ordinary(4).angular_acceleration;
        assert!((1.3..1.7).contains(&wheels), "{wheels}");
        let one_interval = sensor.ordinary(1).angular_acceleration;
        assert!((one_interval - 0.5 * wheels).abs() < 1e-9);
        // A trot begins: two steps later it is believed.
        sensor.nods(0.5, 2.0_f64.to_radians(), 2.0);
        assert_eq!(sensor.ordinary(4).angular_acceleration, 8.0);
        sensor.agility.forget();
        assert_eq!(sensor.ordinary(4), most);
    }
}
