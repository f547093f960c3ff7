//! When which foot stands, and the path of one that does not.

use hachi_hal::Vector3;

/// A periodic gait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footfall {
    /// Seconds from one touch of a foot to its next.
    pub period_s: f64,
    /// Share of the period in which a foot stands, at least a half.
    pub duty: f64,
    /// When each foot touches, as a share of the period.
    pub touches: [f64; 4],
    /// How high feet are lifted, metres.
    pub lift_m: f64,
}

impl Footfall {
    /// A trot: diagonal feet together, twice a second, a tenth of the time on all four.
    pub const fn trot() -> Self {
        Self {
            period_s: 0.5,
            duty: 0.55,
            touches: [0.0, 0.5, 0.5, 0.0],
            lift_m: 0.07,
        }
    }

    /// A trot in which one pair lifts the moment the other touches: never on more than two feet.
    pub const fn bare_trot() -> Self {
        Self {
            duty: 0.5,
            ..Self::trot()
        }
    }

    /// A walk: one foot at a time.
    pub const fn walk() -> Self {
        Self {
            period_s: 1.0,
            duty: 0.8,
            touches: [0.0, 0.5, 0.25, 0.75],
            lift_m: 0.06,
        }
    }

    /// Where in its cycle a foot is, 0 to 1: it touches at 0 and lifts at [`Self::duty`].
    pub(super) fn phase(&self, leg: usize, time_s: f64) -> f64 {
        (time_s / self.period_s - self.touches[leg]).rem_euclid(1.0)
    }
}

/// How feet are made to slip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipConfig {
    /// Share of steps in which the foot slips.
    pub share: f64,
    /// Least and most speed over the ground, m/s.
    pub speed: [f64; 2],
    /// Least and most time that it lasts, seconds.
    pub lasts_s: [f64; 2],
}

impl SlipConfig {
    /// Never.
    pub const NONE: Self = Self {
        share: 0.0,
        speed: [0.0; 2],
        lasts_s: [0.0; 2],
    };
}

/// One slip: when, and how fast over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slip {
    pub from_s: f64,
    pub to_s: f64,
    pub velocity: Vector3,
}

impl Slip {
    /// The velocity at a moment: sets in and ends within a few milliseconds.
    pub fn at(&self, time_s: f64) -> Vector3 {
        const EDGE_S: f64 = 0.005;
        let edge = (time_s - self.from_s).min(self.to_s - time_s) / EDGE_S;
        self.velocity * edge.clamp(0.0, 1.0)
    }
}

/// A foot on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Swing {
    pub from: Vector3,
    pub to: Vector3,
    pub begins_s: f64,
    pub ends_s: f64,
    pub lift_m: f64,
}

impl Swing {
    /// Centre of the foot and its velocity. Starts and ends at rest, without a jerk.
    pub fn at(&self, time_s: f64) -> (Vector3, Vector3) {
        let lasts = self.ends_s - self.begins_s;
        let s = ((time_s - self.begins_s) / lasts).clamp(0.0, 1.0);
        let r = 1.0 - s;
        let way = self.to - self.from;
        let place = self.from
            + way * (s * s * s * (10.0 + s * (6.0 * s - 15.0)))
            + Vector3::z() * (self.lift_m * 64.0 * (s * r).powi(3));
        let velocity = way * (30.0 * (s * r).powi(2))
            + Vector3::z() * (self.lift_m * 192.0 * (s * r).powi(2) * (1.0 - 2.0 * s));
        (place, velocity / lasts)
    }
}

/// How much of its load a foot carries `since_s` after it touched and `until_s` before it lifts:
/// it takes over and hands on within a tenth of a step.
pub(super) fn load_share(since_s: f64, until_s: f64, stance_s: f64) -> f64 {
    crate::smooth::step(since_s.min(until_s) / (0.1 * stance_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trot_has_two_or_four_feet_on_the_ground() {
        let trot = Footfall::trot();
        for i in 0..500 {
            let time = f64::from(i) * 1e-3;
            let standing = (0..4).filter(|&leg| trot.phase(leg, time) < trot.duty);
            assert!(matches!(standing.count(), 2 | 4));
        }
    }

    #[test]
    fn a_swing_leaves_and_lands_at_rest_and_its_velocity_is_the_derivative() {
        let swing = Swing {
            from: Vector3::new(0.0, 0.1, 0.02),
            to: Vector3::new(0.3, 0.12, 0.05),
            begins_s: 2.0,
            ends_s: 2.2,
            lift_m: 0.08,
        };
        assert_eq!(swing.at(2.0), (swing.from, Vector3::zeros()));
        assert_eq!(swing.at(2.2).1, Vector3::zeros());
        assert!((swing.at(2.2).0 - swing.to).norm() < 1e-12);
        for time in [2.03, 2.1, 2.17] {
            let numeric = (swing.at(time + 1e-6).0 - swing.at(time - 1e-6).0) / 2e-6;
            assert!((numeric - swing.at(time).1).norm() < 1e-6);
        }
        assert!((swing.at(2.1).0.z - (0.035 + 0.08)).abs() < 1e-12);
    }
}
