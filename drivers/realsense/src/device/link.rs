//! The narrowest traits that let everything above them be real: where cameras are plugged in, and
//! one that is open.
//!
//! Implemented by `v4l2` over the kernel, and by tests over bytes. A link knows nothing of what is
//! in the bytes.

use std::path::PathBuf;
use std::string::String;

use hachi_hal::{DeviceError, FaultKind, Stamp};

use crate::Model;
use crate::controls::{Query, Selector};
use crate::frame::Layout;

/// One of the two streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stream {
    /// Z16.
    Depth,
    /// YUYV.
    Color,
}

impl Stream {
    /// Both.
    pub const BOTH: [Self; 2] = [Self::Depth, Self::Color];

    /// Its place in a pair.
    pub const fn index(self) -> usize {
        match self {
            Self::Depth => 0,
            Self::Color => 1,
        }
    }

    /// The word a person would use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Color => "colour",
        }
    }
}

/// Size and rate of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StreamFormat {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Frames a second.
    pub rate: u32,
}

impl StreamFormat {
    /// A size and a rate.
    pub const fn new(width: u32, height: u32, rate: u32) -> Self {
        Self {
            width,
            height,
            rate,
        }
    }
}

/// Which camera, and how it is to stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraRequest {
    /// Serial number on the USB; `None` takes any camera.
    pub serial: Option<String>,
    /// The depth stream.
    pub depth: StreamFormat,
    /// The colour stream.
    pub color: StreamFormat,
}

impl CameraRequest {
    /// What is asked of one stream.
    pub const fn format(&self, stream: Stream) -> StreamFormat {
        match stream {
            Stream::Depth => self.depth,
            Stream::Color => self.color,
        }
    }
}

/// What a buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// A picture.
    Picture,
    /// The metadata of one.
    Metadata,
}

/// A buffer that was filled.
#[derive(Debug, Clone, Copy)]
pub struct Buffer<'a> {
    /// Of which stream.
    pub stream: Stream,
    /// A picture, or what belongs to one: both have the same sequence number.
    pub part: Part,
    /// Counts the stream's frames; the kernel leaves numbers out where it dropped some.
    pub sequence: u32,
    /// When the kernel saw it, on the robot's clock.
    pub received: Stamp,
    /// The kernel marks it as damaged.
    pub damaged: bool,
    /// What is in it.
    pub bytes: &'a [u8],
}

/// Where cameras are plugged in.
pub trait CameraPort {
    /// A camera that is open.
    type Link: CameraLink;
    /// Opens the camera that is asked for, waiting for it to be plugged in until `deadline`;
    /// `None` if none was by then.
    ///
    /// # Errors
    /// A camera is there and cannot be used: [`LinkError`] says what to do.
    fn open(
        &mut self,
        request: &CameraRequest,
        deadline: Stamp,
    ) -> Result<Option<Self::Link>, LinkError>;
}

/// A camera that is open and set to its formats.
pub trait CameraLink {
    /// Which camera it is.
    fn model(&self) -> Model;
    /// How a stream's pictures lie in their buffers.
    fn layout(&self, stream: Stream) -> Layout;
    /// Whether metadata come with a stream's pictures.
    fn has_metadata(&self, stream: Stream) -> bool;
    /// Sets a control of the depth extension unit.
    fn set_unit(&mut self, selector: Selector, bytes: &[u8]) -> Result<(), LinkError>;
    /// Asks a control of the depth extension unit; fills all of `bytes`.
    fn get_unit(
        &mut self,
        selector: Selector,
        query: Query,
        bytes: &mut [u8],
    ) -> Result<(), LinkError>;
    /// Sets one of the system's video controls of a stream.
    fn set_video(&mut self, stream: Stream, control: u32, value: i32) -> Result<(), LinkError>;
    /// Starts both streams.
    fn start(&mut self) -> Result<(), LinkError>;
    /// Hands the next filled buffer to `take`, waiting until `deadline`; `false` if none came.
    fn dequeue(
        &mut self,
        deadline: Stamp,
        take: &mut dyn FnMut(Buffer<'_>),
    ) -> Result<bool, LinkError>;
}

/// What is wrong with a link, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The user has no right to open it.
    #[error("no right to open {}: add the user to the group `video` (sudo usermod -aG video USER) and log in again", path.display())]
    Denied {
        /// The device.
        path: PathBuf,
    },
    /// Another program streams from it.
    #[error("{} is in use: end the other program that streams from the camera", path.display())]
    Busy {
        /// The device.
        path: PathBuf,
    },
    /// The camera has no such format.
    #[error("{} has no {} stream of {}x{} at {} a second: choose one that `v4l2-ctl --list-formats-ext -d {}` shows", path.display(), stream.name(), format.width, format.height, format.rate, path.display())]
    Format {
        /// The device.
        path: PathBuf,
        /// Which stream.
        stream: Stream,
        /// What was asked for.
        format: StreamFormat,
    },
    /// It went away.
    #[error("the camera was unplugged")]
    Unplugged,
    /// A camera is there without the stream's device.
    #[error("the camera has no {} device: is its firmware running? unplug it and plug it in again", stream.name())]
    NoDevice {
        /// Which stream.
        stream: Stream,
    },
    /// The system said no.
    #[error("{doing}: {source}")]
    System {
        /// What was being done.
        doing: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
}

impl DeviceError for LinkError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Denied { .. } | Self::Format { .. } => FaultKind::FixConfig,
            Self::Busy { .. } | Self::Unplugged | Self::NoDevice { .. } | Self::System { .. } => {
                FaultKind::Reopen
            }
        }
    }
}
