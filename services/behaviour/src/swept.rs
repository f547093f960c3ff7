//! Where the robot would come to while it reacts and brakes, and what it would come too near to.
//!
//! In: obstacles and a velocity, footprint frame. Out: how much of the velocity leaves room to stop.
//! The robot is a rectangle that goes on at its velocity for the reaction time and then brakes to
//! rest along the same arc.

use hachi_hal::BodyVelocity;

use crate::config::SafetyConfig;
use crate::obstacles::Obstacles;

/// Shares of the velocity that are tried, the largest first.
const SHARES: [f64; 6] = [1.0, 0.8, 0.6, 0.4, 0.2, 0.0];

/// Between two looked-at moments, s: 4 cm at 0.8 m/s.
const STEP_S: f64 = 0.05;
/// The longest way that is looked at, in steps: 4 s. Settings with which the robot needs longer to
/// stop are refused ([`SafetyConfig::check`]); a way that is not seen to its end is not free.
const STEPS: usize = 80;
/// The same in seconds, for whoever checks settings: less a step of rounding.
pub(crate) const LONGEST_STOP_S: f64 = (STEPS - 1) as f64 * STEP_S;

/// A thing that is too near already may not come nearer by more than this, m: rounding.
const ROUNDING_M: f64 = 1e-6;

/// How much of a velocity (0 to 1) leaves room to stop before every obstacle.
pub fn free_share(velocity: &BodyVelocity, obstacles: &Obstacles, config: &SafetyConfig) -> f64 {
    let free = |share: f64| is_free(&scaled(velocity, share), obstacles, config);
    SHARES.into_iter().find(|share| free(*share)).unwrap_or(0.0)
}

/// Every component of a velocity, times `share`.
pub fn scaled(velocity: &BodyVelocity, share: f64) -> BodyVelocity {
    BodyVelocity {
        forward: velocity.forward * share,
        left: velocity.left * share,
        yaw_rate: velocity.yaw_rate * share,
    }
}

fn is_free(velocity: &BodyVelocity, obstacles: &Obstacles, config: &SafetyConfig) -> bool {
    if velocity.is_zero() {
        return true;
    }
    let brakes_s = (velocity.forward.hypot(velocity.left) / config.braking_m_per_s2)
        .max(velocity.yaw_rate.abs() / config.turn_acceleration_rad_per_s2);
    let mut pose = [0.0f64; 3];
    let mut time_s = 0.0;
    for _ in 0..STEPS {
        if time_s > config.reaction_s + brakes_s {
            return true;
        }
        let speed = match time_s < config.reaction_s {
            true => 1.0,
            false => 1.0 - (time_s - config.reaction_s) / brakes_s,
        };
        let (sin, cos) = pose[2].sin_cos();
        let way = speed * STEP_S;
        pose[0] += (velocity.forward * cos - velocity.left * sin) * way;
        pose[1] += (velocity.forward * sin + velocity.left * cos) * way;
        pose[2] += velocity.yaw_rate * way;
        time_s += STEP_S;
        if obstacles
            .places()
            .iter()
            .any(|at| too_near(at, &pose, config))
        {
            return false;
        }
    }
    false
}

/// Whether the rectangle at `pose` is too near to a thing: nearer than the margin, or than it is
/// now where that is less. So a robot that stands too near can always go away.
fn too_near(place: &[f32; 2], pose: &[f64; 3], config: &SafetyConfig) -> bool {
    let place = place.map(f64::from);
    let now = distance(place, config);
    let (sin, cos) = pose[2].sin_cos();
    let off = [place[0] - pose[0], place[1] - pose[1]];
    let then = distance(
        [off[0] * cos + off[1] * sin, off[1] * cos - off[0] * sin],
        config,
    );
    then < config.margin_m.min(now - ROUNDING_M)
}

/// From a place to the rectangle, m; negative inside.
fn distance(place: [f64; 2], config: &SafetyConfig) -> f64 {
    let x = place[0].abs() - config.half_length_m;
    let y = place[1].abs() - config.half_width_m;
    x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::Stamp;

    fn around(places: &[[f32; 2]]) -> Obstacles {
        let mut obstacles = Obstacles::none(Stamp::default());
        for place in places {
            assert!(obstacles.add(*place));
        }
        obstacles
    }

    fn forward(speed: f64) -> BodyVelocity {
        BodyVelocity {
            forward: speed,
            ..BodyVelocity::ZERO
        }
    }

    #[test]
    fn it_stops_before_what_stands_ahead_and_passes_what_stands_beside() {
        let config = SafetyConfig::default();
        let share = |x: f32, y: f32| free_share(&forward(0.8), &around(&[[x, y]]), &config);
        // Reaction and braking take 0.8 x 0.25 + 0.8² / 3.2 = 0.4 m, and 0.15 m are kept.
        assert_eq!(share(0.65 + 0.15 + 0.47, 0.0), 1.0);
        assert!(share(0.65 + 0.15 + 0.35, 0.0) < 1.0);
        assert_eq!(share(0.65 + 0.10, 0.0), 0.0);
        assert_eq!(share(0.75, 0.5), 1.0, "a wall at 18 cm beside");
        assert!(share(0.75, 0.4) < 1.0, "a wall at 8 cm beside the way");
        assert_eq!(share(-0.7, 0.0), 1.0, "what is behind");
    }

    #[test]
    fn a_robot_that_stands_too_near_may_only_go_away() {
        let config = SafetyConfig::default();
        let wall = around(&[[0.70, 0.0]]);
        assert_eq!(free_share(&forward(0.3), &wall, &config), 0.0);
        assert_eq!(free_share(&forward(-0.3), &wall, &config), 1.0);
    }

    #[test]
    fn a_turn_that_would_sweep_over_something_is_not_made() {
        let config = SafetyConfig::default();
        let turn = |yaw_rate| BodyVelocity {
            yaw_rate,
            ..BodyVelocity::ZERO
        };
        // Beside the front left corner: turning left swings over it, turning right does not.
        let post = around(&[[0.62, 0.50]]);
        assert!(free_share(&turn(0.7), &post, &config) < 1.0);
        assert_eq!(free_share(&turn(-0.7), &post, &config), 1.0);
    }

    #[test]
    fn distance_to_a_rectangle() {
        let config = SafetyConfig {
            half_length_m: 2.0,
            half_width_m: 1.0,
            ..SafetyConfig::default()
        };
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(distance([5.0, 0.0], &config), 3.0);
        close(distance([5.0, 5.0], &config), 5.0);
        close(distance([0.0, -1.5], &config), 0.5);
        close(distance([1.9, 0.0], &config), -0.1);
    }
}
