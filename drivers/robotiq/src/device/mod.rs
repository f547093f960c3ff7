//! The gripper over a line of bytes, as [`Gripper`].
//!
//! In: a [`Line`]. Out: commands in the gripper's counts, reports in metres, and a count of what went
//! wrong on the line. Elsewhere: frames (`frame`).
//!
//! The gripper moves while it is activated, so nothing here activates it but
//! [`Gripper::activate`]: after a fault or a power cut whoever knows what is between the fingers
//! decides.

mod line;
mod talk;

use hachi_hal::{
    Clock, DeviceError, FaultKind, Grip, Gripper, GripperCommand, GripperSample, Stamp,
};

use crate::frame::{
    ADDRESS, Activation, Command, Contact, FrameError, Request, State, fault_name, is_major,
};
pub use line::{Line, LineError, SerialLine};
use talk::Talk;

/// How far the fingers open, metres.
const STROKE_M: f64 = 0.085;
/// Slowest and fastest closing, m/s.
const SPEED_M_S: [f64; 2] = [0.020, 0.150];
/// Least and most force, N.
const FORCE_N: [f64; 2] = [20.0, 235.0];

/// Which gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotiqConfig {
    /// Its Modbus address.
    pub address: u8,
    /// What it reports with its fingers open.
    pub open_count: u8,
    /// What it reports with its fingers closed, which is less than the 255 that closes them.
    pub closed_count: u8,
}

impl Default for RobotiqConfig {
    /// A 2F-85 as it is delivered.
    fn default() -> Self {
        Self {
            address: ADDRESS,
            open_count: 3,
            closed_count: 230,
        }
    }
}

/// Counts of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RobotiqCounters {
    /// Requests sent.
    pub requests: u64,
    /// Answers taken.
    pub answers: u64,
    /// Requests without an answer in time.
    pub silent: u64,
    /// Answers that were damaged, refused or about something else.
    pub bad_answers: u64,
    /// Bytes that belong to no answer that was waited for.
    pub stray_bytes: u64,
}

impl RobotiqCounters {
    /// Reasons for which something was left out or asked again, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("silent", self.silent),
            ("bad_answers", self.bad_answers),
            ("stray_bytes", self.stray_bytes),
        ]
        .into_iter()
    }
}

/// Why the gripper does not do or say what it was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GripperError {
    /// The line.
    #[error(transparent)]
    Line(#[from] LineError),
    /// No answer.
    #[error("the gripper does not answer: is it powered, and its address and baud rate as set?")]
    Silent,
    /// An answer that is none.
    #[error("the gripper's answer: {0}")]
    Frame(#[from] FrameError),
    /// Bytes without end.
    #[error("the line is never silent: is something else connected to it?")]
    Babble,
    /// It has to be activated.
    #[error("the gripper is not ready: activate it, with nothing between its fingers")]
    NotReady,
    /// A number is not finite.
    #[error("a number of the command is not finite")]
    NotFinite,
    /// The gripper says what is wrong.
    #[error("the gripper has fault {code:#x}: {}{}", fault_name(*code), if is_major(*code) { "; activate it anew" } else { "" })]
    Fault {
        /// The gripper's number for it.
        code: u8,
    },
}

impl DeviceError for GripperError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Line(error) => error.kind(),
            Self::Fault { code } if is_major(*code) => FaultKind::Reopen,
            Self::NotReady => FaultKind::Reopen,
            Self::Babble => FaultKind::FixConfig,
            Self::Silent | Self::Frame(_) | Self::NotFinite | Self::Fault { .. } => {
                FaultKind::ReadAgain
            }
        }
    }
}

/// A 2F-85.
#[derive(Debug)]
pub struct Robotiq<L, C> {
    talk: Talk<L, C>,
    config: RobotiqConfig,
    /// What it was told last.
    told: Command,
    /// What it said last.
    state: State,
    last_stamp: Option<Stamp>,
}

impl<L: Line, C: Clock> Robotiq<L, C> {
    /// A gripper at the end of `line`. Nothing is sent yet.
    pub fn new(line: L, clock: C, config: RobotiqConfig) -> Self {
        Self {
            talk: Talk::new(line, clock, config.address),
            config,
            told: Command::default(),
            state: State::default(),
            last_stamp: None,
        }
    }

    /// What happened on the line so far.
    pub fn counters(&self) -> RobotiqCounters {
        self.talk.counters
    }

    /// What the gripper said last: motor current and fault besides what [`Gripper`] gives.
    pub fn state(&self) -> &State {
        &self.state
    }

    fn tell(&mut self, command: Command) -> Result<(), GripperError> {
        self.talk.request(Request::Write(command))?;
        self.told = command;
        Ok(())
    }

    /// Metres between the fingers at a count.
    fn opening_m(&self, count: u8) -> f64 {
        let [open, closed] = [self.config.open_count, self.config.closed_count].map(f64::from);
        let share = (closed - f64::from(count)) / (closed - open).max(1.0);
        STROKE_M * share.clamp(0.0, 1.0)
    }

    /// The count to ask for. The ends of the stroke are asked for as its ends, wherever they are.
    fn count(&self, opening_m: f64) -> u8 {
        let [open, closed] = [self.config.open_count, self.config.closed_count].map(f64::from);
        if opening_m <= 0.0 {
            255
        } else if opening_m >= STROKE_M {
            0
        } else {
            (closed - opening_m / STROKE_M * (closed - open)).round() as u8
        }
    }

    fn grip(&self) -> Grip {
        let State {
            activation,
            contact,
            go,
            ..
        } = self.state;
        match (activation, contact) {
            (Activation::Done, Contact::WhileOpening | Contact::WhileClosing) => Grip::Holding,
            (Activation::Done, Contact::Moving) if go => Grip::Moving,
            (Activation::Done, _) => Grip::Free,
            _ => Grip::NotReady,
        }
    }
}

/// Where `value` lies between two limits, in 255ths.
fn share(value: f64, [least, most]: [f64; 2]) -> u8 {
    ((value - least) / (most - least) * 255.0)
        .round()
        .clamp(0.0, 255.0) as u8
}

impl<L: Line, C: Clock> Gripper for Robotiq<L, C> {
    type Error = GripperError;

    fn stroke_m(&self) -> f64 {
        STROKE_M
    }

    fn activate(&mut self) -> Result<(), GripperError> {
        self.state = State::default();
        // Clearing the bit clears faults, setting it begins.
        self.tell(Command::default())?;
        self.tell(Command {
            activate: true,
            ..Command::default()
        })
    }

    fn command(&mut self, command: &GripperCommand) -> Result<(), GripperError> {
        if !command.is_finite() {
            return Err(GripperError::NotFinite);
        }
        if self.state.activation != Activation::Done {
            return Err(GripperError::NotReady);
        }
        self.tell(Command {
            activate: true,
            go: true,
            release: false,
            position: self.count(command.opening_m),
            speed: share(command.speed_m_s, SPEED_M_S),
            force: share(command.force_n, FORCE_N),
        })
    }

    fn stop(&mut self) -> Result<(), GripperError> {
        // What it was told last may be another program's word, or of before a power cut. Clearing its
        // activation would let go of what it holds, setting it would move its fingers: it is kept as
        // the gripper says that it is.
        if let Some(state) = self.talk.request(Request::Read)? {
            self.state = state;
        }
        if !self.state.activate {
            return Ok(());
        }
        self.tell(Command {
            activate: true,
            go: false,
            ..self.told
        })
    }

    fn read_gripper(&mut self, deadline: Stamp) -> Result<Option<GripperSample>, GripperError> {
        let Some((asked, state)) = self.talk.read(deadline)? else {
            return Ok(None);
        };
        self.state = state;
        match state.fault {
            // Waiting, not activated, silent for a while: said by the other fields, or over.
            0 | 0x5 | 0x7 | 0x9 => {}
            code => return Err(GripperError::Fault { code }),
        }
        // Two requests within a tick of the clock.
        let stamp = match self.last_stamp {
            Some(last) if asked <= last => last + 1,
            _ => asked,
        };
        self.last_stamp = Some(stamp);
        Ok(Some(GripperSample {
            stamp,
            opening_m: self.opening_m(state.position),
            grip: self.grip(),
        }))
    }
}
