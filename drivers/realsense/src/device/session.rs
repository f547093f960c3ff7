//! One camera from being opened to going away: set up, read out, streaming, paired.
//!
//! In: an open link. Out: what the camera is, its geometry, and pairs of frames by the time at which
//! the camera exposed them.

use hachi_hal::{RgbdGeometry, Stamp};

use super::counters::StreamCounters;
use super::lane::Lane;
use super::link::{Buffer, CameraLink, CameraRequest, LinkError, Stream};
use super::times::{CameraClock, Exposed};
use super::{CameraError, RealSenseConfig, setup};
use crate::frame::{FrameError, Layout, YuyvImage, Z16Image};

/// What a camera is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraIdentity {
    /// Which camera.
    pub model: crate::Model,
    /// Firmware and serial number.
    pub info: crate::monitor::DeviceInfo,
    /// The camera does not tell its depth unit (its advanced mode is off): the usual millimetre is
    /// taken.
    pub depth_unit_assumed: bool,
}

/// Counts of one session.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    pub clock_jumps: u64,
    pub receiver_clock_set_back: u64,
    pub depth: StreamCounters,
    pub color: StreamCounters,
}

#[derive(Debug)]
pub(super) struct Session<L> {
    link: L,
    pub identity: CameraIdentity,
    pub geometry: RgbdGeometry,
    layouts: [Layout; 2],
    /// Depth, colour.
    lanes: [Lane; 2],
    clock: CameraClock,
    /// Frames further apart than this do not belong together, ns.
    tolerance_ns: i64,
}

impl<L: CameraLink> Session<L> {
    /// Sets the camera up, reads its tables and starts both streams.
    pub fn begin(
        mut link: L,
        request: &CameraRequest,
        config: &RealSenseConfig,
    ) -> Result<Self, CameraError> {
        let (identity, geometry) = setup::read(&mut link)?;
        setup::apply(&mut link, config)?;
        let layouts = Stream::BOTH.map(|stream| link.layout(stream));
        let [depth_len, color_len] = [layouts[0].buffer_len()?, layouts[1].buffer_len()?];
        let lanes = [
            Lane::new(depth_len, link.has_metadata(Stream::Depth)),
            Lane::new(color_len, link.has_metadata(Stream::Color)),
        ];
        link.start()?;
        // Half the period of the faster stream: the nearest frame there can be, and only one.
        let rate = i64::from(request.depth.rate.max(request.color.rate).max(1));
        Ok(Self {
            link,
            identity,
            geometry,
            layouts,
            lanes,
            clock: CameraClock::default(),
            tolerance_ns: 500_000_000 / rate,
        })
    }

    /// Takes the next buffer in. Gives its arrival; `None` if none came by the deadline.
    pub fn step(&mut self, deadline: Stamp) -> Result<Option<Stamp>, LinkError> {
        let (lanes, clock) = (&mut self.lanes, &mut self.clock);
        let mut arrived = None;
        let mut take = |buffer: Buffer<'_>| {
            let lane = &mut lanes[buffer.stream.index()];
            let before = lane.counters.frames;
            lane.push(&buffer);
            if buffer.stream == Stream::Depth && lane.counters.frames != before {
                lane.newest().inspect(|frame| clock.learn(frame));
            }
            arrived = Some(buffer.received);
        };
        self.link.dequeue(deadline, &mut take)?;
        Ok(arrived)
    }

    /// The times of the next two frames that belong together. Frames without a partner go.
    pub fn pair(&mut self) -> Option<[Exposed; 2]> {
        loop {
            let [depth, color] = &mut self.lanes;
            let times = [depth.ready()?.0, color.ready()?.0].map(|f| self.clock.exposed(f));
            let gap_ns = match times.map(|t| t.sensor_ns) {
                [Some(depth), Some(color)] => color.saturating_sub(depth),
                _ => times[1].stamp.nanos_since(times[0].stamp),
            };
            if gap_ns.abs() <= self.tolerance_ns {
                return Some(times);
            }
            let older = if gap_ns > 0 { depth } else { color };
            older.drop_unpaired();
        }
    }

    /// The two frames of [`Session::pair`] as counts and colours. They are used up.
    pub fn deliver(&mut self, counts: &mut [u16], rgb: &mut [u8]) -> Result<(), FrameError> {
        let [depth, color] = &mut self.lanes;
        if let Some((_, bytes)) = depth.ready() {
            Z16Image::new(bytes, self.layouts[0])?.copy_to(counts)?;
        }
        if let Some((_, bytes)) = color.ready() {
            YuyvImage::new(bytes, self.layouts[1])?.to_rgb(rgb)?;
        }
        depth.take();
        color.take();
        Ok(())
    }

    pub fn tally(&self) -> Tally {
        Tally {
            clock_jumps: self.clock.jumps,
            receiver_clock_set_back: self.clock.set_back(),
            depth: self.lanes[0].counters,
            color: self.lanes[1].counters,
        }
    }
}
