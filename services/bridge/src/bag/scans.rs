//! A recording's point clouds as scans.

use std::path::Path;

use hachi_hal::{LidarScans, Point, PointSink, ScanHeader, Stamp};

use super::{Bag, Topic};
use crate::cloud::CloudInfo;
use crate::error::BagError;
use crate::message::{Body, CloudReader, MessageKind};

/// The clouds of one `PointCloud2` topic, one scan at a time.
///
/// A recording with several is read for the one with the most messages.
#[derive(Debug)]
pub struct BagScans {
    bag: Bag,
    topic: usize,
    reader: CloudReader,
    /// For [`LidarScans`], which hands out points to any sink.
    points: Vec<Point>,
    ended: bool,
    dropped_points: u64,
}

impl BagScans {
    /// Opens a recording for its clouds.
    ///
    /// # Errors
    /// [`BagError::NoTopic`] where there are none; a recording of packets is read by
    /// [`BagPackets`](super::BagPackets).
    pub fn open(path: impl AsRef<Path>) -> Result<Self, BagError> {
        Self::new(Bag::open(path)?)
    }

    /// The clouds of a recording that is open already and has not been read from.
    pub fn new(mut bag: Bag) -> Result<Self, BagError> {
        let topic = bag.busiest("PointCloud2", |kind| kind == MessageKind::PointCloud)?;
        let chosen = bag.topics()[topic].clone();
        bag.retain(|topic| *topic == chosen);
        Ok(Self {
            bag,
            topic,
            reader: CloudReader::default(),
            points: Vec::new(),
            ended: false,
            dropped_points: 0,
        })
    }

    /// The topic they are read from.
    pub fn topic(&self) -> &Topic {
        &self.bag.topics()[self.topic]
    }

    /// The recording.
    pub fn bag(&self) -> &Bag {
        &self.bag
    }

    /// What intensities are multiplied by: 1 or 255, `None` before a cloud has settled it.
    pub fn intensity_scale(&self) -> Option<f32> {
        self.reader.intensity_scale()
    }

    /// Points that did not fit a caller's sink, with the scans they belonged to.
    pub fn dropped_points(&self) -> u64 {
        self.dropped_points
    }

    /// The next scan into `points`, which is cleared first; `None` at the end.
    ///
    /// # Errors
    /// A broken message costs that scan: the next call goes on behind it.
    pub fn next_scan(
        &mut self,
        points: &mut Vec<Point>,
    ) -> Result<Option<(ScanHeader, CloudInfo)>, BagError> {
        while let Some(message) = self.bag.next_message()? {
            if let Body::PointCloud(cloud) = &message.body {
                return Ok(Some(self.reader.read(cloud, message.stamp, points)));
            }
        }
        self.ended = true;
        points.clear();
        Ok(None)
    }
}

impl LidarScans for BagScans {
    type Error = BagError;

    /// Never waits: what is recorded is there, whatever the deadline. A scan that does not fit the
    /// sink is dropped whole and counted.
    fn read_scan(
        &mut self,
        points: &mut dyn PointSink,
        _deadline: Stamp,
    ) -> Result<Option<ScanHeader>, BagError> {
        points.clear();
        let mut own = std::mem::take(&mut self.points);
        let read = self.next_scan(&mut own);
        let header = read.map(|scan| {
            let (header, _) = scan?;
            if points.extend(&own).is_ok() {
                return Some(header);
            }
            self.dropped_points += own.len() as u64;
            None
        });
        self.points = own;
        header
    }

    fn at_end(&self) -> bool {
        self.ended
    }
}
