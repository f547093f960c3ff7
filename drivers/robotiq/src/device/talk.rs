//! Requests and answers over a line: one at a time, with silence between, and never an answer taken
//! for another's.

use std::thread;
use std::time::Duration;

use hachi_hal::{Clock, Stamp};
use heapless::Vec;

use super::line::Line;
use super::{GripperError, RobotiqCounters};
use crate::frame::{FrameError, Request, State};

/// The gripper answers within 16 ms; after this it does not any more, ns.
const ANSWER_NS: i64 = 200_000_000;
/// Silence that ends a frame: 3.5 characters, and no less than this above 19,200 bits a second
/// (MODBUS over serial line, section 2.5.1.1).
const SILENCE: Duration = Duration::from_micros(1_750);
/// How often a request is made again before it counts as failed. All of them may be: they set
/// registers to values, they do not count.
const ATTEMPTS: usize = 2;
/// A line that is never silent for so many looks is babbling.
const MOST_LOOKS: usize = 64;

/// A request that was sent and not answered yet.
#[derive(Debug, Clone, Copy)]
struct Open {
    request: Request,
    sent: Stamp,
}

/// One end of the line.
#[derive(Debug)]
pub(super) struct Talk<L, C> {
    line: L,
    clock: C,
    address: u8,
    open: Option<Open>,
    /// What has come of the answer.
    bytes: Vec<u8, 64>,
    pub counters: RobotiqCounters,
}

impl<L: Line, C: Clock> Talk<L, C> {
    pub fn new(line: L, clock: C, address: u8) -> Self {
        Self {
            line,
            clock,
            address,
            open: None,
            bytes: Vec::new(),
            counters: RobotiqCounters::default(),
        }
    }

    /// Asks for the state, or goes on waiting for it, until `deadline`: when it was asked for and
    /// what it is, or `None` if the answer may still come.
    pub fn read(&mut self, deadline: Stamp) -> Result<Option<(Stamp, State)>, GripperError> {
        if self.open.is_none() {
            self.send(Request::Read)?;
        }
        let sent = self.open.map_or_else(|| self.clock.now(), |open| open.sent);
        Ok(self.wait(deadline)?.flatten().map(|state| (sent, state)))
    }

    /// Makes a request and waits for its answer, again if it fails: the state, if it asks for it.
    pub fn request(&mut self, request: Request) -> Result<Option<State>, GripperError> {
        // An answer that is still to come is heard first, so that it is not taken for this one's.
        if let Some(open) = self.open {
            let _ = self.wait(open.sent + ANSWER_NS);
        }
        let mut failure = GripperError::Silent;
        for _ in 0..ATTEMPTS {
            self.send(request)?;
            let limit = self.clock.now() + ANSWER_NS;
            match self.wait(limit) {
                Ok(Some(answer)) => return Ok(answer),
                Ok(None) => {}
                Err(error @ (GripperError::Silent | GripperError::Frame(_))) => failure = error,
                Err(error) => return Err(error),
            }
        }
        Err(failure)
    }

    fn send(&mut self, request: Request) -> Result<(), GripperError> {
        self.silence()?;
        self.bytes.clear();
        self.line.send(&request.encode(self.address))?;
        self.counters.requests += 1;
        let sent = self.clock.now();
        self.open = Some(Open { request, sent });
        Ok(())
    }

    /// Waits until nothing has come for as long as ends a frame. What comes belongs to an answer
    /// that was given up.
    fn silence(&mut self) -> Result<(), GripperError> {
        let mut stray = [0; 64];
        thread::sleep(SILENCE);
        for _ in 0..MOST_LOOKS {
            match self.line.receive(&mut stray, Duration::ZERO)? {
                0 => return Ok(()),
                len => self.counters.stray_bytes += len as u64,
            }
            thread::sleep(SILENCE);
        }
        Err(GripperError::Babble)
    }

    /// Waits for the open request's answer until `deadline`; `None` if it may still come.
    fn wait(&mut self, deadline: Stamp) -> Result<Option<Option<State>>, GripperError> {
        let Some(Open { request, sent }) = self.open else {
            return Ok(None);
        };
        let give_up = sent + ANSWER_NS;
        loop {
            match request.answer_len(&self.bytes) {
                Some(len) if self.bytes.len() >= len => {
                    let answer = request.answer(self.address, &self.bytes[..len]);
                    match answer {
                        Err(FrameError::Function { .. } | FrameError::Address { .. }) => {
                            // Whole, and another's: late, or not for us. Ours is still to come.
                            self.counters.stray_bytes += self.bytes.len() as u64;
                            self.bytes.clear();
                        }
                        Ok(state) => {
                            self.open = None;
                            self.counters.answers += 1;
                            return Ok(Some(state));
                        }
                        Err(error) => {
                            self.open = None;
                            self.counters.bad_answers += 1;
                            return Err(error.into());
                        }
                    }
                }
                _ => {}
            }
            let now = self.clock.now();
            if now >= give_up {
                self.open = None;
                self.counters.silent += 1;
                return Err(GripperError::Silent);
            }
            if now >= deadline {
                return Ok(None);
            }
            let left_ns = deadline.min(give_up).nanos_since(now);
            self.listen(Duration::from_nanos(left_ns.unsigned_abs()))?;
        }
    }

    fn listen(&mut self, limit: Duration) -> Result<(), GripperError> {
        let mut buffer = [0; 64];
        let room = (self.bytes.capacity() - self.bytes.len()).max(1);
        let len = self.line.receive(&mut buffer[..room], limit)?;
        if self.bytes.extend_from_slice(&buffer[..len]).is_err() {
            // Longer than any answer: not one.
            self.counters.stray_bytes += (self.bytes.len() + len) as u64;
            self.bytes.clear();
        }
        Ok(())
    }
}
