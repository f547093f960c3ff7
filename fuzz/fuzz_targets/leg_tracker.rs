//! Legs and bodies of any numbers, also impossible ones: refused, or estimates that are finite.
#![no_main]

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::{AttitudeSample, ImuSample, LegState, Rotation, Stamp, Vector3};
use hachi_unitree::{BodySample, LegTracker};
use libfuzzer_sys::fuzz_target;

/// Numbers from bytes: mostly of the size of joints, sometimes anything.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn next(&mut self) -> f64 {
        match self.byte() {
            255 => {
                let mut bytes = [0; 8];
                bytes.iter_mut().for_each(|b| *b = self.byte());
                f64::from_le_bytes(bytes)
            }
            other => (f64::from(other) - 127.0) / 32.0,
        }
    }

    fn vector(&mut self) -> Vector3 {
        Vector3::new(self.next(), self.next(), self.next())
    }
}

fuzz_target!(|data: &[u8]| {
    let mut numbers = Numbers(data);
    let robot = if numbers.byte() & 1 == 0 { GO1 } else { B1 };
    let mut tracker = LegTracker::new(&robot);
    let mut stamp = Stamp::from_nanos(0);
    while !numbers.0.is_empty() {
        stamp = stamp + (i64::from(numbers.byte()) - 8) * 500_000;
        let sample = BodySample {
            legs: LegState {
                stamp,
                angles: [0; 4].map(|_| numbers.vector()),
                speeds: [0; 4].map(|_| numbers.vector()),
                torques: [0; 4].map(|_| numbers.vector() * 10.0),
                foot_forces: [0; 4].map(|_| numbers.next() * 50.0),
            },
            imu: ImuSample {
                stamp,
                angular_velocity: numbers.vector(),
                specific_force: numbers.vector() * 4.0,
            },
            attitude: AttitudeSample {
                stamp,
                level_from_base: Rotation::from_scaled_axis(numbers.vector()),
            },
        };
        // Beyond what any robot's frame can carry nothing is promised but that it does not panic.
        let ordinary = sample
            .legs
            .angles
            .iter()
            .chain(&sample.legs.speeds)
            .all(|v| v.amax() < 1e3)
            && sample.legs.torques.iter().all(|v| v.amax() < 1e4)
            && sample.imu.specific_force.amax() < 1e4
            && sample.imu.angular_velocity.amax() < 1e3;
        let Ok(estimate) = tracker.step(&sample) else {
            continue;
        };
        if !ordinary {
            return;
        }
        assert!(estimate.motion.velocity.iter().all(|v| v.is_finite()));
        let place = estimate.motion.sample.odom_from_base.translation.vector;
        assert!(place.iter().all(|v| v.is_finite()));
        if let Some(footprint) = estimate.footprint {
            assert!(footprint.height_m().is_finite());
            assert!((footprint.normal_in_base().norm() - 1.0).abs() < 1e-6);
        }
    }
});
