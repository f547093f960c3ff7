//! Any bytes as a robot's states: refused, or values that hal takes or names; and a frame that is
//! read is written again as it came.
#![no_main]

use hachi_b1::B1;
use hachi_go1::GO1;
use hachi_hal::Stamp;
use hachi_unitree::Quadruped;
use hachi_unitree::frame::{
    BodyReading, CheckForm, FrameKind, HighState, LowState, Remote, check_value_of_frame,
};
use hachi_unitree::fresh::{ContentWatch, TickWatch};
use hachi_unitree::reading;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&switches, payload)) = data.split_first() else {
        return;
    };
    let robot = if switches & 1 == 0 { GO1 } else { B1 };
    let mut bytes = payload.to_vec();
    if switches & 2 != 0 {
        mend(&robot, &mut bytes);
    }
    let mut watch = ContentWatch::default();
    watch.is_new(&bytes, Stamp::default());
    if let Ok((state, form)) = HighState::decode(&robot.layout, &bytes) {
        read(&robot, &state.body);
        let _ = Remote::decode(&state.remote);
        assert_eq!(state.encode(form).as_bytes(), bytes);
        assert!(form == CheckForm::Plain || bytes[2] == 0xEE);
    }
    if let Ok(state) = LowState::decode(&robot.layout, &bytes) {
        read(&robot, &state.body);
        let mut ticks = TickWatch::default();
        ticks.judge(state.tick_ms);
        ticks.judge(0);
        assert_eq!(state.encode(&robot.layout).as_bytes(), bytes);
    }
});

/// A mutation that keeps head, level and check value gets past the door.
fn mend(robot: &Quadruped, bytes: &mut Vec<u8>) {
    let high = bytes.len().is_multiple_of(2);
    let kind = if high {
        FrameKind::HighState
    } else {
        FrameKind::LowState
    };
    bytes.resize(robot.layout.frame_len(kind), 0);
    bytes[..3].copy_from_slice(&[0xFE, 0xEF, if high { 0xEE } else { 0xFF }]);
    let check = check_value_of_frame(bytes);
    let end = bytes.len() - 4;
    bytes[end..].copy_from_slice(&check.to_le_bytes());
}

fn read(robot: &Quadruped, body: &BodyReading) {
    let stamp = Stamp::from_nanos(1);
    if let Ok(sample) = reading::body_sample(body, &robot.joints, stamp) {
        assert!(sample.legs.is_finite());
        assert!((sample.attitude.level_from_base.norm() - 1.0).abs() < 1e-9);
    }
    if let Ok(sample) = reading::battery(body, &robot.layout, stamp) {
        assert!(sample.is_plausible());
    }
}
