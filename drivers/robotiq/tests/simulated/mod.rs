//! A 2F-85 at the other end of a pseudo-terminal, in a thread of its own.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hachi_robotiq::frame::{ADDRESS, Activation, Command, Contact, State};
use hachi_robotiq::serve::{Asked, answer, request};
use serialport::{SerialPort, TTYPort};

/// What is done with a request.
#[derive(Debug, Clone, Copy)]
pub enum Behaviour {
    Answer,
    /// After this long.
    Late(Duration),
    Silent,
    /// With a bit of the answer turned over.
    Damaged,
    Refuse,
    /// Behind the answer to a read that nobody made.
    AnotherFirst,
}

enum Order {
    Object(Option<u8>),
    Fault(u8),
    PowerCut,
    Behave(Vec<Behaviour>),
    HangUp,
}

/// What the gripper saw of the computer.
#[derive(Debug)]
pub struct Seen {
    pub requests: u32,
    /// Requests with a wrong checksum or address, or of no form.
    pub damaged: u32,
    /// Shortest time from the end of a frame to the next request.
    pub shortest_silence: Duration,
}

pub struct Simulated {
    orders: Sender<Order>,
    /// Told of each late answer once it is on the line.
    late: Receiver<()>,
    thread: JoinHandle<Seen>,
}

impl Simulated {
    /// The gripper, and the port that a computer opens.
    pub fn start(behaviours: Vec<Behaviour>) -> (Self, TTYPort) {
        let (mut far, near) = TTYPort::pair().unwrap();
        far.set_timeout(Duration::from_millis(5)).unwrap();
        let (orders, received) = channel();
        let (told, late) = channel();
        let thread = thread::spawn(move || run(far, &received, &told, behaviours.into()));
        let gripper = Self {
            orders,
            late,
            thread,
        };
        (gripper, near)
    }

    /// Puts something between the fingers that stops them at a count, or takes it away.
    pub fn put_object(&self, count: Option<u8>) {
        self.orders.send(Order::Object(count)).unwrap();
    }

    pub fn fail(&self, fault: u8) {
        self.orders.send(Order::Fault(fault)).unwrap();
    }

    /// Takes its power away for a moment: it forgets that it was activated.
    pub fn cut_power(&self) {
        self.orders.send(Order::PowerCut).unwrap();
    }

    pub fn behave(&self, behaviours: Vec<Behaviour>) {
        self.orders.send(Order::Behave(behaviours)).unwrap();
    }

    /// Waits until a late answer is on the line.
    pub fn wait_for_late_answer(&self) {
        self.late.recv().unwrap();
    }

    /// Closes its end of the line.
    pub fn hang_up(self) {
        self.orders.send(Order::HangUp).unwrap();
        self.thread.join().unwrap();
    }

    /// Ends with the computer's end of the line.
    pub fn end<T>(self, computer: T) -> Seen {
        self.orders.send(Order::HangUp).unwrap();
        let seen = self.thread.join().unwrap();
        drop(computer);
        seen
    }
}

/// Fingers that move a part of their way with each report.
struct Fingers {
    command: Command,
    state: State,
    object: Option<u8>,
}

/// Reports until activation is done, and counts that the fingers move from one to the next.
const ACTIVATION_REPORTS: u8 = 3;
const STEP: u8 = 60;
/// Where the fingers end.
const ENDS: [u8; 2] = [3, 230];

impl Fingers {
    fn obey(&mut self, command: Command) {
        if !command.activate {
            self.state = State {
                position: self.state.position,
                ..State::default()
            };
        } else if self.state.activation == Activation::Reset {
            self.state.activation = Activation::Running;
            self.state.current = ACTIVATION_REPORTS;
        }
        self.command = command;
        self.state.activate = command.activate;
        self.state.go = command.go;
        self.state.asked = command.position;
        self.state.contact = Contact::Moving;
    }

    fn pass_time(&mut self) {
        let state = &mut self.state;
        match state.activation {
            Activation::Running if state.current > 0 => state.current -= 1,
            Activation::Running => {
                state.activation = Activation::Done;
                state.position = ENDS[0];
                state.contact = Contact::AtPosition;
            }
            Activation::Done if state.go => {
                let target = self.command.position.clamp(ENDS[0], ENDS[1]);
                let blocked = self.object.unwrap_or(255);
                let next = if target > state.position {
                    state.position.saturating_add(STEP).min(target).min(blocked)
                } else {
                    state.position.saturating_sub(STEP).max(target)
                };
                state.position = next;
                state.contact = if next == target {
                    Contact::AtPosition
                } else if next == blocked {
                    Contact::WhileClosing
                } else {
                    Contact::Moving
                };
            }
            _ => {}
        }
    }
}

fn run(
    mut line: TTYPort,
    orders: &Receiver<Order>,
    late: &Sender<()>,
    mut next: VecDeque<Behaviour>,
) -> Seen {
    let mut fingers = Fingers {
        command: Command::default(),
        state: State::default(),
        object: None,
    };
    let mut seen = Seen {
        requests: 0,
        damaged: 0,
        shortest_silence: Duration::MAX,
    };
    let mut last: Option<Instant> = None;
    let mut bytes = Vec::new();
    loop {
        let mut buffer = [0; 64];
        let read = line.read(&mut buffer);
        let arrived = Instant::now();
        // Orders come before the requests that were made after them.
        for order in orders.try_iter() {
            match order {
                Order::Object(count) => fingers.object = count,
                Order::Fault(fault) => fingers.state.fault = fault,
                Order::PowerCut => fingers.obey(Command::default()),
                Order::Behave(behaviours) => next = behaviours.into(),
                Order::HangUp => return seen,
            }
        }
        match read {
            Ok(len) => {
                if bytes.is_empty()
                    && let Some(last) = last
                {
                    seen.shortest_silence = seen.shortest_silence.min(arrived - last);
                }
                bytes.extend_from_slice(&buffer[..len]);
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => {
                // Silence ends a frame, whatever it was.
                if !bytes.is_empty() {
                    seen.damaged += 1;
                    bytes.clear();
                }
                continue;
            }
            // The computer's end is closed.
            Err(_) => return seen,
        }
        let whole = match bytes.get(1) {
            Some(0x10) => bytes
                .get(6)
                .is_some_and(|&n| bytes.len() >= 9 + usize::from(n)),
            _ => bytes.len() >= 8,
        };
        if !whole {
            continue;
        }
        last = Some(arrived);
        let asked = request(ADDRESS, &bytes, fingers.command);
        bytes.clear();
        let Some(asked) = asked else {
            seen.damaged += 1;
            continue;
        };
        seen.requests += 1;
        let behaviour = next.pop_front().unwrap_or(Behaviour::Answer);
        match asked {
            Asked::Write { command, .. } => fingers.obey(command),
            Asked::Read { .. } => fingers.pass_time(),
            Asked::Unknown { .. } => {}
        }
        let mut said = answer(ADDRESS, asked, &fingers.state);
        match behaviour {
            Behaviour::Answer => {}
            Behaviour::Late(by) => thread::sleep(by),
            Behaviour::Silent => continue,
            Behaviour::Damaged => said[2] ^= 1,
            Behaviour::Refuse => {
                let function = said[1];
                said = answer(ADDRESS, Asked::Unknown { function }, &fingers.state);
            }
            Behaviour::AnotherFirst => {
                let read = Asked::Read {
                    function: 3,
                    registers: 3,
                };
                line.write_all(&answer(ADDRESS, read, &fingers.state))
                    .unwrap();
                thread::sleep(Duration::from_millis(20));
            }
        }
        line.write_all(&said).unwrap();
        if matches!(behaviour, Behaviour::Late(_)) {
            // Nobody needs to listen.
            let _ = late.send(());
        }
        last = Some(Instant::now());
    }
}
