//! Any bytes and any numbers: refused or read, never a panic. The fuzz targets go on where this
//! stops.

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::{AttitudeSample, ImuSample, LegState, Rotation, Stamp, Vector3};
use hachi_unitree::frame::{
    CheckForm, FrameKind, HighCmd, HighState, Layout, LowCmd, LowState, check_value_of_frame,
};
use hachi_unitree::reading::body_sample;
use hachi_unitree::{BodySample, LegTracker};
use proptest::prelude::*;

/// Random bytes behind a right head, level and check value.
fn framed(layout: &Layout, kind: FrameKind, bytes: &[u8]) -> Vec<u8> {
    let len = layout.frame_len(kind);
    let mut frame: Vec<u8> = bytes.iter().copied().cycle().take(len).collect();
    let high = matches!(kind, FrameKind::HighCmd | FrameKind::HighState);
    frame[..3].copy_from_slice(&[0xFE, 0xEF, if high { 0xEE } else { 0xFF }]);
    let check = check_value_of_frame(&frame);
    frame[len - 4..].copy_from_slice(&check.to_le_bytes());
    frame
}

proptest! {
    #[test]
    fn bytes_without_a_frame_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..1_200)) {
        for layout in Layout::KNOWN {
            prop_assert!(HighState::decode(layout, &bytes).is_err());
            prop_assert!(LowState::decode(layout, &bytes).is_err());
            prop_assert!(HighCmd::decode(layout, &bytes).is_err());
            prop_assert!(LowCmd::decode(layout, &bytes).is_err());
        }
    }

    #[test]
    fn whatever_a_frame_holds_is_read_and_comes_back(
        bytes in prop::collection::vec(any::<u8>(), 61..127),
    ) {
        for robot in [GO1, B1] {
            let layout = &robot.layout;
            let frame = framed(layout, FrameKind::HighState, &bytes);
            let (state, form) = HighState::decode(layout, &frame).unwrap();
            let again = state.encode(form);
            prop_assert_eq!(again.as_bytes(), &frame[..]);
            // Most of these are no joints; none may panic.
            if let Ok(sample) = body_sample(&state.body, &robot.joints, Stamp::default()) {
                prop_assert!(sample.legs.is_finite());
            }
            let frame = framed(layout, FrameKind::LowState, &bytes);
            let state = LowState::decode(layout, &frame).unwrap();
            let again = state.encode(layout);
            prop_assert_eq!(again.as_bytes(), &frame[..]);
            let frame = framed(layout, FrameKind::HighCmd, &bytes);
            let (command, form) = HighCmd::decode(layout, &frame).unwrap();
            if let Ok(again) = command.encode(layout, form) {
                prop_assert_eq!(again.as_bytes(), &frame[..]);
            }
            let frame = framed(layout, FrameKind::LowCmd, &bytes);
            let (command, _) = LowCmd::decode(layout, &frame).unwrap();
            if let Ok((again, saturation)) = command.encode(layout, CheckForm::Plain) {
                prop_assert_eq!(again.as_bytes(), &frame[..]);
                prop_assert!(!saturation.any());
            }
        }
    }

    #[test]
    fn legs_of_any_numbers_give_numbers(
        moments in prop::collection::vec(prop::array::uniform32(-4.0..4.0), 1..20),
    ) {
        for robot in [GO1, B1] {
            let mut tracker = LegTracker::new(&robot);
            for (i, n) in moments.iter().enumerate() {
                let stamp = Stamp::from_nanos(i as i64 * 2_000_000);
                let vector = |at: usize| {
                    Vector3::new(n[at % 32], n[(at + 1) % 32], n[(at + 2) % 32])
                };
                let legs = LegState {
                    stamp,
                    angles: [0, 3, 6, 9].map(vector),
                    speeds: [12, 15, 18, 21].map(|at| vector(at) * 10.0),
                    torques: [5, 8, 11, 14].map(|at| vector(at) * 30.0),
                    foot_forces: [24, 25, 26, 27].map(|at| n[at] * 60.0),
                };
                let sample = BodySample {
                    legs,
                    imu: ImuSample {
                        stamp,
                        angular_velocity: vector(24),
                        specific_force: vector(27) * 10.0,
                    },
                    attitude: AttitudeSample {
                        stamp,
                        level_from_base: Rotation::from_scaled_axis(vector(29)),
                    },
                };
                let estimate = tracker.step(&sample).unwrap();
                prop_assert!(estimate.motion.velocity.iter().all(|v| v.is_finite()));
                prop_assert!(estimate.motion.velocity_covariance.iter().all(|v| v.is_finite()));
                let place = estimate.motion.sample.odom_from_base.translation.vector;
                prop_assert!(place.iter().all(|v| v.is_finite()));
                if let Some(footprint) = estimate.footprint {
                    prop_assert!(footprint.height_m().is_finite());
                    prop_assert!((footprint.normal_in_base().norm() - 1.0).abs() < 1e-6);
                }
            }
        }
    }
}
