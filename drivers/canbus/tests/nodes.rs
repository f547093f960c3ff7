//! The nodes over a bus that is a script, and over the kernel's virtual bus where there is one.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use hachi_canbus::device::{AxisFault, BusError, CanBus, Received};
use hachi_canbus::frame::CanFrame;
use hachi_canbus::odrive::{Command, Message};
use hachi_canbus::stop_node::{StopNodeConfig, StopReason};
use hachi_canbus::{CanStop, OdriveAxis};
use hachi_hal::conformance::check_emergency_stop;
use hachi_hal::{Clock, DeviceError, EmergencyStop, FaultKind, Stamp, StopSample};

const MS: i64 = 1_000_000;

/// When each frame comes, ns, and the frame; `None` is the bus going down.
type Coming = VecDeque<(i64, Option<CanFrame>)>;

/// A bus with a clock of its own: frames come at their times, waiting moves the clock.
#[derive(Clone, Default)]
struct Bus {
    now_ns: Rc<Cell<i64>>,
    frames: Rc<RefCell<Coming>>,
    sent: Rc<RefCell<Vec<CanFrame>>>,
    full: Rc<Cell<bool>>,
}

impl Bus {
    fn with(frames: &[(i64, u16, &[u8])]) -> Self {
        let bus = Self::default();
        let frame = |&(ms, id, bytes): &(i64, u16, &[u8])| (ms * MS, CanFrame::new(id, bytes));
        bus.frames.borrow_mut().extend(frames.iter().map(frame));
        bus
    }

    fn goes_down_at(&self, ms: i64) {
        self.frames.borrow_mut().push_back((ms * MS, None));
    }

    fn at(ms: i64) -> Stamp {
        Stamp::from_nanos(ms * MS)
    }
}

impl Clock for Bus {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.now_ns.get())
    }
}

impl CanBus for Bus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        if self.full.get() {
            return Err(BusError::Full);
        }
        self.sent.borrow_mut().push(*frame);
        Ok(())
    }

    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, BusError> {
        let end_ns = self.now_ns.get() + i64::try_from(limit.as_nanos()).unwrap();
        let mut frames = self.frames.borrow_mut();
        let Some(&(at_ns, frame)) = frames.front().filter(|(at_ns, _)| *at_ns <= end_ns) else {
            self.now_ns.set(end_ns);
            return Ok(None);
        };
        frames.pop_front();
        self.now_ns.set(self.now_ns.get().max(at_ns));
        match frame {
            Some(frame) => Ok(Some(Received {
                frame,
                age_ns: self.now_ns.get() - at_ns,
            })),
            None => Err(BusError::Down(std::io::ErrorKind::NetworkDown.into())),
        }
    }
}

/// Node 1, in operation from 0 ms to 300 ms, its contacts closed until 150 ms.
const PRESSED_ONCE: [(i64, u16, &[u8]); 7] = [
    (0, 0x701, &[5]),
    (5, 0x181, &[3]),
    (100, 0x701, &[5]),
    (150, 0x181, &[0]),
    (200, 0x701, &[5]),
    (260, 0x181, &[3]),
    (300, 0x701, &[5]),
];

fn stop(bus: &Bus) -> CanStop<Bus, Bus> {
    CanStop::new(bus.clone(), bus.clone(), StopNodeConfig::default()).unwrap()
}

fn read(stop: &mut CanStop<Bus, Bus>, by_ms: i64) -> Option<(i64, bool)> {
    let sample = stop.read_stop(Bus::at(by_ms)).unwrap();
    sample.map(|StopSample { stamp, pressed }| (stamp.as_nanos(), pressed))
}

#[test]
fn a_press_is_told_when_it_happens_and_silence_when_it_lasts_too_long() {
    let bus = Bus::with(&PRESSED_ONCE);
    let mut stop = stop(&bus);
    let expected = [
        (0, true),
        (5 * MS, false),
        (100 * MS, false),
        (150 * MS, true),
        (200 * MS, true),
        (260 * MS, false),
        (300 * MS, false),
        // The node is silent from here on: told as soon as it is too long, not at the deadline.
        (550 * MS + 1, true),
        (2_000 * MS, true),
    ];
    for expected in expected {
        assert_eq!(read(&mut stop, 2_000), Some(expected));
    }
    assert_eq!(stop.reason(), Some(StopReason::Silent));
}

#[test]
fn nothing_new_is_nothing_while_all_is_well() {
    let bus = Bus::with(&PRESSED_ONCE);
    let mut stop = stop(&bus);
    while read(&mut stop, 10) != Some((5 * MS, false)) {}
    assert_eq!(read(&mut stop, 50), None);
}

#[test]
fn a_node_that_was_never_there_is_pressed() {
    let bus = Bus::with(&[(3, 0x7FF, &[5])]);
    let mut stop = stop(&bus);
    assert_eq!(read(&mut stop, 10), Some((10 * MS, true)));
    assert_eq!(stop.reason(), Some(StopReason::NeverHeard));
}

/// A reader that was busy for a second finds old frames: they do not make an old state new.
#[test]
fn frames_that_waited_are_as_old_as_they_are() {
    let bus = Bus::with(&PRESSED_ONCE[..3]);
    bus.now_ns.set(1_000 * MS);
    let mut stop = stop(&bus);
    assert_eq!(
        read(&mut stop, 1_001),
        Some((0, true)),
        "closed a second ago"
    );
    assert_eq!(read(&mut stop, 1_001), Some((5 * MS, true)));
}

#[test]
fn a_bus_that_goes_down_is_an_error_which_leaves_it_usable() {
    let bus = Bus::with(&PRESSED_ONCE[..2]);
    bus.goes_down_at(10);
    let mut stop = stop(&bus);
    read(&mut stop, 20);
    read(&mut stop, 20);
    let down = stop.read_stop(Bus::at(20)).unwrap_err();
    assert_eq!(down.kind(), FaultKind::Reopen);
    assert_eq!(read(&mut stop, 400), Some((250 * MS + 1, true)));
}

#[test]
fn the_stop_keeps_its_promise() {
    let bus = Bus::with(&PRESSED_ONCE);
    bus.goes_down_at(310);
    let mut stop = stop(&bus);
    let tally = check_emergency_stop(&mut stop, &bus, 40, 20 * MS).unwrap();
    assert!(tally.items > 10 && tally.nothing > 3, "{tally:?}");
    assert_eq!(tally.faults, 1);
}

#[test]
fn an_axis_is_told_and_heard() {
    let errors = [0x10, 0, 0, 0, 1, 0, 1, 0];
    let bus = Bus::with(&[
        (10, 0x061, &[0, 0, 0, 0, 8, 0, 0, 0x80]),
        (12, 0x029, &[0; 8]),
        (14, 0x069, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0]),
        (16, 0x069, &[0]),
        (110, 0x061, &errors),
    ]);
    let mut axis = OdriveAxis::new(bus.clone(), bus.clone(), 3);
    assert_eq!(axis.fault(), Some(AxisFault::NeverHeard));
    let heartbeat = axis.read(Bus::at(500)).unwrap().unwrap();
    assert_eq!(heartbeat.0, Bus::at(10));
    assert_eq!(axis.fault(), None);
    let position = Message::Encoder {
        turns: 1.0,
        turns_per_s: 0.0,
    };
    assert_eq!(
        axis.read(Bus::at(500)).unwrap(),
        Some((Bus::at(14), position))
    );
    assert!(axis.read(Bus::at(500)).unwrap().is_some());
    assert_eq!(axis.bad_frames(), 1);
    let parts = [false, true, false];
    assert_eq!(axis.fault(), Some(AxisFault::Errors { axis: 0x10, parts }));
    assert_eq!(axis.read(Bus::at(500)).unwrap(), None);
    assert_eq!(axis.fault(), Some(AxisFault::Silent));
    axis.tell(&Command::Stop).unwrap();
    assert_eq!(*bus.sent.borrow(), [CanFrame::new(0x062, &[]).unwrap()]);
    bus.full.set(true);
    let full = axis.tell(&Command::ClearErrors).unwrap_err();
    assert_eq!(full.kind(), FaultKind::ReadAgain);
}

/// The kernel's own bus, in both directions. Needs `vcan0`:
/// `sudo ip link add dev vcan0 type vcan && sudo ip link set vcan0 up`.
#[cfg(target_os = "linux")]
#[test]
#[allow(clippy::print_stdout, reason = "says what is skipped")]
fn frames_go_over_the_kernels_virtual_bus() {
    use hachi_canbus::device::SocketCan;
    let (mut here, mut there) = match (SocketCan::open("vcan0"), SocketCan::open("vcan0")) {
        (Ok(here), Ok(there)) => (here, there),
        (Err(error), _) | (_, Err(error)) => {
            // Whatever it is, it must say what to do.
            let said = error.to_string();
            assert!(
                said.contains("vcan0") && said.contains("ip link set"),
                "{said}"
            );
            assert_eq!(error.kind(), FaultKind::FixConfig);
            println!("no virtual CAN bus here, skipped: {said}");
            return;
        }
    };
    let frame = CanFrame::new(0x123, &[1, 2, 3]).unwrap();
    let request = CanFrame::request(0x124).unwrap();
    here.send(&frame).unwrap();
    here.send(&request).unwrap();
    let limit = Duration::from_secs(5);
    assert_eq!(there.receive(limit).unwrap().unwrap().frame, frame);
    let second = there.receive(limit).unwrap().unwrap();
    assert_eq!(second.frame, request);
    assert!((0..5_000 * MS).contains(&second.age_ns));
    assert_eq!(there.receive(Duration::from_millis(5)).unwrap(), None);
    // Who has no time does not wait, and gets what is there.
    assert_eq!(there.receive(Duration::ZERO).unwrap(), None);
    here.send(&frame).unwrap();
    let at_once = there.receive(Duration::ZERO).unwrap();
    assert_eq!(at_once.unwrap().frame, frame);
    assert_eq!(there.receive(Duration::from_millis(5)).unwrap(), None);

    // A socket for a stop's frames alone sees nothing else, however much there is.
    let config = StopNodeConfig::default();
    let mut of_stop = SocketCan::open_for("vcan0", &config.ids()).unwrap();
    for id in [0x123, 0x182, 0x701, 0x7FF] {
        here.send(&CanFrame::new(id, &[5]).unwrap()).unwrap();
    }
    let heard = of_stop.receive(limit).unwrap().unwrap().frame;
    assert_eq!(heard.id(), 0x701);
    assert_eq!(of_stop.receive(Duration::from_millis(5)).unwrap(), None);
}

#[cfg(target_os = "linux")]
#[test]
fn an_interface_that_is_not_there_is_said_for_a_few_identifiers_too() {
    use hachi_canbus::device::SocketCan;
    let missing = SocketCan::open_for("nocan9", &[0x701]).unwrap_err();
    assert_eq!(missing.kind(), FaultKind::FixConfig);
    assert!(missing.to_string().contains("nocan9"), "{missing}");
}
