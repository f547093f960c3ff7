//! A recording's packets as a [`PacketSource`], so that they go through the same drivers as live
//! ones.

use std::path::Path;

use hachi_hal::{PacketSource, Received, Stamp};

use super::{Bag, Topic};
use crate::error::BagError;
use crate::message::{Body, MessageKind, Sensor};

/// The packets of one LiDAR in a recording, in the order in which they were recorded.
///
/// A recording with several LiDARs is read for the one with the most messages.
#[derive(Debug)]
pub struct BagPackets {
    bag: Bag,
    topic: usize,
    sensor: Sensor,
    /// The packets of the message being handed out, one behind the other.
    payloads: Vec<u8>,
    pending: Vec<Pending>,
    next: usize,
    ended: bool,
}

#[derive(Debug, Clone, Copy)]
struct Pending {
    stamp: Stamp,
    port: u16,
    end: usize,
}

impl BagPackets {
    /// Opens a recording for its LiDAR packets.
    ///
    /// # Errors
    /// [`BagError::NoTopic`] where none carries packets; a recording of finished clouds is read by
    /// [`BagScans`](super::BagScans).
    pub fn open(path: impl AsRef<Path>) -> Result<Self, BagError> {
        Self::new(Bag::open(path)?)
    }

    /// The packets of a recording that is open already and has not been read from.
    pub fn new(mut bag: Bag) -> Result<Self, BagError> {
        let wanted = "VelodyneScan, RobosenseScan or RslidarPacket";
        let topic = bag.busiest(wanted, |kind| kind.sensor().is_some())?;
        let chosen = bag.topics()[topic].clone();
        bag.retain(|topic| *topic == chosen);
        Ok(Self {
            bag,
            topic,
            sensor: match chosen.kind.and_then(MessageKind::sensor) {
                Some(sensor) => sensor,
                // `busiest` gave a topic with packets.
                None => Sensor::Velodyne,
            },
            payloads: Vec::new(),
            pending: Vec::new(),
            next: 0,
            ended: false,
        })
    }

    /// Which driver understands them.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// The topic they are read from.
    pub fn topic(&self) -> &Topic {
        &self.bag.topics()[self.topic]
    }

    /// The recording.
    pub fn bag(&self) -> &Bag {
        &self.bag
    }

    /// Unpacks the next message. `false` at the end.
    fn refill(&mut self) -> Result<bool, BagError> {
        self.payloads.clear();
        self.pending.clear();
        self.next = 0;
        let Some(message) = self.bag.next_message()? else {
            return Ok(false);
        };
        if let Body::Packets(packets) = message.body {
            for packet in packets.iter() {
                self.payloads.extend_from_slice(packet.payload);
                self.pending.push(Pending {
                    stamp: packet.stamp,
                    port: packet.port,
                    end: self.payloads.len(),
                });
            }
        }
        Ok(true)
    }
}

impl PacketSource for BagPackets {
    type Error = BagError;

    /// Never waits: what is recorded is there, whatever the deadline.
    fn receive(
        &mut self,
        buffer: &mut [u8],
        _deadline: Stamp,
    ) -> Result<Option<Received>, BagError> {
        while self.next == self.pending.len() {
            if self.ended {
                return Ok(None);
            }
            if !self.refill()? {
                self.ended = true;
            }
        }
        let from = match self.next.checked_sub(1) {
            Some(before) => self.pending[before].end,
            None => 0,
        };
        let packet = self.pending[self.next];
        self.next += 1;
        let payload = &self.payloads[from..packet.end];
        let Some(room) = buffer.get_mut(..payload.len()) else {
            return Err(BagError::PacketTooLong {
                path: self.bag.path().to_path_buf(),
                got: payload.len(),
                capacity: buffer.len(),
            });
        };
        room.copy_from_slice(payload);
        Ok(Some(Received {
            len: payload.len(),
            stamp: packet.stamp,
            port: packet.port,
        }))
    }

    fn at_end(&self) -> bool {
        self.ended && self.next == self.pending.len()
    }
}
