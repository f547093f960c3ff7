//! The frames against what the maker's own library sends and accepts: check values, golden frames,
//! sizes and offsets, each written out here.

use hachi_unitree::frame::{
    ANGLE_FREE, CheckForm, FieldError, FrameError, FrameKind, HighCmd, HighState, Key, Keys,
    Layout, LowCmd, LowState, Model, MotorCmd, Remote, SPEED_FREE, check_value, restore, transform,
};

const GO1: &Layout = &Layout::GO1;
const B1: &Layout = &Layout::B1;

fn stored(frame: &[u8]) -> [u8; 4] {
    *frame.last_chunk().unwrap()
}

#[test]
fn check_values_are_the_libraries() {
    for (word, expected) in [
        (0x0000_0000_u32, 0xC704_DD7B),
        (0xDEAD_BEEF, 0x81DA_1A18),
        (0x0000_0001, 0xC3C5_C0CC),
    ] {
        assert_eq!(check_value(&word.to_le_bytes()), expected, "{word:#x}");
    }
    let counting: Vec<u8> = (0..64).collect();
    assert_eq!(check_value(&counting[..16]), 0x081B_46CA);
    assert_eq!(check_value(&counting), 0x1125_C90E);
    // The last three bytes are not covered.
    assert_eq!(check_value(&counting[..19]), 0x081B_46CA);
}

#[test]
fn the_transformed_check_value_is_the_libraries_and_comes_back() {
    assert_eq!(transform(0x1234_5678), 0xA6FF_FEEF);
    for value in [0, 1, 0x1234_5678, u32::MAX, 0xEDCA_B9DE] {
        assert_eq!(restore(transform(value)), value);
    }
}

#[test]
fn frames_have_the_measured_sizes() {
    let sizes = |layout: &Layout| FrameKind::ALL.map(|kind| layout.frame_len(kind));
    assert_eq!(sizes(GO1), [129, 1087, 614, 807]);
    assert_eq!(sizes(B1), [145, 1139, 614, 839]);
}

fn golden_high(fill: impl Fn(&mut HighCmd)) -> [HighCmd; 1] {
    let mut command = HighCmd::default();
    fill(&mut command);
    [command]
}

#[test]
fn golden_high_commands() {
    let walk = |vx, vy, yaw| {
        golden_high(move |c| {
            (c.mode, c.gait) = (2, 1);
            (c.velocity, c.yaw_speed) = ([vx, vy], yaw);
        })
    };
    let posed = golden_high(|c| {
        c.mode = 1;
        c.euler = [0.1, -0.2, 0.05];
        (c.body_height, c.foot_raise_height) = (-0.05, 0.02);
    });
    let cases = [
        (golden_high(|_| {}), "0B 0F FC D8", "27 F4 9C 75"),
        (golden_high(|c| c.mode = 1), "66 3C F3 B8", "08 35 27 61"),
        (walk(0.3, -0.1, 0.5), "36 F6 4D 89", "0E 28 5F 5E"),
        (posed, "94 7E 21 F3", "B4 B1 72 2C"),
        (walk(0.25, -0.1, 0.5), "FE 56 71 64", "24 2C 60 2A"),
    ];
    for ([command], go1, b1) in cases {
        for (layout, expected) in [(GO1, go1), (B1, b1)] {
            let frame = command.encode(layout, CheckForm::Plain).unwrap();
            let bytes = frame.as_bytes();
            assert_eq!(bytes.len(), layout.frame_len(FrameKind::HighCmd));
            assert_eq!(hex(&stored(bytes)), expected, "{command:?}");
            let (back, form) = HighCmd::decode(layout, bytes).unwrap();
            assert_eq!((back, form), (command, CheckForm::Plain));
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    let digits: Vec<_> = bytes.iter().map(|b| format!("{b:02X}")).collect();
    digits.join(" ")
}

#[test]
fn a_walking_command_s_payload_is_the_measured_one() {
    let command = HighCmd {
        mode: 2,
        gait: 1,
        velocity: [0.3, -0.1],
        yaw_speed: 0.5,
        ..HighCmd::default()
    };
    let frame = command.encode(GO1, CheckForm::Plain).unwrap();
    let bytes = frame.as_bytes();
    assert_eq!(hex(&bytes[..3]), "FE EF EE");
    assert_eq!(hex(&bytes[22..24]), "02 01");
    assert_eq!(hex(&bytes[53..65]), "9A 99 99 3E CD CC CC BD 00 00 00 3F");
    let zeros = bytes[3..22]
        .iter()
        .chain(&bytes[24..53])
        .chain(&bytes[65..125]);
    assert!(zeros.copied().all(|b| b == 0));
}

fn low_command(torque: f32) -> LowCmd {
    let mut command = LowCmd::default();
    command.motors[0] = MotorCmd {
        angle: 0.5,
        speed: 1.0,
        torque,
        stiffness: 5.0,
        damping: 1.0,
        ..MotorCmd::IDLE
    };
    command
}

#[test]
fn golden_low_commands() {
    for layout in [GO1, B1] {
        let idle = LowCmd::default();
        let (frame, saturation) = idle.encode(layout, CheckForm::Plain).unwrap();
        assert!(!saturation.any());
        let bytes = frame.as_bytes();
        assert_eq!(hex(&stored(bytes)), "E2 F0 7F 34");
        assert_eq!(hex(&bytes[..3]), "FE EF FF");
        for motor in bytes[22..562].chunks_exact(27) {
            assert_eq!(hex(&motor[..9]), "0A B9 D2 FF 4E 00 00 7A 46");
            assert!(motor[9..].iter().all(|b| *b == 0));
        }
        assert_eq!(LowCmd::decode(layout, bytes).unwrap().0, idle);
    }
    let moving = low_command(-0.65);
    for (layout, check, torque) in [(GO1, "B7 0C D3 82", "5A FF"), (B1, "7F B2 C8 39", "AD FF")] {
        let (frame, saturation) = moving.encode(layout, CheckForm::Plain).unwrap();
        assert!(!saturation.any());
        let bytes = frame.as_bytes();
        assert_eq!(hex(&stored(bytes)), check);
        let expected = format!("0A 00 00 00 3F 00 00 80 3F {torque} A0 00 10 00");
        assert_eq!(hex(&bytes[22..37]), expected);
    }
}

/// Counts of torque, Kp and Kd of motor 0.
fn counts(layout: &Layout, motor: MotorCmd) -> (i16, u16, u16) {
    let mut command = LowCmd::default();
    command.motors[0] = motor;
    let (frame, _) = command.encode(layout, CheckForm::Plain).unwrap();
    let b = frame.as_bytes();
    (
        i16::from_le_bytes([b[31], b[32]]),
        u16::from_le_bytes([b[33], b[34]]),
        u16::from_le_bytes([b[35], b[36]]),
    )
}

#[test]
fn torque_and_gains_are_scaled_and_cut_as_the_library_does() {
    let motor = |torque, stiffness, damping| MotorCmd {
        torque,
        stiffness,
        damping,
        ..MotorCmd::IDLE
    };
    assert_eq!(counts(GO1, motor(0.65, 1.25, 1.25)), (166, 40, 20));
    assert_eq!(counts(GO1, motor(1.25, 0.0, 0.0)).0, 320);
    assert_eq!(counts(B1, motor(-0.65, 0.0, 0.0)).0, -83);
}

#[test]
fn what_does_not_fit_is_held_at_the_end_and_said_instead_of_wrapping() {
    let mut command = LowCmd::default();
    for (index, (torque, stiffness, damping)) in [
        (127.99, 2_047.0, 4_095.0),
        (128.5, 0.0, 0.0),
        (-500.0, 2_048.5, 0.0),
        (0.0, -1.0, 5_000.0),
    ]
    .into_iter()
    .enumerate()
    {
        command.motors[index].torque = torque;
        command.motors[index].stiffness = stiffness;
        command.motors[index].damping = damping;
    }
    let (_, saturation) = command.encode(GO1, CheckForm::Plain).unwrap();
    assert_eq!(saturation.torque, 0b0110);
    assert_eq!(saturation.stiffness, 0b1100);
    assert_eq!(saturation.damping, 0b1000);
    let held = |index: usize| counts(GO1, command.motors[index]);
    assert_eq!(held(1).0, i16::MAX);
    assert_eq!(held(2), (i16::MIN, u16::MAX, 0));
    assert_eq!(held(3), (0, 0, u16::MAX));
    // The B1's unit is twice as large: the same torques fit.
    let (_, saturation) = command.encode(B1, CheckForm::Plain).unwrap();
    assert_eq!(saturation.torque, 0b0100);
}

#[test]
fn golden_states() {
    for (layout, plain, transformed) in [
        (GO1, "49 EF 06 1B", "56 CC F6 97"),
        (B1, "61 D1 D0 C3", "68 1A 2E BF"),
    ] {
        let state = HighState::of(layout);
        for (form, expected) in [
            (CheckForm::Plain, plain),
            (CheckForm::Transformed, transformed),
        ] {
            let frame = state.encode(form);
            assert_eq!(hex(&stored(frame.as_bytes())), expected);
            let (back, seen) = HighState::decode(layout, frame.as_bytes()).unwrap();
            assert_eq!((back, seen), (state.clone(), form));
        }
    }
    for (layout, plain) in [(GO1, "98 B1 E9 65"), (B1, "73 53 EB 7C")] {
        let state = LowState::of(layout);
        let frame = state.encode(layout);
        assert_eq!(hex(&stored(frame.as_bytes())), plain);
        assert_eq!(LowState::decode(layout, frame.as_bytes()).unwrap(), state);
    }
}

/// A frame whose byte at offset `i` is a function of `i`, with head and level set.
fn patterned(len: usize, level: u8) -> Vec<u8> {
    // Floats of such bytes are finite: no exponent is all ones.
    let mut bytes: Vec<u8> = (0..len).map(|i| (i * 7 % 61) as u8).collect();
    bytes[..3].copy_from_slice(&[0xFE, 0xEF, level]);
    seal(&mut bytes);
    bytes
}

fn seal(bytes: &mut [u8]) {
    let end = bytes.len() - 4;
    let words = bytes.len() / 4 - 1;
    let check = check_value(&bytes[..words * 4]);
    bytes[end..].copy_from_slice(&check.to_le_bytes());
}

#[test]
fn every_byte_of_every_frame_comes_back() {
    for layout in [GO1, B1] {
        let bytes = patterned(layout.frame_len(FrameKind::HighCmd), 0xEE);
        let (command, _) = HighCmd::decode(layout, &bytes).unwrap();
        let again = command.encode(layout, CheckForm::Plain).unwrap();
        assert_eq!(again.as_bytes(), bytes);

        let bytes = patterned(layout.frame_len(FrameKind::HighState), 0xEE);
        let (state, _) = HighState::decode(layout, &bytes).unwrap();
        assert_eq!(state.encode(CheckForm::Plain).as_bytes(), bytes);

        let bytes = patterned(layout.frame_len(FrameKind::LowCmd), 0xFF);
        let (command, _) = LowCmd::decode(layout, &bytes).unwrap();
        let (again, _) = command.encode(layout, CheckForm::Plain).unwrap();
        assert_eq!(again.as_bytes(), bytes);

        let bytes = patterned(layout.frame_len(FrameKind::LowState), 0xFF);
        let state = LowState::decode(layout, &bytes).unwrap();
        assert_eq!(state.encode(layout).as_bytes(), bytes);
    }
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes(*bytes[at..].first_chunk().unwrap())
}

fn i16_at(bytes: &[u8], at: usize) -> i16 {
    i16::from_le_bytes(*bytes[at..].first_chunk().unwrap())
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(*bytes[at..].first_chunk().unwrap())
}

#[test]
fn high_command_fields_lie_where_the_header_puts_them() {
    for (layout, tail) in [(GO1, 65), (B1, 81)] {
        let bytes = patterned(layout.frame_len(FrameKind::HighCmd), 0xEE);
        let (c, _) = HighCmd::decode(layout, &bytes).unwrap();
        assert_eq!(c.header.reserve, bytes[3]);
        assert_eq!(c.header.serial, [u32_at(&bytes, 4), u32_at(&bytes, 8)]);
        assert_eq!(c.header.version, [u32_at(&bytes, 12), u32_at(&bytes, 16)]);
        assert_eq!(c.header.bandwidth.to_le_bytes(), bytes[20..22]);
        assert_eq!([c.mode, c.gait, c.speed_level], bytes[22..25]);
        assert_eq!(c.foot_raise_height, f32_at(&bytes, 25));
        assert_eq!(c.body_height, f32_at(&bytes, 29));
        assert_eq!(c.position, [33, 37].map(|at| f32_at(&bytes, at)));
        assert_eq!(c.euler, [41, 45, 49].map(|at| f32_at(&bytes, at)));
        assert_eq!(c.velocity, [53, 57].map(|at| f32_at(&bytes, at)));
        assert_eq!(c.yaw_speed, f32_at(&bytes, 61));
        if layout.model == Model::B1 {
            let shift = [65, 69].map(|at| f32_at(&bytes, at));
            assert_eq!(c.centre_of_mass_shift, shift);
            assert_eq!(c.stance_shift, [73, 77].map(|at| f32_at(&bytes, at)));
        }
        assert_eq!(c.battery.off, bytes[tail]);
        assert_eq!(c.led.as_flattened(), &bytes[tail + 4..tail + 16]);
        assert_eq!(c.remote, bytes[tail + 16..tail + 56]);
        assert_eq!(c.reserve, u32_at(&bytes, tail + 56));
    }
}

#[test]
fn high_state_fields_lie_where_the_header_puts_them() {
    // Of the fields behind the battery the Go1's offsets are written out; the B1's are 52 more.
    for (layout, cells, thermistors, shift) in [(GO1, 10, 2, 0), (B1, 30, 8, 52)] {
        let bytes = patterned(layout.frame_len(FrameKind::HighState), 0xEE);
        let (s, _) = HighState::decode(layout, &bytes).unwrap();
        assert_eq!(s.body.imu.quaternion[0], f32_at(&bytes, 22));
        assert_eq!(s.body.imu.gyroscope[2], f32_at(&bytes, 46));
        assert_eq!(s.body.imu.accelerometer[0], f32_at(&bytes, 50));
        assert_eq!(s.body.imu.rpy[1], f32_at(&bytes, 66));
        assert_eq!(s.body.imu.temperature_c, bytes[74] as i8);
        for (m, motor) in s.body.motors.iter().enumerate() {
            let at = 75 + 38 * m;
            assert_eq!(motor.mode, bytes[at]);
            assert_eq!(motor.angle, f32_at(&bytes, at + 1));
            assert_eq!(motor.speed, f32_at(&bytes, at + 5));
            assert_eq!(motor.acceleration, f32_at(&bytes, at + 9));
            assert_eq!(motor.torque, f32_at(&bytes, at + 13));
            assert_eq!(motor.raw_angle, f32_at(&bytes, at + 17));
            assert_eq!(motor.raw_speed, f32_at(&bytes, at + 21));
            assert_eq!(motor.raw_acceleration, f32_at(&bytes, at + 25));
            assert_eq!(motor.temperature_c, bytes[at + 29] as i8);
            assert_eq!(motor.reserve[1], u32_at(&bytes, at + 34));
        }
        let battery = &s.body.battery;
        assert_eq!(battery.version, bytes[835..837]);
        assert_eq!([battery.status, battery.charge_percent], bytes[837..839]);
        assert_eq!(battery.current_ma as u32, u32_at(&bytes, 839));
        assert_eq!(battery.cycles.to_le_bytes(), bytes[843..845]);
        assert_eq!(battery.monitor_temperatures_c.len(), thermistors);
        assert_eq!(battery.monitor_temperatures_c[0], bytes[845] as i8);
        let controller = bytes[845 + thermistors] as i8;
        assert_eq!(battery.controller_temperatures_c[0], controller);
        assert_eq!(battery.cells_mv.len(), cells);
        let first_cell = 845 + 2 * thermistors;
        assert_eq!(
            battery.cells_mv[0].to_le_bytes(),
            bytes[first_cell..first_cell + 2]
        );

        let at = |go1: usize| go1 + shift;
        assert_eq!(s.body.foot_force[0], i16_at(&bytes, at(869)));
        assert_eq!(s.body.foot_force[3], i16_at(&bytes, at(875)));
        assert_eq!(s.body.foot_force_estimate[0], i16_at(&bytes, at(877)));
        assert_eq!(s.mode, bytes[at(885)]);
        assert_eq!(s.progress, f32_at(&bytes, at(886)));
        assert_eq!(s.gait, bytes[at(890)]);
        assert_eq!(s.foot_raise_height, f32_at(&bytes, at(891)));
        assert_eq!(s.position[0], f32_at(&bytes, at(895)));
        assert_eq!(s.body_height, f32_at(&bytes, at(907)));
        assert_eq!(s.velocity[0], f32_at(&bytes, at(911)));
        assert_eq!(s.yaw_speed, f32_at(&bytes, at(923)));
        assert_eq!(s.range_obstacle[0], f32_at(&bytes, at(927)));
        assert_eq!(s.foot_positions[0][0], f32_at(&bytes, at(943)));
        assert_eq!(s.foot_positions[3][2], f32_at(&bytes, at(987)));
        assert_eq!(s.foot_speeds[0][0], f32_at(&bytes, at(991)));
        assert_eq!(s.remote, bytes[at(1039)..at(1079)]);
        assert_eq!(s.reserve, u32_at(&bytes, at(1079)));
    }
}

#[test]
fn low_state_fields_lie_where_the_header_puts_them() {
    for (layout, shift, counts_per_nm) in [(GO1, 0, 256.0), (B1, 32, 128.0)] {
        let bytes = patterned(layout.frame_len(FrameKind::LowState), 0xFF);
        let s = LowState::decode(layout, &bytes).unwrap();
        for (m, motor) in s.body.motors.iter().enumerate() {
            let at = 75 + 32 * m;
            assert_eq!(motor.mode, bytes[at]);
            assert_eq!(motor.angle, f32_at(&bytes, at + 1));
            assert_eq!(motor.speed, f32_at(&bytes, at + 5));
            assert_eq!(motor.acceleration, f32::from(i16_at(&bytes, at + 9)));
            let torque = f32::from(i16_at(&bytes, at + 11)) / counts_per_nm;
            assert_eq!(motor.torque, torque);
            assert_eq!(motor.raw_angle, f32_at(&bytes, at + 13));
            assert_eq!(motor.raw_speed, f32_at(&bytes, at + 17));
            assert_eq!(motor.raw_acceleration, f32::from(i16_at(&bytes, at + 21)));
            assert_eq!(motor.temperature_c, bytes[at + 23] as i8);
            assert_eq!(motor.reserve[0], u32_at(&bytes, at + 24));
        }
        let at = |go1: usize| go1 + shift;
        let last_cell = s.body.battery.cells_mv.last().copied().unwrap();
        assert_eq!(last_cell, 32 * u16::from(bytes[at(738)]));
        assert_eq!(s.body.battery.charge_percent, bytes[718]);
        assert_eq!(s.body.foot_force[0], i16_at(&bytes, at(739)));
        assert_eq!(s.body.foot_force_estimate[3], i16_at(&bytes, at(753)));
        assert_eq!(s.tick_ms, u32_at(&bytes, at(755)));
        assert_eq!(s.remote, bytes[at(759)..at(799)]);
        assert_eq!(s.reserve, u32_at(&bytes, at(799)));
    }
}

#[test]
fn another_robot_s_frame_is_named() {
    let frame = HighState::of(B1).encode(CheckForm::Plain);
    let error = HighState::decode(GO1, frame.as_bytes()).unwrap_err();
    assert!(matches!(
        error,
        FrameError::OtherFrame {
            got_model: Model::B1,
            got_kind: FrameKind::HighState,
            ..
        }
    ));
    let said = error.to_string();
    assert!(
        said.contains("1139 bytes are a HighState of a B1, not a HighState of a Go1"),
        "{said}"
    );
    let frame = LowState::of(GO1).encode(GO1);
    let said = HighState::decode(GO1, frame.as_bytes())
        .unwrap_err()
        .to_string();
    assert!(said.contains("LowState of a Go1"), "{said}");
}

#[test]
fn damaged_frames_are_refused_with_what_was_seen() {
    let good = HighState::of(GO1).encode(CheckForm::Transformed);
    let decode = |bytes: &[u8]| HighState::decode(GO1, bytes).unwrap_err();
    let cut = decode(&good.as_bytes()[..1086]);
    assert!(
        matches!(
            cut,
            FrameError::Length {
                expected: 1087,
                got: 1086,
                ..
            }
        ),
        "{cut}"
    );
    assert!(matches!(decode(&[]), FrameError::Length { got: 0, .. }));

    let mut bad = good;
    bad.as_bytes_mut()[0] = 0xFD;
    assert_eq!(
        decode(bad.as_bytes()),
        FrameError::Head { got: [0xFD, 0xEF] }
    );

    // Any covered byte.
    for at in [3, 22, 500, 1079] {
        let mut bad = good;
        bad.as_bytes_mut()[at] ^= 0x10;
        let error = decode(bad.as_bytes());
        assert!(matches!(error, FrameError::Check { .. }), "{at}: {error}");
    }
    // Bytes 1080 to 1082 are not covered.
    let mut uncovered = good;
    uncovered.as_bytes_mut()[1082] ^= 0x10;
    assert!(HighState::decode(GO1, uncovered.as_bytes()).is_ok());

    let mut low = HighState::of(GO1);
    low.header.level = 0xFF;
    let low = low.encode(CheckForm::Plain);
    let expected = FrameError::Level {
        kind: FrameKind::HighState,
        got: 0xFF,
    };
    assert_eq!(decode(low.as_bytes()), expected);
}

#[test]
fn the_transformed_check_value_is_for_high_level_states_alone() {
    let mut low = LowState::of(GO1).encode(GO1);
    low.seal(CheckForm::Transformed);
    let error = LowState::decode(GO1, low.as_bytes()).unwrap_err();
    assert!(matches!(error, FrameError::Check { .. }), "{error}");
    // Commands are taken in both forms, and which one is said: firmwares differ.
    let command = HighCmd::default()
        .encode(B1, CheckForm::Transformed)
        .unwrap();
    let (_, form) = HighCmd::decode(B1, command.as_bytes()).unwrap();
    assert_eq!(form, CheckForm::Transformed);
}

#[test]
fn commands_with_a_number_that_is_none_are_not_sent() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        type Field = (&'static str, fn(&mut HighCmd, f32));
        let fields: [Field; 8] = [
            ("foot raise height", |c, v| c.foot_raise_height = v),
            ("body height", |c, v| c.body_height = v),
            ("position", |c, v| c.position[1] = v),
            ("euler", |c, v| c.euler[2] = v),
            ("velocity", |c, v| c.velocity[0] = v),
            ("yaw speed", |c, v| c.yaw_speed = v),
            ("centre of mass shift", |c, v| c.centre_of_mass_shift[0] = v),
            ("stance shift", |c, v| c.stance_shift[1] = v),
        ];
        for (name, set) in fields {
            let mut command = HighCmd::default();
            set(&mut command, bad);
            let error = command.encode(GO1, CheckForm::Plain).unwrap_err();
            assert!(
                matches!(error, FieldError::NotFinite { field, .. } if field == name),
                "{error}"
            );
        }
        let fields: [fn(&mut MotorCmd, f32); 5] = [
            |m, v| m.angle = v,
            |m, v| m.speed = v,
            |m, v| m.torque = v,
            |m, v| m.stiffness = v,
            |m, v| m.damping = v,
        ];
        for set in fields {
            let mut command = LowCmd::default();
            set(&mut command.motors[19], bad);
            let error = command.encode(B1, CheckForm::Plain).unwrap_err();
            assert!(
                matches!(error, FieldError::NotFinite { index: 19, .. }),
                "{error}"
            );
        }
    }
}

#[test]
fn free_joints_have_the_library_s_values() {
    assert_eq!(hex(&ANGLE_FREE.to_le_bytes()), "B9 D2 FF 4E");
    assert_eq!(hex(&SPEED_FREE.to_le_bytes()), "00 00 7A 46");
}

#[test]
fn the_remote_control_s_forty_bytes() {
    let mut bytes = [0; 40];
    bytes[..2].copy_from_slice(&[0x55, 0x51]);
    bytes[2..4].copy_from_slice(&[0b0010_0000, 0b0000_0010]); // L2 and B
    for (at, value) in [(4, 0.25_f32), (8, -0.5), (12, 0.75), (16, 1.0), (20, -1.0)] {
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    let remote = Remote::decode(&bytes).unwrap();
    assert_eq!(
        [remote.lx, remote.rx, remote.ry, remote.l2, remote.ly],
        [0.25, -0.5, 0.75, 1.0, -1.0]
    );
    assert!(remote.keys.holds(Keys::of(&[Key::L2, Key::B])));
    assert!(!remote.keys.holds(Keys::of(&[Key::L2, Key::A])));
    assert!(!remote.keys.holds(Keys::default()));
    assert!(remote.is_steered());
    assert!(!Remote::default().is_steered());
    assert_eq!(remote.encode(), bytes);
    let order = [
        Key::R1,
        Key::L1,
        Key::Start,
        Key::Select,
        Key::R2,
        Key::L2,
        Key::F1,
        Key::F2,
        Key::A,
        Key::B,
        Key::X,
        Key::Y,
        Key::Up,
        Key::Right,
        Key::Down,
        Key::Left,
    ];
    for (bit, key) in order.into_iter().enumerate() {
        assert_eq!(Keys::of(&[key]).0, 1 << bit);
    }
    bytes[20..24].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = Remote::decode(&bytes).unwrap_err();
    assert!(
        matches!(error, FieldError::NotFinite { index: 4, .. }),
        "{error}"
    );
}
