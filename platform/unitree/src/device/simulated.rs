//! The robot's side of the high-level service: waits to be spoken to, then answers.
//!
//! In: HighCmds from whoever speaks. Out: HighStates to whoever spoke last, at the robot's rate,
//! their contents changing as often as the robot's do and with the check value in the form that it
//! sends. When commands stop coming the body is told to stand still: what a real robot does then
//! is not documented. The body is anything that implements [`RobotBody`].

use std::io;
use std::net::{SocketAddr, UdpSocket};

use hachi_hal::Stamp;

use crate::frame::{CheckForm, Frame, HighCmd, HighState, LONGEST_FRAME, Layout, Model};
use crate::robot::Quadruped;

/// What moves inside a simulated robot.
pub trait RobotBody {
    /// Goes on for `dt_s` seconds under a command.
    fn step(&mut self, command: &HighCmd, dt_s: f64);
    /// Puts what its sensors show into a state.
    fn fill(&self, state: &mut HighState);
}

/// How a simulated robot speaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedRobotConfig {
    /// Address and port to be spoken to at; port 0 takes a free one.
    pub bind: SocketAddr,
    /// From one state to the next, ns.
    pub state_period_ns: i64,
    /// From one change of contents to the next, ns.
    pub refresh_ns: i64,
    /// Form of the check value of its states.
    pub check_form: CheckForm,
    /// Without commands for this long the body stands still, ns.
    pub stale_ns: i64,
}

impl SimulatedRobotConfig {
    /// As the robot speaks, on a free port of the loopback.
    pub fn for_robot(robot: &Quadruped) -> Self {
        let period = |hertz: f64| (1e9 / hertz) as i64;
        Self {
            bind: SocketAddr::from(([127, 0, 0, 1], 0)),
            state_period_ns: period(robot.high_state_hz),
            refresh_ns: period(robot.refresh_hz),
            // The maker's library takes nothing else from a Go1, and either from a B1.
            check_form: match robot.layout.model {
                Model::Go1 => CheckForm::Transformed,
                Model::B1 => CheckForm::Plain,
            },
            stale_ns: 250_000_000,
        }
    }
}

/// What a simulated robot saw and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SimulatedCounters {
    /// Whole commands.
    pub commands: u64,
    /// Datagrams that were none.
    pub refused: u64,
    /// States sent.
    pub states: u64,
    /// Of these, lost on the way out.
    pub unsent: u64,
    /// Times that the commands stopped coming.
    pub stale: u64,
}

/// What a simulated robot does with frames, whatever carries them. It has no thread and no clock.
#[derive(Debug)]
pub struct SimulatedService<B> {
    layout: Layout,
    config: SimulatedRobotConfig,
    body: B,
    command: HighCmd,
    heard: Option<Stamp>,
    is_stale: bool,
    stepped: Option<Stamp>,
    refreshed: Option<Stamp>,
    sent: Option<Stamp>,
    frame: Option<Frame>,
    counters: SimulatedCounters,
}

impl<B: RobotBody> SimulatedService<B> {
    /// A robot that nobody has spoken to yet.
    pub fn new(layout: &Layout, body: B, config: SimulatedRobotConfig) -> Self {
        Self {
            layout: *layout,
            body,
            config,
            command: HighCmd::default(),
            heard: None,
            is_stale: false,
            stepped: None,
            refreshed: None,
            sent: None,
            frame: None,
            counters: SimulatedCounters::default(),
        }
    }

    /// Takes in a datagram; whether it was a whole command.
    pub fn hear(&mut self, bytes: &[u8], now: Stamp) -> bool {
        match HighCmd::decode(&self.layout, bytes) {
            Ok((command, _)) if command.check_finite().is_ok() => {
                self.counters.commands += 1;
                self.command = command;
                self.heard = Some(now);
                self.is_stale = false;
                true
            }
            _ => {
                self.counters.refused += 1;
                false
            }
        }
    }

    /// Moves the body on to `now`; the state that is due to whoever has spoken.
    pub fn step(&mut self, now: Stamp) -> Option<&Frame> {
        let dt_s = self.stepped.map_or(0.0, |last| now.secs_since(last));
        self.stepped = Some(now);
        let command = self.in_force(now);
        self.body.step(&command, dt_s.clamp(0.0, 0.1));
        let due = |last: Option<Stamp>, period: i64| {
            last.is_none_or(|last| now.nanos_since(last) >= period)
        };
        self.heard?;
        if due(self.refreshed, self.config.refresh_ns) {
            let mut state = HighState::of(&self.layout);
            self.body.fill(&mut state);
            self.frame = Some(state.encode(self.config.check_form));
            self.refreshed = Some(now);
        }
        if !due(self.sent, self.config.state_period_ns) {
            return None;
        }
        self.sent = Some(now);
        self.counters.states += 1;
        self.frame.as_ref()
    }

    /// The last command; standing still where it is too old.
    fn in_force(&mut self, now: Stamp) -> HighCmd {
        let fresh = self
            .heard
            .is_some_and(|heard| now.nanos_since(heard) < self.config.stale_ns);
        let mut command = self.command;
        if !fresh {
            self.counters.stale += u64::from(!self.is_stale && self.heard.is_some());
            self.is_stale = true;
            (command.velocity, command.yaw_speed) = ([0.0; 2], 0.0);
        }
        command
    }

    /// The last whole command.
    pub fn command(&self) -> &HighCmd {
        &self.command
    }

    /// The body.
    pub fn body(&self) -> &B {
        &self.body
    }

    /// The body, to push it about.
    pub fn body_mut(&mut self) -> &mut B {
        &mut self.body
    }

    /// What happened so far.
    pub fn counters(&self) -> SimulatedCounters {
        self.counters
    }
}

/// A simulated robot behind a UDP port. It has no thread and no clock: whoever owns it calls
/// [`Self::step`].
#[derive(Debug)]
pub struct SimulatedRobot<B> {
    service: SimulatedService<B>,
    socket: UdpSocket,
    address: SocketAddr,
    peer: Option<SocketAddr>,
}

/// Commands taken in at one step; more stay in the socket.
const MOST_AT_ONCE: usize = 64;

impl<B: RobotBody> SimulatedRobot<B> {
    /// Opens the robot's port.
    ///
    /// # Errors
    /// The port is taken.
    pub fn open(layout: &Layout, body: B, config: SimulatedRobotConfig) -> io::Result<Self> {
        let socket = UdpSocket::bind(config.bind)?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            service: SimulatedService::new(layout, body, config),
            address: socket.local_addr()?,
            socket,
            peer: None,
        })
    }

    /// Where it is spoken to.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Takes in what was sent, moves the body on to `now`, and answers if it is time.
    ///
    /// # Errors
    /// The socket can't be read any more.
    pub fn step(&mut self, now: Stamp) -> io::Result<()> {
        self.listen(now)?;
        let frame = self.service.step(now);
        if let (Some(frame), Some(peer)) = (frame, self.peer) {
            // As on a wire: nobody hears of what is lost.
            let unsent = self.socket.send_to(frame.as_bytes(), peer).is_err();
            self.service.counters.unsent += u64::from(unsent);
        }
        Ok(())
    }

    fn listen(&mut self, now: Stamp) -> io::Result<()> {
        for _ in 0..MOST_AT_ONCE {
            let mut buffer = [0; LONGEST_FRAME + 1];
            match self.socket.recv_from(&mut buffer) {
                Ok((len, peer)) => {
                    if self.service.hear(&buffer[..len], now) {
                        self.peer = Some(peer);
                    }
                }
                Err(error) => match error.kind() {
                    io::ErrorKind::WouldBlock => break,
                    // Somebody who was answered is no longer there.
                    io::ErrorKind::Interrupted | io::ErrorKind::ConnectionRefused => {}
                    _ => return Err(error),
                },
            }
        }
        Ok(())
    }

    /// Sends a datagram of one's own making to whoever spoke last: faults for tests. Whether there
    /// was anybody.
    pub fn inject(&mut self, bytes: &[u8]) -> bool {
        self.peer
            .is_some_and(|peer| self.socket.send_to(bytes, peer).is_ok())
    }

    /// The last whole command.
    pub fn command(&self) -> &HighCmd {
        self.service.command()
    }

    /// The body.
    pub fn body(&self) -> &B {
        self.service.body()
    }

    /// The body, to push it about.
    pub fn body_mut(&mut self) -> &mut B {
        self.service.body_mut()
    }

    /// What happened so far.
    pub fn counters(&self) -> SimulatedCounters {
        self.service.counters()
    }
}
