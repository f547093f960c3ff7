//! CAN interfaces of this machine, through SocketCAN.

use std::io::{Error, ErrorKind};
use std::time::{Duration, Instant, SystemTime};
use std::vec::Vec;

use embedded_can::{Frame as _, Id, StandardId};
use socketcan::{CanFrame as SocketFrame, CanSocket, Socket as _, SocketOptions as _};

use super::bus::{BusError, CanBus, Received};
use crate::frame::CanFrame;

/// A frame that the interface's queue takes no room for within this is not sent.
const SEND_LIMIT: Duration = Duration::from_millis(20);
/// Shortest time that a socket can be told to wait: zero would be for ever.
const SHORTEST: Duration = Duration::from_millis(1);

/// What has to agree with a filter: the eleven bits of the identifier, and that it has no more.
const SAME_ID: u32 = 0x8000_07FF;

/// A CAN interface: `can0`, `vcan0`.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    blocking: bool,
    foreign: u64,
}

impl SocketCan {
    /// Opens an interface by its name.
    ///
    /// # Errors
    /// There is none, or the system has no CAN.
    pub fn open(interface: &str) -> Result<Self, BusError> {
        let failed = |source| BusError::Open {
            interface: interface.into(),
            source,
        };
        let socket = CanSocket::open(interface).map_err(failed)?;
        socket.set_recv_timestamp(true).map_err(failed)?;
        socket.set_write_timeout(SEND_LIMIT).map_err(failed)?;
        Ok(Self {
            socket,
            blocking: true,
            foreign: 0,
        })
    }

    /// Opens an interface for frames under these identifiers alone: the kernel leaves out the others,
    /// so that what they say to each other can't fill the queue while its reader is busy.
    ///
    /// # Errors
    /// As [`SocketCan::open`].
    pub fn open_for(interface: &str, ids: &[u16]) -> Result<Self, BusError> {
        let opened = Self::open(interface)?;
        let filters = ids.iter().map(|&id| (u32::from(id), SAME_ID));
        let filters: Vec<(u32, u32)> = filters.collect();
        let failed = |source| BusError::Open {
            interface: interface.into(),
            source,
        };
        opened.socket.set_filters(&filters).map_err(failed)?;
        Ok(opened)
    }

    /// Whether reading waits: who has no time is told at once that there is nothing.
    fn set_blocking(&mut self, blocking: bool) -> Result<(), BusError> {
        if self.blocking != blocking {
            let set = self.socket.set_nonblocking(!blocking);
            set.map_err(BusError::Down)?;
            self.blocking = blocking;
        }
        Ok(())
    }

    /// Frames left out because they have identifiers of 29 bits or report errors.
    pub fn foreign(&self) -> u64 {
        self.foreign
    }
}

impl CanBus for SocketCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        // Eleven bits and eight bytes at most, by the type.
        let id = StandardId::new(frame.id()).unwrap_or(StandardId::ZERO);
        let sent = if frame.is_request() {
            SocketFrame::new_remote(id, 0)
        } else {
            SocketFrame::new(id, frame.data())
        };
        let Some(frame) = sent else {
            return Err(BusError::Full);
        };
        self.socket.write_frame(&frame).map_err(|error| {
            let no_room = Some(105);
            match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut => BusError::Full,
                // ENOBUFS: the interface's own queue is full.
                _ if error.raw_os_error() == no_room => BusError::Full,
                _ => BusError::Down(error),
            }
        })
    }

    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, BusError> {
        let end = Instant::now() + limit.min(Duration::from_secs(3_600));
        loop {
            let left = end.saturating_duration_since(Instant::now());
            self.set_blocking(!left.is_zero())?;
            if !left.is_zero() {
                let wait = left.max(SHORTEST);
                self.socket.set_read_timeout(wait).map_err(BusError::Down)?;
            }
            match self.socket.read_frame_with_timestamp() {
                Ok((frame, taken_in)) => match standard(&frame) {
                    Some(frame) => {
                        let age = SystemTime::now().duration_since(taken_in);
                        let age_ns = age.ok().and_then(|age| i64::try_from(age.as_nanos()).ok());
                        return Ok(Some(Received {
                            frame,
                            age_ns: age_ns.unwrap_or(0),
                        }));
                    }
                    None => self.foreign += 1,
                },
                Err(error) if waits(&error) => {}
                Err(error) => return Err(BusError::Down(error)),
            }
            if left.is_zero() {
                return Ok(None);
            }
        }
    }
}

fn waits(error: &Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

fn standard(frame: &SocketFrame) -> Option<CanFrame> {
    let Id::Standard(id) = frame.id() else {
        return None;
    };
    match frame {
        SocketFrame::Data(data) => CanFrame::new(id.as_raw(), data.data()),
        SocketFrame::Remote(_) => CanFrame::request(id.as_raw()),
        SocketFrame::Error(_) => None,
    }
}
