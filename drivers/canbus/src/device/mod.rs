//! Nodes on a bus that is real: the emergency stop as [`EmergencyStop`], an ODrive axis.
//!
//! In: a [`CanBus`] and the robot's clock. Out: whether the stop is pressed, with its reason; what an
//! axis says, and whether it can be relied on. Elsewhere: what frames mean (`stop_node`, `odrive`).

mod bus;
#[cfg(target_os = "linux")]
mod socket;

use hachi_hal::{Clock, DeviceError, EmergencyStop, FaultKind, Stamp, StopSample};

use crate::frame::CanFrame;
use crate::odrive::{Command, CommandError, Message};
use crate::stop_node::{StopNode, StopNodeConfig, StopReason};
pub use bus::{BusError, CanBus, Received};
#[cfg(target_os = "linux")]
pub use socket::SocketCan;

/// An axis's heartbeat comes every 100 ms; without it for this long it is taken for gone, ns.
const AXIS_LIMIT_NS: i64 = 300_000_000;

/// An emergency stop on a bus.
///
/// It reports with each of its node's frames, and at the deadline whenever the robot must stand
/// still because nothing is heard: a reader is told *pressed* and need not count silence itself.
#[derive(Debug)]
pub struct CanStop<B, C> {
    bus: B,
    clock: C,
    node: StopNode,
    last: Option<Stamp>,
    asked: Option<Stamp>,
    bad_frames: u64,
}

/// From one time that the inputs are asked for to the next, ns.
const ASKED_EVERY_NS: i64 = 100_000_000;

impl<B: CanBus, C: Clock> CanStop<B, C> {
    /// A stop behind a node on `bus`, which on a real robot is opened by
    /// `SocketCan::open_for(interface, &config.ids())`; `None` if the settings watch no contact of any node.
    pub fn new(bus: B, clock: C, config: StopNodeConfig) -> Option<Self> {
        Some(Self {
            bus,
            clock,
            node: StopNode::new(config)?,
            last: None,
            asked: None,
            bad_frames: 0,
        })
    }

    /// Why the robot must stand still now; `None` if it may move.
    pub fn reason(&self) -> Option<StopReason> {
        self.node.reason(self.clock.now())
    }

    /// Frames of the node that could not be understood.
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }

    /// Takes in a frame that has come, if one has, and does not wait.
    /// [`reason`](Self::reason) then says what follows.
    ///
    /// # Errors
    /// The bus is down.
    pub fn take_in(&mut self) -> Result<bool, BusError> {
        self.ask()?;
        let now = self.clock.now();
        let Some((frame, received)) = bus::receive(&mut self.bus, &self.clock, now)? else {
            return Ok(false);
        };
        self.take(&frame, received);
        Ok(true)
    }

    /// Whether a frame was one of the node's.
    fn take(&mut self, frame: &CanFrame, received: Stamp) -> bool {
        let taken = self.node.take(frame, received);
        self.bad_frames += u64::from(taken.is_err());
        taken.unwrap_or(false)
    }

    /// Asks the node for its inputs, where they are not known.
    fn ask(&mut self) -> Result<(), BusError> {
        let now = self.clock.now();
        let waits = |asked: Stamp| now.nanos_since(asked) < ASKED_EVERY_NS;
        let Some(request) = self.node.asks().filter(|_| !self.asked.is_some_and(waits)) else {
            return Ok(());
        };
        self.asked = Some(now);
        match self.bus.send(&request) {
            // It is asked again.
            Ok(()) | Err(BusError::Full) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn sample(&mut self, at: Stamp) -> StopSample {
        let stamp = self.last.map_or(at, |last| at.max(last + 1));
        self.last = Some(stamp);
        StopSample {
            stamp,
            pressed: self.reason().is_some(),
        }
    }
}

impl<B: CanBus, C: Clock> EmergencyStop for CanStop<B, C> {
    type Error = BusError;

    fn read_stop(&mut self, deadline: Stamp) -> Result<Option<StopSample>, BusError> {
        loop {
            self.ask()?;
            // Falling silent is news: it is not waited for longer than until then.
            let moving = self.reason().is_none();
            let silent_at = self.node.falls_silent_at().filter(|_| moving);
            let until = silent_at.map_or(deadline, |at| deadline.min(at + 1));
            match bus::receive(&mut self.bus, &self.clock, until)? {
                Some((frame, received)) if self.take(&frame, received) => {
                    return Ok(Some(self.sample(received)));
                }
                Some(_) => {}
                None if self.reason().is_some() => {
                    let now = self.clock.now();
                    return Ok(Some(self.sample(now)));
                }
                None => {}
            }
            if self.clock.now() >= deadline {
                return Ok(None);
            }
        }
    }
}

/// Why an axis cannot be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum AxisFault {
    /// Nothing was heard of it yet.
    NeverHeard,
    /// Its heartbeat is late.
    Silent,
    /// It reports errors.
    Errors {
        /// Its own, a bit each.
        axis: u32,
        /// Whether motor, encoder, controller have some.
        parts: [bool; 3],
    },
}

/// Why an axis was not told something.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AxisError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The command.
    #[error(transparent)]
    Command(#[from] CommandError),
}

impl DeviceError for AxisError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Bus(error) => error.kind(),
            Self::Command(CommandError::Node { .. }) => FaultKind::FixConfig,
            Self::Command(_) => FaultKind::ReadAgain,
        }
    }
}

/// One axis of an ODrive.
#[derive(Debug)]
pub struct OdriveAxis<B, C> {
    bus: B,
    clock: C,
    node: u8,
    /// When the last heartbeat came, and what errors it reported.
    heartbeat: Option<(Stamp, u32, [bool; 3])>,
    bad_frames: u64,
}

impl<B: CanBus, C: Clock> OdriveAxis<B, C> {
    /// The axis with this number on `bus`.
    pub fn new(bus: B, clock: C, node: u8) -> Self {
        Self {
            bus,
            clock,
            node,
            heartbeat: None,
            bad_frames: 0,
        }
    }

    /// Tells it something. Nothing comes back: its heartbeat says what it does.
    ///
    /// # Errors
    /// The command cannot be told, or the bus does not take it.
    pub fn tell(&mut self, command: &Command) -> Result<(), AxisError> {
        Ok(self.bus.send(&command.encode(self.node)?)?)
    }

    /// What it says next and when, until `deadline`.
    ///
    /// # Errors
    /// The bus is down.
    pub fn read(&mut self, deadline: Stamp) -> Result<Option<(Stamp, Message)>, BusError> {
        loop {
            let Some((frame, at)) = bus::receive(&mut self.bus, &self.clock, deadline)? else {
                return Ok(None);
            };
            match Message::decode(self.node, &frame) {
                Ok(Some(message)) => {
                    if let Message::Heartbeat {
                        axis_errors,
                        part_errors,
                        ..
                    } = message
                    {
                        self.heartbeat = Some((at, axis_errors, part_errors));
                    }
                    return Ok(Some((at, message)));
                }
                Ok(None) => {}
                Err(_) => self.bad_frames += 1,
            }
            if self.clock.now() >= deadline {
                return Ok(None);
            }
        }
    }

    /// Why it cannot be relied on now; `None` if it can.
    pub fn fault(&self) -> Option<AxisFault> {
        let Some((heard, axis, parts)) = self.heartbeat else {
            return Some(AxisFault::NeverHeard);
        };
        if self.clock.now().nanos_since(heard) > AXIS_LIMIT_NS {
            Some(AxisFault::Silent)
        } else if axis != 0 || parts.contains(&true) {
            Some(AxisFault::Errors { axis, parts })
        } else {
            None
        }
    }

    /// Frames of the axis that could not be understood.
    pub fn bad_frames(&self) -> u64 {
        self.bad_frames
    }
}
