//! A line of bytes to one device: the narrowest trait that lets the rest be real.

use std::boxed::Box;
use std::io::{self, Read as _, Write as _};
use std::string::String;
use std::time::Duration;

use hachi_hal::{DeviceError, FaultKind};
use serialport::{ErrorKind, SerialPort};

use crate::frame::BAUD;

/// Bytes to a device and back.
pub trait Line {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// The line is broken.
    fn send(&mut self, bytes: &[u8]) -> Result<(), LineError>;

    /// What has come, waiting for `limit` for its first byte; 0 if nothing came.
    ///
    /// # Errors
    /// The line is broken.
    fn receive(&mut self, buffer: &mut [u8], limit: Duration) -> Result<usize, LineError>;
}

/// What is wrong with a line, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineError {
    /// It cannot be opened.
    #[error("{path} cannot be opened: {problem}; {advice}")]
    Open {
        /// The device.
        path: String,
        /// What the system said.
        problem: String,
        /// What to do.
        advice: &'static str,
    },
    /// It went away.
    #[error("the serial line is gone: was its adapter unplugged? ({0})")]
    Gone(io::Error),
}

impl DeviceError for LineError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Open { .. } => FaultKind::FixConfig,
            Self::Gone(_) => FaultKind::Reopen,
        }
    }
}

/// A serial port of this machine.
pub struct SerialLine {
    port: Box<dyn SerialPort>,
}

impl SerialLine {
    /// Opens `/dev/ttyUSB0` and its like for the gripper: 115,200 bits a second, 8N1.
    ///
    /// # Errors
    /// It is not there, in use, or not for this user.
    pub fn open(path: &str) -> Result<Self, LineError> {
        let opened = serialport::new(path, BAUD).open();
        let port = opened.map_err(|error| LineError::Open {
            path: path.into(),
            advice: match error.kind() {
                ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => {
                    "plug it in, or give the path that `hachi doctor` lists"
                }
                ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
                    "add the user to the group `dialout` (sudo usermod -aG dialout USER) and log \
                     in again"
                }
                _ => "end the other program that uses it",
            },
            problem: error.description,
        })?;
        Ok(Self { port })
    }

    /// A port that is open already.
    pub fn from_port(port: Box<dyn SerialPort>) -> Self {
        Self { port }
    }
}

impl Line for SerialLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LineError> {
        /// Far longer than a frame takes; a line that takes no bytes for so long is broken.
        const LIMIT: Duration = Duration::from_millis(100);
        let gone = LineError::Gone;
        self.port.set_timeout(LIMIT).map_err(|e| gone(e.into()))?;
        self.port.write_all(bytes).map_err(gone)
    }

    fn receive(&mut self, buffer: &mut [u8], limit: Duration) -> Result<usize, LineError> {
        let gone = LineError::Gone;
        self.port.set_timeout(limit).map_err(|e| gone(e.into()))?;
        match self.port.read(buffer) {
            // Readable and at its end: nobody is at the other side any more.
            Ok(0) => Err(gone(io::ErrorKind::UnexpectedEof.into())),
            Ok(len) => Ok(len),
            Err(error) => match error.kind() {
                io::ErrorKind::TimedOut
                | io::ErrorKind::WouldBlock
                | io::ErrorKind::Interrupted => Ok(0),
                _ => Err(gone(error)),
            },
        }
    }
}
