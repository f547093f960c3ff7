//! `recorder`: what the LiDAR and the robot sent, to a file.
//!
//! Packets are copied on their way to the driver ([`Tap`]); the task writes what has come every 50 ms.
//! A disk that does not take it costs the recording, and nothing else.

use std::sync::atomic::Ordering;

use hachi_hal::{ImuSample, OdometrySample, PacketSource, Received, Stamp};
use hachi_runtime::{Progress, Receiver, Work};
use hachi_unitree::BodySample;
use tracing::error;

use super::messages::{Belt, BeltEnd, Roomy};
use super::signs::SharedSigns;
use crate::recorder::{Packet, Recorder};

/// A packet on its way to the recorder.
#[derive(Debug, Default)]
pub struct Datagram {
    stamp: Stamp,
    port: u16,
    payload: Vec<u8>,
}

/// The longest packet of a LiDAR, with room to spare.
const LONGEST: usize = 1500;

/// Packets that wait: a fifth of a second of a dual-return sensor.
pub const WAITING: usize = 300;

impl Roomy for Datagram {
    fn with_room(_: usize) -> Self {
        Self {
            payload: Vec::with_capacity(LONGEST),
            ..Self::default()
        }
    }
}

/// A source whose packets are copied to the recorder, if there is one.
#[derive(Debug)]
pub struct Tap<P> {
    /// The source.
    pub source: P,
    /// To the recorder.
    pub out: Option<Belt<Datagram>>,
}

impl<P: PacketSource> PacketSource for Tap<P> {
    type Error = P::Error;

    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline: Stamp,
    ) -> Result<Option<Received>, P::Error> {
        let received = self.source.receive(buffer, deadline)?;
        if let (Some(received), Some(out)) = (&received, &self.out)
            && let Some(mut datagram) = out.empty.receive()
        {
            (datagram.stamp, datagram.port) = (received.stamp, received.port);
            datagram.payload.clear();
            datagram
                .payload
                .extend_from_slice(&buffer[..received.len.min(LONGEST)]);
            out.send(datagram);
        }
        Ok(received)
    }

    fn at_end(&self) -> bool {
        self.source.at_end()
    }
}

/// The task.
pub struct RecorderTask {
    /// The file; `None` once the disk did not take it.
    pub recorder: Option<Recorder>,
    /// From the LiDAR.
    pub packets: BeltEnd<Datagram>,
    /// From the legs.
    pub bodies: Receiver<(BodySample, OdometrySample)>,
    /// From the inertial sensor on a bus.
    pub inertial: Receiver<ImuSample>,
    /// What has come since the last run.
    pub batch: Vec<Box<Datagram>>,
    /// Where a full disk is told.
    pub signs: SharedSigns,
}

impl Work for RecorderTask {
    fn run(&mut self, _: Stamp) -> Progress {
        while let Some(datagram) = self.packets.full.receive() {
            self.batch.push(datagram);
        }
        if let Err(error) = self.write() {
            error!(%error, "the recording ends here");
            self.signs.recording_fails.store(true, Ordering::Relaxed);
            self.recorder = None;
        }
        for datagram in self.batch.drain(..) {
            self.packets.give_back(datagram);
        }
        Progress::Done
    }
}

impl RecorderTask {
    fn write(&mut self) -> Result<(), mcap::McapError> {
        let Some(recorder) = &mut self.recorder else {
            while self.bodies.receive().is_some() {}
            while self.inertial.receive().is_some() {}
            return Ok(());
        };
        recorder.packets(self.batch.iter().map(|datagram| Packet {
            stamp: datagram.stamp,
            port: datagram.port,
            payload: &datagram.payload,
        }))?;
        while let Some((body, motion)) = self.bodies.receive() {
            recorder.body(&body)?;
            recorder.motion(&motion)?;
        }
        while let Some(sample) = self.inertial.receive() {
            recorder.inertial(&sample)?;
        }
        Ok(())
    }
}

impl Drop for RecorderTask {
    /// The rest, and the index.
    fn drop(&mut self) {
        self.run(Stamp::default());
        if let Some(Err(error)) = self.recorder.as_mut().map(Recorder::finish) {
            error!(%error, "the recording has no index");
            self.signs.recording_fails.store(true, Ordering::Relaxed);
        }
    }
}
