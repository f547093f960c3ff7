//! What can go wrong between host and robot.

use hachi_datagram::UdpError;
use hachi_hal::{DeviceError, FaultKind};

use crate::command::CommandRefused;
use crate::frame::FieldError;

/// What can go wrong with a [`super::HighClient`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The socket.
    #[error(transparent)]
    Link(#[from] UdpError),
    /// A command was not taken.
    #[error(transparent)]
    Refused(#[from] CommandRefused),
    /// A command could not be put into a frame.
    #[error("the command can't be sent: {0}")]
    Field(#[from] FieldError),
    /// The robot does not answer, or answers always the same: it is not moved.
    #[error("the robot at {robot} has sent nothing new for {for_ms} ms: check its cable and power")]
    NoAnswer {
        /// Its address.
        robot: std::net::SocketAddr,
        /// For how long.
        for_ms: i64,
    },
}

impl DeviceError for ClientError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Link(error) => error.kind(),
            Self::Refused(error) => error.kind(),
            Self::Field(_) | Self::NoAnswer { .. } => FaultKind::ReadAgain,
        }
    }
}
