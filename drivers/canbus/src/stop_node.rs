//! An emergency stop whose contacts are wired to the inputs of a CANopen node (CiA 401): the node
//! sends its inputs when they change, and a heartbeat all the time.
//!
//! In: frames. Out: pressed or not. What matters is the other direction: everything that is not a
//! node in operation whose contacts say *closed* is *pressed*. A stop's contacts open when it is
//! pressed, so that a broken wire stops the robot too.
//!
//! The inputs themselves have no age: the node sends them when they change, and with a living
//! heartbeat the last ones stand for as long as that takes. A frame with them that is lost is lost
//! until they change again, so that nothing may overflow on their way: have the kernel leave out all
//! but [`StopNodeConfig::ids`]. After a silence they are no longer known, and are asked for by
//! [`StopNode::asks`].

use hachi_hal::Stamp;

use crate::frame::CanFrame;

/// Function codes of CiA 301's predefined connections; the node's number is added.
const EMERGENCY: u16 = 0x080;
const INPUTS: u16 = 0x180;
const HEARTBEAT: u16 = 0x700;

/// States in a heartbeat.
const OPERATIONAL: u8 = 0x05;
const BOOT_UP: u8 = 0x00;
const STOPPED: u8 = 0x04;
const PRE_OPERATIONAL: u8 = 0x7F;

/// Nodes have the numbers 1 to 127.
pub const NODES: core::ops::RangeInclusive<u8> = 1..=127;

/// How the stop is wired.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopNodeConfig {
    /// The node's number, 1 to 127.
    pub node: u8,
    /// The inputs that the contacts are wired to, a bit each, of the first eight: all must be
    /// closed.
    pub closed_inputs: u8,
    /// Silence of the heartbeat after which the node is taken for gone, ns: twice its period and
    /// a little.
    pub heartbeat_limit_ns: i64,
}

impl Default for StopNodeConfig {
    /// Node 1, two contacts at its first two inputs, a heartbeat every 100 ms.
    fn default() -> Self {
        Self {
            node: 1,
            closed_inputs: 0b11,
            heartbeat_limit_ns: 250_000_000,
        }
    }
}

impl StopNodeConfig {
    /// The identifiers of the frames that say something of the stop: emergency, inputs, heartbeat.
    pub fn ids(&self) -> [u16; 3] {
        [EMERGENCY, INPUTS, HEARTBEAT].map(|function| function + u16::from(self.node))
    }
}

/// Why the robot must stand still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// Nothing was heard of the node yet.
    NeverHeard,
    /// Its heartbeat is late: unplugged, unpowered, or the bus is down.
    Silent,
    /// The node is not in operation: just started, or told to stop.
    NotOperational,
    /// The node reports an error of its own.
    Emergency {
        /// CiA 301's number for it.
        code: u16,
    },
    /// Its inputs are not known since it went into operation.
    InputsUnknown,
    /// Some contacts are open and others closed: one has failed, or it is being pressed.
    Disagree,
    /// All contacts are open: somebody pressed it.
    Pressed,
}

impl StopReason {
    /// For a person.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NeverHeard => "nothing heard of the stop's node yet",
            Self::Silent => "the stop's node is silent: cable, power, bus",
            Self::NotOperational => "the stop's node is not in operation",
            Self::Emergency { .. } => "the stop's node reports an error",
            Self::InputsUnknown => "the stop's contacts are not known yet",
            Self::Disagree => "the stop's contacts disagree: have its wiring checked",
            Self::Pressed => "the stop is pressed",
        }
    }
}

/// Why a frame of the node was left out, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StopFrameError {
    /// Shorter than what it has to say.
    #[error("{got} bytes under {id:#05x}, {needed} are needed")]
    Length {
        /// Its identifier.
        id: u16,
        /// Bytes there.
        got: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// A heartbeat with a state that there is not.
    #[error("heartbeat state {got:#04x}")]
    State {
        /// The state.
        got: u8,
    },
}

/// What is known of the stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopNode {
    config: StopNodeConfig,
    heard: Option<Stamp>,
    operational: bool,
    inputs: Option<u8>,
    emergency: Option<u16>,
}

impl StopNode {
    /// A node of which nothing is known; `None` if its number or its inputs are none: a stop that
    /// watches no contact would never stop anything.
    pub fn new(config: StopNodeConfig) -> Option<Self> {
        let sound = NODES.contains(&config.node)
            && config.closed_inputs != 0
            && config.heartbeat_limit_ns > 0;
        sound.then_some(Self {
            config,
            heard: None,
            operational: false,
            inputs: None,
            emergency: None,
        })
    }

    /// Takes a frame in that came at `received`. `Ok(false)` if it is not this node's.
    ///
    /// # Errors
    /// The node's frame says nothing that can be understood; what was known before stands, and its
    /// age goes on.
    pub fn take(&mut self, frame: &CanFrame, received: Stamp) -> Result<bool, StopFrameError> {
        let (node, id, data) = (u16::from(self.config.node), frame.id(), frame.data());
        let length = |needed| StopFrameError::Length {
            id,
            got: data.len(),
            needed,
        };
        if frame.is_request() {
            return Ok(false);
        }
        if id == HEARTBEAT + node {
            let &state = data.first().ok_or(length(1))?;
            // The top bit is a toggle of an older protocol.
            match state & 0x7F {
                OPERATIONAL => self.operational = true,
                BOOT_UP | STOPPED | PRE_OPERATIONAL => {
                    self.operational = false;
                    // It sends its inputs anew when it goes into operation.
                    self.inputs = None;
                }
                _ => return Err(StopFrameError::State { got: state }),
            }
            // What it sent while nothing came through is lost.
            if self.is_silent(received) {
                self.inputs = None;
            }
            self.heard = Some(received);
        } else if id == INPUTS + node {
            let &inputs = data.first().ok_or(length(1))?;
            self.inputs = Some(inputs);
        } else if id == EMERGENCY + node {
            let code = data.first_chunk().ok_or(length(2))?;
            // Zero takes the error back.
            let code = u16::from_le_bytes(*code);
            self.emergency = Some(code).filter(|&code| code != 0);
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    /// Why the robot must stand still at `now`; `None` if it may move.
    pub fn reason(&self, now: Stamp) -> Option<StopReason> {
        if self.heard.is_none() {
            return Some(StopReason::NeverHeard);
        }
        if self.is_silent(now) {
            return Some(StopReason::Silent);
        }
        if !self.operational {
            return Some(StopReason::NotOperational);
        }
        if let Some(code) = self.emergency {
            return Some(StopReason::Emergency { code });
        }
        let Some(inputs) = self.inputs else {
            return Some(StopReason::InputsUnknown);
        };
        match inputs & self.config.closed_inputs {
            closed if closed == self.config.closed_inputs => None,
            0 => Some(StopReason::Pressed),
            _ => Some(StopReason::Disagree),
        }
    }

    /// The frame that asks for the inputs, where the node is in operation and they are not known: it
    /// sends them when they change, which a healthy one may never do.
    pub fn asks(&self) -> Option<CanFrame> {
        let unknown = self.operational && self.inputs.is_none();
        let request = CanFrame::request(INPUTS + u16::from(self.config.node))?;
        unknown.then_some(request)
    }

    /// Whether the last heartbeat is too old at `now`, or none at all: a stamp from the future is
    /// another clock, and no sign of life.
    fn is_silent(&self, now: Stamp) -> bool {
        let limit_ns = self.config.heartbeat_limit_ns;
        let age_ns = self.heard.map(|heard| now.nanos_since(heard));
        !age_ns.is_some_and(|age_ns| (0..=limit_ns).contains(&age_ns))
    }

    /// When its silence becomes a stop, if it moves now and nothing comes.
    pub fn falls_silent_at(&self) -> Option<Stamp> {
        self.heard
            .map(|heard| heard + self.config.heartbeat_limit_ns)
    }
}
