//! Motions measured by something other than the LiDAR, cut to the intervals of a scan.
//!
//! In: gyroscope samples or external odometry around the scan, the moments of its knots. Out: one
//! [`Increment`] for each interval, in the LiDAR's frame; none if the samples do not span it.

use hachi_hal::{ImuSample, OdometrySample, Pose, Rotation, Stamp, Vector3};
use hachi_registration::Increment;

use crate::config::OdometryConfig;

/// A gap in the samples longer than this is not bridged.
const MOST_GAP_NS: i64 = 50_000_000;

/// The last sample's rate is taken to hold for this long: the next one may still be on its way when a
/// scan is placed, as it is from a gyroscope that measures a hundred times a second.
const MOST_HELD_NS: i64 = 10_000_000;

/// And the speed of external odometry for this long: a Go1's legs say something new fifty times a
/// second.
const MOST_CARRIED_NS: i64 = 25_000_000;

/// Smallest error an increment is believed to have, metres and radians.
const LEAST_SIGMA: f64 = 1e-3;

/// Gyroscope zero offset, learnt from what registration found instead.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GyroBias {
    rad_per_s: Vector3,
}

impl GyroBias {
    /// Moves the estimate by what the gyroscope said too much over `span_s` seconds.
    pub fn learn(&mut self, integrated: &Rotation, registered: &Rotation, span_s: f64) {
        // Time constant of a hundred scans: a bias drifts over minutes.
        const RATE: f64 = 0.01;
        let excess = (registered.inverse() * integrated).scaled_axis() / span_s.max(1e-3);
        // A misplaced scan must not tip the estimate.
        if excess.norm() < 0.5 {
            self.rad_per_s += excess * RATE;
        }
    }
}

/// Increments over the intervals between `knots` from a gyroscope. Turns only.
pub fn from_gyroscope(
    samples: &[ImuSample],
    knots: impl Fn(usize) -> Stamp,
    intervals: usize,
    bias: &GyroBias,
    config: &OdometryConfig,
    out: &mut Vec<Increment>,
) {
    out.clear();
    for i in 0..intervals {
        let (from, to) = (knots(i), knots(i + 1));
        let Some(turn) = integrate(samples, from, to, bias, &config.lidar_from_imu) else {
            out.clear();
            return;
        };
        let sigma = config.gyro_noise_rad_per_s * to.secs_since(from);
        out.push(Increment {
            motion: Pose::from_parts(Vector3::zeros().into(), turn),
            turn_sigma_rad: sigma.max(LEAST_SIGMA),
            shift_sigma_m: f64::INFINITY,
        });
    }
}

/// The turn from `from` to `to` by the trapezoid rule; `None` if samples are missing.
fn integrate(
    samples: &[ImuSample],
    from: Stamp,
    to: Stamp,
    bias: &GyroBias,
    lidar_from_imu: &Rotation,
) -> Option<Rotation> {
    let mut turn = Rotation::identity();
    let mut at = from;
    let first = samples
        .partition_point(|s| s.stamp <= from)
        .checked_sub(1)?;
    for pair in samples[first..].windows(2) {
        if at >= to {
            break;
        }
        let gap = pair[1].stamp - pair[0].stamp;
        if gap <= 0 || gap > MOST_GAP_NS {
            return None;
        }
        let end = pair[1].stamp.min(to);
        let middle = (at - pair[0].stamp + (end - at) / 2) as f64 / gap as f64;
        let rate = pair[0]
            .angular_velocity
            .lerp(&pair[1].angular_velocity, middle);
        let step = (lidar_from_imu * (rate - bias.rad_per_s)) * end.secs_since(at);
        turn *= Rotation::from_scaled_axis(step);
        at = end;
    }
    if at < to {
        let last = samples.last().filter(|s| to - s.stamp <= MOST_HELD_NS)?;
        let rate = lidar_from_imu * (last.angular_velocity - bias.rad_per_s);
        turn *= Rotation::from_scaled_axis(rate * to.secs_since(at));
    }
    turn.coords.iter().all(|v| v.is_finite()).then_some(turn)
}

/// Increments over the intervals between `knots` from external odometry.
pub fn from_odometry(
    samples: &[OdometrySample],
    knots: impl Fn(usize) -> Stamp,
    intervals: usize,
    config: &OdometryConfig,
    out: &mut Vec<Increment>,
) {
    out.clear();
    let lidar_at = |i: usize| pose_at(samples, knots(i)).map(|p| p * config.base_from_lidar);
    for i in 0..intervals {
        let (Some(from), Some(to)) = (lidar_at(i), lidar_at(i + 1)) else {
            out.clear();
            return;
        };
        let motion = from.inv_mul(&to);
        let share = config.odometry_error_share;
        out.push(Increment {
            motion,
            turn_sigma_rad: (share * motion.rotation.angle()).max(LEAST_SIGMA),
            shift_sigma_m: (share * motion.translation.vector.norm()).max(LEAST_SIGMA),
        });
    }
}

/// The pose at a moment: between two samples, or shortly after the last one at the speed it had.
fn pose_at(samples: &[OdometrySample], at: Stamp) -> Option<Pose> {
    let after = samples.partition_point(|s| s.stamp < at);
    let Some(next) = samples.get(after) else {
        return carried_on(samples, at);
    };
    if next.stamp == at {
        return Some(next.odom_from_base);
    }
    let before = samples.get(after.checked_sub(1)?)?;
    between(before, next, at)
}

/// The pose shortly after the last sample, which is the newest there is while a scan is placed.
fn carried_on(samples: &[OdometrySample], at: Stamp) -> Option<Pose> {
    let last = samples.last().filter(|s| at - s.stamp <= MOST_CARRIED_NS)?;
    // Over as long a time as the pose is carried at most: samples 2 ms apart tell no speed.
    let early = samples.partition_point(|s| last.stamp - s.stamp > MOST_CARRIED_NS);
    let before = samples.get(early.checked_sub(1)?)?;
    between(before, last, at)
}

/// On the straight way through two samples, or beyond the later one.
fn between(before: &OdometrySample, next: &OdometrySample, at: Stamp) -> Option<Pose> {
    let gap = next.stamp - before.stamp;
    if gap > MOST_GAP_NS {
        return None;
    }
    let share = (at - before.stamp) as f64 / gap as f64;
    before
        .odom_from_base
        .try_lerp_slerp(&next.odom_from_base, share, 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knot(i: usize) -> Stamp {
        Stamp::from_nanos(1_000_000_000 + 25_000_000 * i as i64)
    }

    #[test]
    fn a_constant_turn_is_integrated_exactly_and_its_bias_taken_off() {
        let samples: Vec<_> = (0..60)
            .map(|i| ImuSample {
                stamp: Stamp::from_nanos(990_000_000 + 3_000_000 * i),
                angular_velocity: Vector3::new(0.1, 0.0, 1.1),
                specific_force: Vector3::zeros(),
            })
            .collect();
        let bias = GyroBias {
            rad_per_s: Vector3::new(0.1, 0.0, 0.1),
        };
        let mut out = Vec::new();
        let config = OdometryConfig::default();
        from_gyroscope(&samples, knot, 4, &bias, &config, &mut out);
        assert_eq!(out.len(), 4);
        for increment in &out {
            let turn = increment.motion.rotation.scaled_axis();
            assert!(
                (turn - Vector3::new(0.0, 0.0, 0.025)).norm() < 1e-9,
                "{turn}"
            );
        }
        from_gyroscope(&samples[..10], knot, 4, &bias, &config, &mut out);
        assert!(
            out.is_empty(),
            "samples that end early must not be stretched"
        );
        // The last is 8 ms old at the end of the scan, then 11.
        from_gyroscope(&samples[..35], knot, 4, &bias, &config, &mut out);
        assert_eq!(out.len(), 4);
        let turn = out[3].motion.rotation.scaled_axis();
        assert!(
            (turn - Vector3::new(0.0, 0.0, 0.025)).norm() < 1e-9,
            "{turn}"
        );
        from_gyroscope(&samples[..34], knot, 4, &bias, &config, &mut out);
        assert!(out.is_empty());
    }

    #[test]
    fn a_bias_is_learnt_from_what_registration_found() {
        let mut bias = GyroBias::default();
        let said = Rotation::from_scaled_axis(Vector3::new(0.0, 0.0, 0.012));
        for _ in 0..1000 {
            let integrated = said * Rotation::from_scaled_axis(-bias.rad_per_s * 0.1);
            bias.learn(
                &integrated,
                &Rotation::from_scaled_axis(Vector3::new(0.0, 0.0, 0.01)),
                0.1,
            );
        }
        assert!((bias.rad_per_s.z - 0.02).abs() < 1e-3, "{bias:?}");
    }

    #[test]
    fn odometry_that_ends_just_before_the_scan_is_carried_on_at_its_speed() {
        // 500 a second, 2 m/s along x; the scan ends at 1.1 s.
        let samples = |last_ms: i64| -> Vec<_> {
            (940..=last_ms)
                .step_by(2)
                .map(|ms| OdometrySample {
                    stamp: Stamp::from_nanos(ms * 1_000_000),
                    odom_from_base: Pose::translation(2e-3 * ms as f64, 0.0, 0.0),
                })
                .collect()
        };
        let config = OdometryConfig::default();
        let mut out = Vec::new();
        for last_ms in [1100, 1098, 1080] {
            from_odometry(&samples(last_ms), knot, 4, &config, &mut out);
            assert_eq!(out.len(), 4, "the last sample at {last_ms} ms");
            for increment in &out {
                let shift = increment.motion.translation.vector;
                assert!((shift - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-9);
            }
        }
        from_odometry(&samples(1072), knot, 4, &config, &mut out);
        assert!(out.is_empty(), "28 ms are not carried");
        from_odometry(&samples(1098)[79..], knot, 4, &config, &mut out);
        assert!(out.is_empty(), "one sample has no speed");
    }

    #[test]
    fn odometry_between_two_samples_is_blended_and_moved_to_the_lidar() {
        let sample = |nanos: i64, x: f64| OdometrySample {
            stamp: Stamp::from_nanos(nanos),
            odom_from_base: Pose::translation(x, 0.0, 0.0),
        };
        let samples = [
            sample(990_000_000, 0.0),
            sample(1_030_000_000, 0.4),
            sample(1_060_000_000, 0.7),
        ];
        let mut out = Vec::new();
        let turned = Rotation::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let config = OdometryConfig {
            base_from_lidar: Pose::from_parts(Vector3::zeros().into(), turned),
            ..OdometryConfig::default()
        };
        from_odometry(&samples, knot, 2, &config, &mut out);
        assert_eq!(out.len(), 2);
        for increment in &out {
            // 10 m/s forward is rightward for a LiDAR that looks left.
            let shift = increment.motion.translation.vector;
            assert!(
                (shift - Vector3::new(0.0, -0.25, 0.0)).norm() < 1e-9,
                "{shift}"
            );
        }
    }
}
