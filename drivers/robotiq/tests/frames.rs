//! Frames against those of the maker's documents and of other programs, byte for byte.

use hachi_robotiq::frame::{
    Activation, Command, Contact, FrameError, Request, State, checksum, fault_name, is_major,
};
use hachi_robotiq::serve::{Asked, answer, request};

const CLOSE: Command = Command {
    activate: true,
    go: true,
    release: false,
    position: 255,
    speed: 255,
    force: 255,
};

fn bytes(text: &str) -> Vec<u8> {
    let hexadecimal = |byte| u8::from_str_radix(byte, 16).unwrap();
    text.split_whitespace().map(hexadecimal).collect()
}

#[test]
fn requests_have_the_bytes_that_grippers_know() {
    let activate = Command {
        activate: true,
        ..Command::default()
    };
    let half = Command {
        position: 0x80,
        speed: 0x80,
        force: 0x80,
        ..CLOSE
    };
    let open = Command {
        position: 0,
        ..CLOSE
    };
    for (request, frame) in [
        (
            Request::Write(Command::default()),
            "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30",
        ),
        (
            Request::Write(activate),
            "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1",
        ),
        (
            Request::Write(CLOSE),
            "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29",
        ),
        (
            Request::Write(open),
            "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19",
        ),
        (
            Request::Write(half),
            "09 10 03 E8 00 03 06 09 00 00 80 80 80 12 21",
        ),
        (Request::Read, "09 03 07 D0 00 03 04 0E"),
    ] {
        assert_eq!(request.encode(9)[..], bytes(frame), "{request:?}");
    }
}

#[test]
fn answers_are_read_as_the_maker_means_them() {
    let read = |frame: &str| Request::Read.answer(9, &bytes(frame)).map(Option::unwrap);
    let moving = read("09 03 06 39 00 00 FF 0E 0A F7 8B").unwrap();
    let expected = State {
        activate: true,
        go: true,
        activation: Activation::Done,
        contact: Contact::Moving,
        fault: 0,
        asked: 255,
        position: 14,
        current: 10,
    };
    assert_eq!(moving, expected);
    let gripped = read("09 03 06 B9 00 00 FF BD 00 1D 7C").unwrap();
    assert_eq!(
        (gripped.contact, gripped.position),
        (Contact::WhileClosing, 0xBD)
    );
    let there = read("09 03 06 F9 00 00 FF E6 00 28 8C").unwrap();
    assert_eq!((there.contact, there.position), (Contact::AtPosition, 0xE6));
    let written = Request::Write(CLOSE).answer(9, &bytes("09 10 03 E8 00 03 01 30"));
    assert_eq!(written, Ok(None));
}

#[test]
fn answers_that_are_none_are_refused_with_what_was_seen() {
    let read = |frame: &str| Request::Read.answer(9, &bytes(frame)).unwrap_err();
    assert_eq!(read("09 83 02 41 33"), FrameError::Refused { code: 2 });
    assert_eq!(read("09 03 06 39"), FrameError::Short { got: 4 });
    let damaged = read("09 03 06 39 00 00 FF 0F 0A F7 8B");
    assert!(
        matches!(damaged, FrameError::Checksum { said: 0x8BF7, .. }),
        "{damaged}"
    );
    // Whole, and an answer to something else.
    assert_eq!(
        read("09 10 03 E8 00 03 01 30"),
        FrameError::Function { got: 0x10 }
    );
    assert_eq!(read("09 03 02 31 00 4C 15"), FrameError::Contents);
    let one_register = bytes("09 10 03 E8 00 01 80 F1");
    let write = Request::Write(CLOSE);
    assert_eq!(write.answer(9, &one_register), Err(FrameError::Contents));
    assert_eq!(
        Request::Read.answer(8, &bytes("09 03 06 39 00 00 FF 0E 0A F7 8B")),
        Err(FrameError::Address { got: 9 })
    );
}

#[test]
fn the_length_of_an_answer_is_known_from_its_beginning() {
    assert_eq!(Request::Read.answer_len(&[]), None);
    assert_eq!(Request::Read.answer_len(&[9, 3]), None);
    assert_eq!(Request::Read.answer_len(&[9, 3, 6]), Some(11));
    assert_eq!(Request::Read.answer_len(&[9, 0x83]), Some(5));
    assert_eq!(Request::Write(CLOSE).answer_len(&[9, 0x10]), Some(8));
}

#[test]
fn the_grippers_side_gives_the_same_bytes() {
    let asked = |frame: &str| request(9, &bytes(frame), Command::default());
    let close = asked("09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29").unwrap();
    assert_eq!(
        close,
        Asked::Write {
            command: CLOSE,
            registers: 3
        }
    );
    let state = State {
        activate: true,
        activation: Activation::Running,
        ..State::default()
    };
    let said = |asked| answer(9, asked, &state).to_vec();
    assert_eq!(said(close), bytes("09 10 03 E8 00 03 01 30"));
    // One register, and by the other function.
    let one = asked("09 03 07 D0 00 01 85 CF").unwrap();
    assert_eq!(said(one), bytes("09 03 02 11 00 55 D5"));
    let three = asked("09 04 07 D0 00 03 B1 CE").unwrap();
    assert_eq!(
        three,
        Asked::Read {
            function: 4,
            registers: 3
        }
    );
    // A short write changes the beginning of what is in force.
    let stop = request(9, &bytes("09 10 03 E8 00 01 02 01 00 E4 28"), CLOSE);
    let command = Command { go: false, ..CLOSE };
    assert_eq!(
        stop,
        Some(Asked::Write {
            command,
            registers: 1
        })
    );
    assert_eq!(said(stop.unwrap()), bytes("09 10 03 E8 00 01 80 F1"));
    // Another's, and a damaged one: silence.
    assert_eq!(request(8, &bytes("09 03 07 D0 00 01 85 CF"), CLOSE), None);
    assert_eq!(asked("09 03 07 D0 00 01 85 CE"), None);
    // The function that does both is not known here.
    let both = asked("09 17 07 D0 00 03 03 E8 00 03 06 09 00 00 FF FF FF E6 3E");
    assert_eq!(both, Some(Asked::Unknown { function: 0x17 }));
}

#[test]
fn the_checksum_is_that_of_the_modbus_documents() {
    // The example of "MODBUS over serial line", appendix B: 02 07 has the checksum 41 12.
    assert_eq!(checksum(&[0x02, 0x07]).to_le_bytes(), [0x41, 0x12]);
}

#[test]
fn faults_have_names_and_the_severe_ones_need_activation() {
    assert!(!is_major(0x9) && is_major(0xA) && is_major(0xF));
    assert!(fault_name(0xE).contains("current"));
    assert_eq!(fault_name(1), "no name known");
}

#[test]
fn every_state_comes_back_from_its_bytes() {
    for flags in 0..=255_u8 {
        let kept = flags & 0b1111_1001;
        let state = State::from_bytes([flags, 0, 0xFE, 1, 2, 3]);
        assert_eq!(state.bytes(), [kept, 0, 0x0E, 1, 2, 3]);
        let command = Command::from_bytes([flags, 9, 9, 4, 5, 6]);
        assert_eq!(command.bytes(), [flags & 0b0001_1001, 0, 0, 4, 5, 6]);
    }
}
