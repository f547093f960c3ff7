//! A camera that is plugged in, as [`RgbdCamera`]: opened, set up, streaming, and opened anew
//! whenever it comes back.
//!
//! In: a [`CameraPort`]. Out: depth and colour that belong together, stamped on the robot's clock,
//! and a count of everything that was left out, by reason. Elsewhere: what the bytes mean (`frame`,
//! `calibration`, `monitor`), the system calls (`v4l2`).
//!
//! Once a camera streams, nothing here allocates until it goes away.

mod counters;
mod lane;
mod link;
mod session;
mod setup;
pub mod simulated;
mod times;
#[cfg(all(feature = "v4l2", target_os = "linux", target_pointer_width = "64"))]
pub mod v4l2;

use std::string::String;

use hachi_hal::{DeviceError, FaultKind, RgbdCamera, RgbdGeometry, RgbdHeader, RgbdImages, Stamp};

use crate::calibration::CalibrationError;
use crate::controls::{DepthSettings, Exposure, Selector};
use crate::frame::FrameError;
use crate::monitor::MonitorError;

pub use counters::{RealSenseCounters, StreamCounters};
pub use link::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream, StreamFormat,
};
pub use session::CameraIdentity;
use session::Session;
pub use setup::read as identify;
use times::Exposed;

/// A camera that sends no depth and colour of one time for this long is opened anew, ns: one stream
/// can die while the other goes on. The slowest streams have a frame every 200 ms.
const STALL_NS: i64 = 2_000_000_000;

/// Which camera, and how it is set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RealSenseConfig {
    /// Serial number on the USB; `None` takes any camera.
    pub serial: Option<String>,
    /// The depth stream.
    pub depth: StreamFormat,
    /// The colour stream.
    pub color: StreamFormat,
    /// How the depth camera exposes and lights.
    pub depth_settings: DepthSettings,
    /// How long the colour camera exposes.
    pub color_exposure: Exposure,
}

impl Default for RealSenseConfig {
    /// The maker's best depth size and the same for colour, thirty times a second.
    fn default() -> Self {
        let format = StreamFormat::new(848, 480, 30);
        Self {
            serial: None,
            depth: format,
            color: format,
            depth_settings: DepthSettings::default(),
            color_exposure: Exposure::Automatic,
        }
    }
}

/// Why there is no frame.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// No camera is plugged in. Reading again waits for one.
    #[error("no RealSense {}is plugged in: check its cable, `hachi doctor` lists what is there", serial.as_ref().map(|s| std::format!("with serial number {s} ")).unwrap_or_default())]
    Missing {
        /// Which one was asked for.
        serial: Option<String>,
    },
    /// The camera is there, and one of its streams or both are silent. It is opened anew on the next
    /// read.
    #[error("no frame of both streams for {silent_ns} ns: the camera is opened anew")]
    Stalled {
        /// For how long.
        silent_ns: i64,
    },
    /// What the link says.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The firmware refuses or talks nonsense.
    #[error("the camera's firmware: {0}")]
    Monitor(#[from] MonitorError),
    /// The camera's calibration cannot be used.
    #[error("{0}: calibrate the camera with the maker's tool")]
    Calibration(#[from] CalibrationError),
    /// The camera has no such setting.
    #[error("this camera has no setting for {}", selector.name())]
    NoSuchControl {
        /// Which setting.
        selector: Selector,
    },
    /// A setting is outside what the camera can.
    #[error("{} {value} is outside {least} to {most}", selector.name())]
    Setting {
        /// Which setting.
        selector: Selector,
        /// What was wanted.
        value: u32,
        /// The least.
        least: u32,
        /// The most.
        most: u32,
    },
    /// The caller's images have no room for a frame, or the stream is none.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

impl DeviceError for CameraError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Missing { .. } | Self::Stalled { .. } | Self::Monitor(_) => FaultKind::Reopen,
            Self::Link(error) => error.kind(),
            Self::Calibration(_)
            | Self::NoSuchControl { .. }
            | Self::Setting { .. }
            | Self::Frame(_) => FaultKind::FixConfig,
        }
    }
}

/// A RealSense that is plugged in, or will be.
///
/// An error closes the camera where it can no longer be used; the next read opens it again, so that
/// a caller reacts to [`FaultKind::Reopen`] by reading again. Sequence numbers and time go on.
#[derive(Debug)]
pub struct RealSense<P: CameraPort> {
    port: P,
    config: RealSenseConfig,
    request: CameraRequest,
    session: Option<Session<P::Link>>,
    /// The last geometry, kept while the camera is away.
    geometry: Option<RgbdGeometry>,
    identity: Option<CameraIdentity>,
    /// The first deadline that passed since the last pair.
    silent_since: Option<Stamp>,
    sequence: u32,
    last_stamp: Option<Stamp>,
    counters: RealSenseCounters,
}

impl<P: CameraPort> RealSense<P> {
    /// A camera at `port`. It is opened by the first read.
    pub fn new(port: P, config: RealSenseConfig) -> Self {
        let request = CameraRequest {
            serial: config.serial.clone(),
            depth: config.depth,
            color: config.color,
        };
        Self {
            port,
            config,
            request,
            session: None,
            geometry: None,
            identity: None,
            silent_since: None,
            sequence: 0,
            last_stamp: None,
            counters: RealSenseCounters::default(),
        }
    }

    /// Whether a camera is open.
    pub fn is_open(&self) -> bool {
        self.session.is_some()
    }

    /// What the camera is; of the last one while none is open.
    pub fn identity(&self) -> Option<&CameraIdentity> {
        self.identity.as_ref()
    }

    /// What happened to frames so far.
    pub fn counters(&self) -> RealSenseCounters {
        match &self.session {
            Some(session) => self.counters.with(&session.tally()),
            None => self.counters,
        }
    }

    fn open(&mut self, deadline: Stamp) -> Result<(), CameraError> {
        let Some(link) = self.port.open(&self.request, deadline)? else {
            let serial = self.request.serial.clone();
            return Err(CameraError::Missing { serial });
        };
        let session = Session::begin(link, &self.request, &self.config)?;
        self.geometry = Some(session.geometry);
        self.identity = Some(session.identity);
        self.session = Some(session);
        self.silent_since = None;
        self.counters.opened += 1;
        Ok(())
    }

    fn close(&mut self) {
        if let Some(session) = self.session.take() {
            self.counters = self.counters.with(&session.tally());
        }
    }

    /// No pair came by `deadline`. Too much of that is a stall.
    fn silence(&mut self, deadline: Stamp) -> Result<(), CameraError> {
        let since = *self.silent_since.get_or_insert(deadline);
        let silent_ns = deadline.nanos_since(since);
        if silent_ns < STALL_NS {
            return Ok(());
        }
        self.close();
        self.counters.stalled += 1;
        Err(CameraError::Stalled { silent_ns })
    }

    fn header(&mut self, [depth, color]: [Exposed; 2]) -> RgbdHeader {
        let mut stamp = depth.stamp;
        if let Some(last) = self.last_stamp.filter(|&last| stamp <= last) {
            stamp = last + 1;
            self.counters.stamp_moved += 1;
        }
        self.last_stamp = Some(stamp);
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        self.counters.pairs += 1;
        let sensor_ns = |e: Exposed| e.sensor_ns.and_then(|ns| u64::try_from(ns).ok());
        RgbdHeader {
            sequence,
            stamp,
            color_stamp: color.stamp,
            depth_sensor_ns: sensor_ns(depth),
            color_sensor_ns: sensor_ns(color),
            depth_exposure_us: depth.exposure_us,
            color_exposure_us: color.exposure_us,
        }
    }
}

/// Refuses images in which a frame would have to be cut.
fn check_room(geometry: &RgbdGeometry, images: &RgbdImages<'_>) -> Result<(), FrameError> {
    for (got, needed) in [
        (images.depth.len(), geometry.depth.pixels()),
        (images.color.len(), 3 * geometry.color.pixels()),
    ] {
        if got < needed {
            return Err(FrameError::Target { got, needed });
        }
    }
    Ok(())
}

impl<P: CameraPort> RgbdCamera for RealSense<P> {
    type Error = CameraError;

    fn geometry(&self) -> Option<&RgbdGeometry> {
        self.geometry.as_ref()
    }

    fn read_frame(
        &mut self,
        images: RgbdImages<'_>,
        deadline: Stamp,
    ) -> Result<Option<RgbdHeader>, CameraError> {
        if self.session.is_none() {
            self.open(deadline)?;
        }
        let mut late = false;
        while let Some(session) = &mut self.session {
            check_room(&session.geometry, &images)?;
            if let Some(times) = session.pair() {
                self.silent_since = None;
                session.deliver(images.depth, images.color)?;
                return Ok(Some(self.header(times)));
            }
            // A stream that never runs dry must not keep us here for ever.
            if late {
                break;
            }
            match session.step(deadline) {
                Ok(Some(arrived)) => late = arrived > deadline,
                Ok(None) => break,
                Err(error) => {
                    self.close();
                    self.counters.unplugged += u64::from(matches!(error, LinkError::Unplugged));
                    return Err(error.into());
                }
            }
        }
        self.silence(deadline)?;
        Ok(None)
    }
}
