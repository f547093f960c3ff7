//! Frames against those worked out from the documents, byte for byte.

use hachi_canbus::frame::CanFrame;
use hachi_canbus::odrive::{AxisState, Command, CommandError, ControlMode, Message, MessageError};
use hachi_canbus::stop_node::{StopFrameError, StopNode, StopNodeConfig, StopReason};
use hachi_hal::Stamp;

fn frame(id: u16, bytes: &[u8]) -> CanFrame {
    CanFrame::new(id, bytes).unwrap()
}

#[test]
fn a_frame_has_eleven_bits_and_eight_bytes_at_most() {
    assert_eq!(frame(0x7FF, &[1; 8]).data(), [1; 8]);
    assert_eq!(CanFrame::new(0x800, &[]), None);
    assert_eq!(CanFrame::new(1, &[0; 9]), None);
    let request = CanFrame::request(5).unwrap();
    assert!(request.is_request() && request.data().is_empty());
    assert_eq!(CanFrame::request(0x800), None);
}

#[test]
fn commands_to_an_axis_have_the_bytes_that_it_knows() {
    let close_loop = Command::State(AxisState::ClosedLoop).encode(1).unwrap();
    assert_eq!(close_loop, frame(0x027, &[8, 0, 0, 0]));
    let position = Command::Position {
        turns: 1.0,
        velocity: 0.0,
        torque: 0.0,
    };
    let expected = frame(0x02C, &[0x00, 0x00, 0x80, 0x3F, 0, 0, 0, 0]);
    assert_eq!(position.encode(1), Ok(expected));
    let fed_forward = Command::Position {
        turns: -2.0,
        velocity: 1.5,
        torque: -0.25,
    };
    // -2 is C0000000; 1500 is 05DC; -250 is FF06.
    let expected = frame(0x02C, &[0, 0, 0, 0xC0, 0xDC, 0x05, 0x06, 0xFF]);
    assert_eq!(fed_forward.encode(1), Ok(expected));
    let mode = Command::Mode(ControlMode::Velocity).encode(0x3F).unwrap();
    assert_eq!(mode, frame(0x7EB, &[2, 0, 0, 0, 1, 0, 0, 0]));
    assert_eq!(Command::Stop.encode(3), Ok(frame(0x062, &[])));
    assert_eq!(Command::ClearErrors.encode(3), Ok(frame(0x078, &[])));
    assert_eq!(Command::AskBus.encode(1).ok(), CanFrame::request(0x037));
    let torque = Command::Torque { torque: 0.5 }.encode(1);
    assert_eq!(torque, Ok(frame(0x02E, &[0, 0, 0, 0x3F])));
}

#[test]
fn commands_that_cannot_be_told_are_refused() {
    let refused = |command: Command| command.encode(1).unwrap_err();
    assert_eq!(
        Command::Stop.encode(64),
        Err(CommandError::Node { got: 64 })
    );
    let torque = f32::NAN;
    assert_eq!(refused(Command::Torque { torque }), CommandError::NotFinite);
    let far = Command::Position {
        turns: 0.0,
        velocity: 33.0,
        torque: 0.0,
    };
    assert_eq!(refused(far), CommandError::FeedForward);
}

#[test]
fn an_axis_is_understood() {
    let heartbeat = frame(0x021, &[0x10, 0, 0, 0, 8, 1, 0, 0x81]);
    let expected = Message::Heartbeat {
        axis_errors: 0x10,
        state: 8,
        part_errors: [true, false, true],
        arrived: true,
    };
    assert_eq!(Message::decode(1, &heartbeat), Ok(Some(expected)));
    assert_eq!(expected.encode(1), Ok(heartbeat));
    let encoder = frame(0x029, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0]);
    let expected = Message::Encoder {
        turns: 1.0,
        turns_per_s: -2.0,
    };
    assert_eq!(Message::decode(1, &encoder), Ok(Some(expected)));
    let bus = frame(0x037, &[0, 0, 0xC0, 0x41, 0, 0, 0, 0x3F]);
    let expected = Message::Bus {
        voltage: 24.0,
        current: 0.5,
    };
    assert_eq!(Message::decode(1, &bus), Ok(Some(expected)));
    // Another axis, a command's echo, a request.
    assert_eq!(Message::decode(2, &bus), Ok(None));
    assert_eq!(Message::decode(1, &frame(0x02C, &[0; 8])), Ok(None));
    assert_eq!(
        Message::decode(1, &CanFrame::request(0x037).unwrap()),
        Ok(None)
    );
}

#[test]
fn damaged_messages_of_an_axis_are_refused() {
    let short = Message::decode(1, &frame(0x021, &[0; 7]));
    assert_eq!(short, Err(MessageError::Length { command: 1, got: 7 }));
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let endless = Message::decode(1, &frame(0x029, &bytes));
    assert_eq!(endless, Err(MessageError::NotFinite { command: 9 }));
}

const MS: i64 = 1_000_000;

fn at(ms: i64) -> Stamp {
    Stamp::from_nanos(ms * MS)
}

/// Node 5 with contacts at its first two inputs, told these frames at these times.
fn stop(frames: &[(i64, u16, &[u8])]) -> StopNode {
    let config = StopNodeConfig {
        node: 5,
        ..StopNodeConfig::default()
    };
    let mut node = StopNode::new(config).unwrap();
    for &(ms, id, bytes) in frames {
        assert_eq!(node.take(&frame(id, bytes), at(ms)), Ok(true));
    }
    node
}

#[test]
fn a_stop_whose_contacts_are_closed_lets_the_robot_move_while_its_node_lives() {
    let node = stop(&[(0, 0x705, &[0x05]), (1, 0x185, &[0b0000_0011])]);
    assert_eq!(node.reason(at(1)), None);
    assert_eq!(node.reason(at(250)), None);
    assert_eq!(node.reason(at(251)), Some(StopReason::Silent));
    assert_eq!(
        node.reason(at(-1)),
        Some(StopReason::Silent),
        "another clock"
    );
    // Other inputs of the node do not matter.
    let node = stop(&[(0, 0x705, &[0x05]), (1, 0x185, &[0b1010_0011])]);
    assert_eq!(node.reason(at(1)), None);
}

#[test]
fn everything_else_is_pressed_with_its_reason() {
    let alive: (i64, u16, &[u8]) = (0, 0x705, &[0x05]);
    let closed: (i64, u16, &[u8]) = (0, 0x185, &[3]);
    for (frames, reason) in [
        (vec![], StopReason::NeverHeard),
        // Inputs alone are no sign of a node in operation.
        (vec![closed], StopReason::NeverHeard),
        (vec![alive], StopReason::InputsUnknown),
        (vec![alive, (1, 0x185, &[0])], StopReason::Pressed),
        (vec![alive, (1, 0x185, &[1])], StopReason::Disagree),
        (vec![alive, (1, 0x185, &[2])], StopReason::Disagree),
        (
            vec![alive, closed, (1, 0x705, &[0x7F])],
            StopReason::NotOperational,
        ),
        // It started anew: what its contacts were is no longer known.
        (
            vec![alive, closed, (1, 0x705, &[0]), (2, 0x705, &[5])],
            StopReason::InputsUnknown,
        ),
        (
            vec![alive, closed, (1, 0x085, &[0x20, 0x81, 1, 0, 0, 0, 0, 0])],
            StopReason::Emergency { code: 0x8120 },
        ),
    ] {
        assert_eq!(stop(&frames).reason(at(2)), Some(reason), "{frames:?}");
    }
    // The error was taken back.
    let over = stop(&[
        alive,
        closed,
        (1, 0x085, &[0x20, 0x81]),
        (2, 0x085, &[0, 0]),
    ]);
    assert_eq!(over.reason(at(2)), None);
}

#[test]
fn frames_of_others_and_damaged_ones_are_no_sign_of_life() {
    let mut node = stop(&[(0, 0x705, &[0x05]), (0, 0x185, &[3])]);
    assert_eq!(node.take(&frame(0x706, &[5]), at(200)), Ok(false));
    assert_eq!(
        node.take(&CanFrame::request(0x705).unwrap(), at(200)),
        Ok(false)
    );
    let empty = StopFrameError::Length {
        id: 0x705,
        got: 0,
        needed: 1,
    };
    assert_eq!(node.take(&frame(0x705, &[]), at(200)), Err(empty));
    let odd = StopFrameError::State { got: 0x33 };
    assert_eq!(node.take(&frame(0x705, &[0x33]), at(200)), Err(odd));
    assert_eq!(node.reason(at(251)), Some(StopReason::Silent));
}

/// CiA 301: emergency under 80h, the first inputs under 180h, the heartbeat under 700h, each with the
/// node's number added.
#[test]
fn inputs_are_asked_for_where_they_are_not_known_and_again_after_a_silence() {
    let request = CanFrame::request(0x185);
    let mut node = stop(&[]);
    assert_eq!(node.asks(), None, "nobody is there");
    node.take(&frame(0x705, &[0x05]), at(0)).unwrap();
    assert_eq!(node.asks(), request);
    node.take(&frame(0x185, &[0b11]), at(1)).unwrap();
    assert_eq!((node.asks(), node.reason(at(1))), (None, None));
    // Pressed at 400 ms, while nothing came through.
    node.take(&frame(0x705, &[0x05]), at(600)).unwrap();
    assert_eq!(node.reason(at(600)), Some(StopReason::InputsUnknown));
    assert_eq!(node.asks(), request);
}

#[test]
fn a_stop_listens_to_three_identifiers_and_no_other() {
    let config = StopNodeConfig {
        node: 5,
        ..StopNodeConfig::default()
    };
    assert_eq!(config.ids(), [0x085, 0x185, 0x705]);
    let mut node = StopNode::new(config).unwrap();
    for id in 0..=0x7FF {
        let taken = node.take(&frame(id, &[0; 8]), at(0));
        assert_eq!(taken, Ok(config.ids().contains(&id)), "{id:#05x}");
    }
}

#[test]
fn settings_that_watch_nothing_are_refused() {
    let with = |node, closed_inputs, heartbeat_limit_ns| {
        StopNode::new(StopNodeConfig {
            node,
            closed_inputs,
            heartbeat_limit_ns,
        })
    };
    assert!(with(1, 1, 1).is_some());
    assert!(with(0, 1, 1).is_none() && with(128, 1, 1).is_none());
    assert!(with(1, 0, 1).is_none() && with(1, 1, 0).is_none());
}
