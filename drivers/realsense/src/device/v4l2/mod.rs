//! Cameras on this machine, through the kernel's V4L2 alone: nothing to install.
//!
//! | module | holds |
//! |---|---|
//! | `find` | which cameras are plugged in |
//! | `video` | what is needed of a video device, as a trait |
//! | `kernel`, `abi` | the real devices: system calls and their structures |
//! | here | which device streams what; formats; buffers of four devices in one stream |
//!
//! A camera is up to six video devices: depth, infrared and colour, each with one for metadata.
//! They are told apart by what they can do, never by their numbers.

mod abi;
mod find;
mod kernel;
#[cfg(test)]
mod tests;
mod video;

use std::io;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;
use std::vec::Vec;

use hachi_hal::{Clock, Stamp};

use super::link::{
    Buffer, CameraLink, CameraPort, CameraRequest, LinkError, Part, Stream, StreamFormat,
};
use crate::Model;
use crate::controls::{Query, Selector, UNIT};
use crate::frame::Layout;
pub use find::{FoundCamera, find_cameras};
use kernel::Kernel;
use video::{FourCc, Granted, Kind, MOST_NODES, Node, Video};

const Z16: FourCc = *b"Z16 ";
const YUYV: FourCc = *b"YUYV";
/// Metadata with the camera's blocks, and with the USB header alone.
const METADATA_FORMATS: [FourCc; 2] = [*b"D4XX", *b"UVCH"];
/// Buffers of each device: three frames of delay before the kernel drops one.
const BUFFERS: u32 = 4;
/// How often a camera is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The cameras of this machine. `C` is the robot's clock.
#[derive(Debug)]
pub struct V4l2Port<C, V = Kernel> {
    clock: C,
    video: V,
    find: fn() -> Vec<FoundCamera>,
}

impl<C: Clock + Clone> V4l2Port<C> {
    /// Cameras whose frames are stamped on `clock`.
    pub fn new(clock: C) -> Self {
        Self {
            clock,
            video: Kernel,
            find: find_cameras,
        }
    }
}

impl<C: Clock + Clone, V: Video + Clone> CameraPort for V4l2Port<C, V> {
    type Link = V4l2Link<C, V>;

    fn open(
        &mut self,
        request: &CameraRequest,
        deadline: Stamp,
    ) -> Result<Option<Self::Link>, LinkError> {
        loop {
            let wanted = (self.find)().into_iter().find_map(|camera| {
                let serial = request.serial.as_deref();
                let asked_for = serial.is_none() || camera.serial.as_deref() == serial;
                Some((camera.model()?, camera)).filter(|_| asked_for)
            });
            // Just plugged in, a camera has not all of its devices and rights yet.
            let opened = wanted.map(|(model, camera)| self.link(model, &camera, request));
            let left = self.clock.until(deadline);
            if matches!(opened, Some(Ok(_))) || left.is_zero() {
                return opened.transpose();
            }
            thread::sleep(left.min(LOOK_EVERY));
        }
    }
}

/// One device of a camera while it is found out what it is.
struct Candidate<N> {
    path: PathBuf,
    node: N,
    kind: Option<Kind>,
    formats: Vec<FourCc>,
}

impl<C: Clock + Clone, V: Video + Clone> V4l2Port<C, V> {
    fn link(
        &self,
        model: Model,
        camera: &FoundCamera,
        request: &CameraRequest,
    ) -> Result<V4l2Link<C, V>, LinkError> {
        let mut candidates = Vec::with_capacity(camera.nodes.len());
        for path in &camera.nodes {
            candidates.push(Some(self.candidate(path)?));
        }
        let mut link = V4l2Link {
            clock: self.clock.clone(),
            video: self.video.clone(),
            model,
            layouts: [Layout::packed(0, 0); 2],
            nodes: Vec::with_capacity(MOST_NODES),
            roles: Vec::with_capacity(MOST_NODES),
            ready: [false; MOST_NODES],
            next: 0,
        };
        for stream in Stream::BOTH {
            let has = |wanted: FourCc, c: &Option<Candidate<_>>| {
                let c = c.as_ref();
                c.is_some_and(|c| c.kind == Some(Kind::Pictures) && c.formats.contains(&wanted))
            };
            let fits = |c: &Option<Candidate<_>>| match stream {
                Stream::Depth => has(Z16, c),
                Stream::Color => has(YUYV, c) && !has(Z16, c),
            };
            let index = candidates.iter().position(fits);
            let missing = LinkError::NoDevice { stream };
            let index = index.ok_or(missing)?;
            // Metadata come through the device behind the pictures', if the kernel has one.
            let behind = candidates.get_mut(index + 1);
            let metadata = behind.and_then(|c| c.take_if(|c| c.kind == Some(Kind::Metadata)));
            if let Some(pictures) = candidates[index].take() {
                link.layouts[stream.index()] = set_pictures(&pictures, stream, request)?;
                link.add(stream, Part::Picture, pictures);
            }
            if let Some(metadata) = metadata.filter(gives_metadata) {
                link.add(stream, Part::Metadata, metadata);
            }
        }
        Ok(link)
    }

    fn candidate(&self, path: &Path) -> Result<Candidate<V::Node>, LinkError> {
        let failed = |doing| move |error| link_error(doing, path, error);
        let node = self
            .video
            .open(path)
            .map_err(failed("opening the camera"))?;
        let kind = node
            .kind()
            .map_err(failed("asking what the camera can do"))?;
        let formats = match kind {
            Some(Kind::Pictures) => node.formats().map_err(failed("asking for formats"))?,
            _ => Vec::new(),
        };
        Ok(Candidate {
            path: path.to_path_buf(),
            node,
            kind,
            formats,
        })
    }
}

/// Whether a device gives one of the formats that are read here. Without metadata a camera works,
/// with the kernel's times.
fn gives_metadata<N: Node>(candidate: &Candidate<N>) -> bool {
    let granted = METADATA_FORMATS.into_iter().find(|&format| {
        candidate
            .node
            .set_metadata(format)
            .is_ok_and(|got| got == format)
    });
    granted.is_some()
}

/// Sets size, format and rate; the kernel must grant them as they are asked for.
fn set_pictures<N: Node>(
    candidate: &Candidate<N>,
    stream: Stream,
    request: &CameraRequest,
) -> Result<Layout, LinkError> {
    let format = request.format(stream);
    let StreamFormat {
        width,
        height,
        rate,
    } = format;
    let four_cc = match stream {
        Stream::Depth => Z16,
        Stream::Color => YUYV,
    };
    let path = &candidate.path;
    let refused = || LinkError::Format {
        path: path.clone(),
        stream,
        format,
    };
    let failed = |error: io::Error| match error.raw_os_error() {
        Some(libc::EINVAL) => refused(),
        _ => link_error("setting the format", path, error),
    };
    let node = &candidate.node;
    let granted = node.set_pictures(width, height, four_cc).map_err(failed)?;
    let [seconds, frames] = node.set_rate(rate).map_err(failed)?;
    let Granted { stride, .. } = granted;
    let same_picture = (granted.width, granted.height, granted.four_cc) == (width, height, four_cc);
    let same_rate = seconds != 0 && u64::from(seconds) * u64::from(rate) == u64::from(frames);
    if same_picture && same_rate {
        Ok(Layout {
            width,
            height,
            stride,
        })
    } else {
        Err(refused())
    }
}

/// A camera that is open.
#[derive(Debug)]
pub struct V4l2Link<C, V: Video = Kernel> {
    clock: C,
    video: V,
    model: Model,
    layouts: [Layout; 2],
    nodes: Vec<V::Node>,
    /// What each node streams, and where it is.
    roles: Vec<(Stream, Part, PathBuf)>,
    /// Which nodes may have something.
    ready: [bool; MOST_NODES],
    /// Which is looked at first, so that none is starved.
    next: usize,
}

impl<C: Clock, V: Video> V4l2Link<C, V> {
    fn add(&mut self, stream: Stream, part: Part, candidate: Candidate<V::Node>) {
        self.roles.push((stream, part, candidate.path));
        self.nodes.push(candidate.node);
    }

    fn pictures(&self, stream: Stream) -> Result<(&V::Node, &Path), LinkError> {
        let of = |(s, part, _): &(Stream, Part, PathBuf)| *s == stream && *part == Part::Picture;
        let index = self.roles.iter().position(of);
        let index = index.ok_or(LinkError::NoDevice { stream })?;
        Ok((&self.nodes[index], &self.roles[index].2))
    }

    /// The next buffer that is there already.
    fn take_ready(&mut self, take: &mut dyn FnMut(Buffer<'_>)) -> Result<bool, LinkError> {
        let (clock, now_ns) = (&self.clock, self.video.monotonic_ns());
        let count = self.nodes.len();
        for index in (0..count).map(|i| (self.next + i) % count) {
            if !self.ready[index] {
                continue;
            }
            let (stream, part, path) = &self.roles[index];
            let mut hand_on = |filled: video::Filled<'_>| {
                let age_ns = filled
                    .monotonic_ns
                    .map_or(0, |ns| now_ns.saturating_sub(ns));
                take(Buffer {
                    stream: *stream,
                    part: *part,
                    sequence: filled.sequence,
                    received: clock.ago(age_ns),
                    damaged: filled.damaged,
                    bytes: filled.bytes,
                });
            };
            let taken = self.nodes[index].dequeue(&mut hand_on);
            let taken = taken.map_err(|e| link_error("taking a frame", path, e))?;
            self.ready[index] = taken;
            if taken {
                self.next = (index + 1) % count;
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl<C: Clock, V: Video> CameraLink for V4l2Link<C, V> {
    fn model(&self) -> Model {
        self.model
    }

    fn layout(&self, stream: Stream) -> Layout {
        self.layouts[stream.index()]
    }

    fn has_metadata(&self, stream: Stream) -> bool {
        let of = |(s, part, _): &(Stream, Part, PathBuf)| *s == stream && *part == Part::Metadata;
        self.roles.iter().any(of)
    }

    fn set_unit(&mut self, selector: Selector, bytes: &[u8]) -> Result<(), LinkError> {
        let (node, path) = self.pictures(Stream::Depth)?;
        node.set_unit(UNIT, selector.number(), bytes)
            .map_err(|error| link_error("setting a control of the camera", path, error))
    }

    fn get_unit(
        &mut self,
        selector: Selector,
        query: Query,
        bytes: &mut [u8],
    ) -> Result<(), LinkError> {
        let (node, path) = self.pictures(Stream::Depth)?;
        node.get_unit(UNIT, selector.number(), query.number(), bytes)
            .map_err(|error| link_error("asking a control of the camera", path, error))
    }

    fn set_video(&mut self, stream: Stream, control: u32, value: i32) -> Result<(), LinkError> {
        let (node, path) = self.pictures(stream)?;
        node.set_control(control, value)
            .map_err(|error| link_error("setting a video control", path, error))
    }

    fn start(&mut self) -> Result<(), LinkError> {
        // Metadata first, so that the first picture has its own.
        for wanted in [Part::Metadata, Part::Picture] {
            for (node, (_, part, path)) in self.nodes.iter_mut().zip(&self.roles) {
                let kind = match part {
                    Part::Picture => Kind::Pictures,
                    Part::Metadata => Kind::Metadata,
                };
                if *part == wanted {
                    node.start(kind, BUFFERS)
                        .map_err(|error| link_error("starting a stream", path, error))?;
                }
            }
        }
        Ok(())
    }

    fn dequeue(
        &mut self,
        deadline: Stamp,
        take: &mut dyn FnMut(Buffer<'_>),
    ) -> Result<bool, LinkError> {
        loop {
            if self.take_ready(take)? {
                return Ok(true);
            }
            let left = self.clock.until(deadline);
            let waited = self.video.wait(&self.nodes, left);
            self.ready = waited.map_err(|source| LinkError::System {
                doing: "waiting for the camera",
                source,
            })?;
            if !self.ready.contains(&true) {
                if left.is_zero() {
                    return Ok(false);
                }
                continue;
            }
            if self.take_ready(take)? {
                return Ok(true);
            }
            // Said to be ready with nothing there: the kernel signals a failure without a name.
            return Err(LinkError::Unplugged);
        }
    }
}

/// What a system call's failure means for a camera.
fn link_error(doing: &'static str, path: &Path, error: io::Error) -> LinkError {
    let path = path.to_path_buf();
    match error.raw_os_error() {
        Some(libc::EACCES | libc::EPERM) => LinkError::Denied { path },
        Some(libc::EBUSY) => LinkError::Busy { path },
        Some(libc::ENODEV | libc::ENXIO | libc::ENOENT | libc::ESHUTDOWN) => LinkError::Unplugged,
        _ => LinkError::System {
            doing,
            source: error,
        },
    }
}
