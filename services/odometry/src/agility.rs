//! How lively the robot really is: which accelerations are ordinary, learnt from its own way.
//!
//! In: the motion over each scan that fits. Out: [`Agility`] for the next one, at most that of the
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

/// Mean speeds over one scan, sensor frame.
#[derive(Debug, Clone, Copy)]
struct Speed {
    turn_rad_per_s: Vector3,
    shift_m_per_s: Vector3,
}

/// What is known of the robot's accelerations.
#[derive(Debug, Clone, Default)]
pub(crate) struct LearntAgility {
    last: Option<Speed>,
    /// Mean squares of the axis that is moved most, (rad/s²)² and (m/s²)², once known.
    squares: Option<[f64; 2]>,
    seen_s: f64,
}

impl LearntAgility {
    /// Learns from a scan over which the sensor moved by `motion` within `span_s`.
    pub(crate) fn learn(&mut self, motion: &Pose, span_s: f64) {
        let now = Speed {
            turn_rad_per_s: motion.rotation.scaled_axis() / span_s,
            shift_m_per_s: motion.translation.vector / span_s,
        };
        let Some(last) = self.last.replace(now) else {
            return;
        };
        let turn = (now.turn_rad_per_s - last.turn_rad_per_s) / span_s;
        let shift = (now.shift_m_per_s - last.shift_m_per_s) / span_s;
        let found = [turn, shift].map(|acceleration| acceleration.amax().powi(2));
        self.seen_s += span_s;
        let rate = span_s / self.seen_s.min(MEMORY_S);
        let squares = self.squares.get_or_insert(found);
        for (square, found) in squares.iter_mut().zip(found) {
            *square += rate.min(1.0) * (found - *square);
            // A start is believed at once: half the square of a sine's peak is its mean square.
            *square = square.max(0.5 * found);
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

    /// Scans of a tenth of a second of a sensor that goes ahead and nods: radians, hertz.
    fn nods(agility: &mut LearntAgility, seconds: f64, amplitude: f64, frequency_hz: f64) {
        let pitch = |time_s: f64| {
            let angle = amplitude * (std::f64::consts::TAU * frequency_hz * time_s).sin();
            Rotation::from_euler_angles(0.0, angle, 0.0)
        };
        for scan in 0..(10.0 * seconds) as u32 {
            let from = f64::from(scan) * 0.1;
            let turn = pitch(from).inverse() * pitch(from + 0.1);
            let motion = Pose::from_parts(Vector3::new(0.2, 0.0, 0.0).into(), turn);
            agility.learn(&motion, 0.1);
        }
    }

    #[test]
    fn what_is_ordinary_follows_from_the_way_it_goes_and_is_at_most_what_was_set() {
        let most = Agility::default();
        let mut agility = LearntAgility::default();
        nods(&mut agility, 0.9, 0.0, 1.0);
        assert_eq!(agility.agility(&most, 4), most, "too early to say");
        nods(&mut agility, 2.0, 0.0, 1.0);
        let calm = agility.agility(&most, 4);
        assert_eq!((calm.angular_acceleration, calm.acceleration), (0.5, 0.5));
        // Half a degree at 1.3 Hz: 0.58 rad/s² at most, the root of its mean square is 0.41; between
        // scans of a tenth of a second a little less is seen of it.
        nods(&mut agility, 10.0, 0.5_f64.to_radians(), 1.3);
        let wheels = agility.agility(&most, 4).angular_acceleration;
        assert!((1.3..2.0).contains(&wheels), "{wheels}");
        let one_interval = agility.agility(&most, 1).angular_acceleration;
        assert!((one_interval - 0.5 * wheels).abs() < 1e-9);
        // A trot begins: two steps later it is believed.
        nods(&mut agility, 0.5, 2.0_f64.to_radians(), 2.0);
        assert_eq!(agility.agility(&most, 4).angular_acceleration, 8.0);
        agility.forget();
        assert_eq!(agility.agility(&most, 4), most);
    }
}
