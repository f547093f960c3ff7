//! What carries frames between host and robot: a socket, or two queues in one program.

use std::collections::VecDeque;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};

use hachi_datagram::{SystemClock, UdpConfig, UdpError, UdpSource};
use hachi_hal::{Clock, PacketSource, Received, Stamp};

use crate::frame::LONGEST_FRAME;

/// Both directions of a link to a robot, from the host's side.
pub trait RobotLink: PacketSource<Error = UdpError> {
    /// Sends a frame to the robot.
    ///
    /// # Errors
    /// It can't be sent now.
    fn send(&mut self, payload: &[u8]) -> Result<(), UdpError>;

    /// The clock that stamps what comes.
    fn now(&self) -> Stamp;
}

/// A link over UDP.
#[derive(Debug)]
pub struct UdpLink {
    pub(super) source: UdpSource,
    robot: SocketAddr,
}

impl UdpLink {
    /// Opens the host's port; 0 takes a free one.
    ///
    /// # Errors
    /// The port is taken.
    pub fn open(
        robot: SocketAddr,
        local: (IpAddr, u16),
        clock: SystemClock,
    ) -> Result<Self, UdpError> {
        let udp = UdpConfig {
            bind_address: local.0,
            source_address: Some(robot.ip()),
            ..UdpConfig::on_ports(&[local.1])
        };
        let source = UdpSource::open(&udp, clock)?;
        Ok(Self { source, robot })
    }
}

impl PacketSource for UdpLink {
    type Error = UdpError;

    fn receive(&mut self, buffer: &mut [u8], until: Stamp) -> Result<Option<Received>, UdpError> {
        self.source.receive(buffer, until)
    }

    fn at_end(&self) -> bool {
        false
    }
}

impl RobotLink for UdpLink {
    fn send(&mut self, payload: &[u8]) -> Result<(), UdpError> {
        self.source.send(payload, self.robot)
    }

    fn now(&self) -> Stamp {
        self.source.clock().now()
    }
}

/// Frames that wait in a [`MemoryLink`]; more are lost, the oldest first, as in a socket's buffer.
const MOST_WAITING: usize = 64;

/// A frame on its way.
pub type WireFrame = heapless::Vec<u8, LONGEST_FRAME>;

#[derive(Debug)]
struct Wires {
    to_robot: VecDeque<WireFrame>,
    to_host: VecDeque<(Stamp, WireFrame)>,
}

impl Default for Wires {
    /// With room for all that may wait.
    fn default() -> Self {
        Self {
            to_robot: VecDeque::with_capacity(MOST_WAITING),
            to_host: VecDeque::with_capacity(MOST_WAITING),
        }
    }
}

/// Host and robot in one program, on any clock: what one sends, the other has at once. Clones are
/// the same wire; the simulated robot's side keeps one.
#[derive(Debug, Clone)]
pub struct MemoryLink<C> {
    wires: Arc<Mutex<Wires>>,
    clock: C,
}

impl<C: Clock> MemoryLink<C> {
    /// A wire without frames on it.
    pub fn new(clock: C) -> Self {
        Self {
            wires: Arc::default(),
            clock,
        }
    }

    fn wires(&self) -> std::sync::MutexGuard<'_, Wires> {
        // Frames are whole or not there: a panic elsewhere leaves no half.
        self.wires.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The robot's side: the oldest frame from the host.
    pub fn heard(&self) -> Option<WireFrame> {
        self.wires().to_robot.pop_front()
    }

    /// The robot's side: a frame to the host. One that is longer than any frame is lost.
    pub fn answer(&self, payload: &[u8]) {
        let stamp = self.clock.now();
        let Ok(frame) = WireFrame::from_slice(payload) else {
            return;
        };
        let queue = &mut self.wires().to_host;
        if queue.len() >= MOST_WAITING {
            queue.pop_front();
        }
        queue.push_back((stamp, frame));
    }
}

impl<C: Clock> PacketSource for MemoryLink<C> {
    type Error = UdpError;

    /// Does not wait: in one program nothing comes while it does.
    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, UdpError> {
        let Some((stamp, bytes)) = self.wires().to_host.pop_front() else {
            return Ok(None);
        };
        let (len, capacity) = (bytes.len(), buffer.len());
        let room = buffer.get_mut(..len).ok_or(UdpError::Oversize {
            port: 0,
            len,
            capacity,
        })?;
        room.copy_from_slice(&bytes);
        Ok(Some(Received {
            len,
            stamp,
            port: 0,
        }))
    }

    fn at_end(&self) -> bool {
        false
    }
}

impl<C: Clock> RobotLink for MemoryLink<C> {
    fn send(&mut self, payload: &[u8]) -> Result<(), UdpError> {
        let Ok(frame) = WireFrame::from_slice(payload) else {
            return Err(UdpError::Oversize {
                port: 0,
                len: payload.len(),
                capacity: LONGEST_FRAME,
            });
        };
        let queue = &mut self.wires().to_robot;
        if queue.len() >= MOST_WAITING {
            queue.pop_front();
        }
        queue.push_back(frame);
        Ok(())
    }

    fn now(&self) -> Stamp {
        self.clock.now()
    }
}
