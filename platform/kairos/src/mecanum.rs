//! Four mecanum wheels with their rollers set as an X seen from above.
//!
//! With `L` half the wheelbase plus half the track and `r` the radius, wheels front left, front
//! right, rear left, rear right turn at `(vx - vy - L w) / r`, `(vx + vy + L w) / r`,
//! `(vx + vy - L w) / r`, `(vx - vy + L w) / r`. Four wheels say three things; what is left over,
//! `FL + FR - RL - RR`, is zero unless a wheel slips.

use hachi_hal::BodyVelocity;

/// Index of a wheel in every array of four: front left, front right, rear left, rear right.
pub const WHEEL_NAMES: [&str; 4] = ["FL", "FR", "RL", "RR"];

/// Dimensions of the wheels, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mecanum {
    /// Radius of a wheel.
    pub radius_m: f64,
    /// From the middle to the axles.
    pub half_wheelbase_m: f64,
    /// From the middle to the wheels' planes.
    pub half_track_m: f64,
}

/// What may be asked of the base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelLimits {
    /// Along the floor in any direction, m/s.
    pub speed: f64,
    /// Turning, rad/s.
    pub yaw_rate: f64,
    /// Rim of the fastest wheel, m/s.
    pub rim_speed: f64,
}

impl Mecanum {
    fn lever(&self) -> f64 {
        self.half_wheelbase_m + self.half_track_m
    }

    /// Speeds of the wheels for a velocity, rad/s.
    pub fn wheel_speeds(&self, velocity: &BodyVelocity) -> [f64; 4] {
        let turn = self.lever() * velocity.yaw_rate;
        let (x, y) = (velocity.forward, velocity.left);
        [x - y - turn, x + y + turn, x + y - turn, x - y + turn].map(|v| v / self.radius_m)
    }

    /// The velocity that the wheels' speeds (rad/s) fit best.
    pub fn velocity(&self, wheels: &[f64; 4]) -> BodyVelocity {
        let [fl, fr, rl, rr] = wheels.map(|w| w * self.radius_m / 4.0);
        BodyVelocity {
            forward: fl + fr + rl + rr,
            left: -fl + fr + rl - rr,
            yaw_rate: (-fl + fr - rl + rr) / self.lever(),
        }
    }

    /// By how much the wheels contradict each other, m/s at the rim: zero unless one slips.
    pub fn contradiction(&self, wheels: &[f64; 4]) -> f64 {
        let [fl, fr, rl, rr] = wheels.map(|w| w * self.radius_m / 4.0);
        fl + fr - rl - rr
    }

    /// The nearest velocity that the limits allow and that goes the same way, and whether it is
    /// another than `asked`. Not-a-number becomes standing still.
    pub fn limited(&self, limits: &WheelLimits, asked: &BodyVelocity) -> (BodyVelocity, bool) {
        if !asked.is_finite() {
            return (BodyVelocity::ZERO, true);
        }
        let along = libm::hypot(asked.forward, asked.left);
        let rim = self
            .wheel_speeds(asked)
            .into_iter()
            .fold(0.0, |most: f64, w| most.max((w * self.radius_m).abs()));
        let ratio = |value: f64, limit: f64| if value > limit { limit / value } else { 1.0 };
        let scale = ratio(along, limits.speed)
            .min(ratio(asked.yaw_rate.abs(), limits.yaw_rate))
            .min(ratio(rim, limits.rim_speed));
        let granted = BodyVelocity {
            forward: asked.forward * scale,
            left: asked.left * scale,
            yaw_rate: asked.yaw_rate * scale,
        };
        (granted, scale < 1.0)
    }
}
