//! Recordings of any kind as a stream of scans.
//!
//! In: a path. Out: [`ScanSource`], whatever lies behind it: packets of a capture or a bag through
//! the drivers, clouds of a bag, files of a folder, the simulated robot. What the source dropped,
//! and why, comes with it.

mod packets;

use std::path::Path;

use hachi_bridge::{Bag, BagScans, Input, InputKind, ScanFiles};
use hachi_hal::{Point, ScanHeader};
use tracing::warn;

use crate::exit::Failure;

pub use packets::{from_bag_packets, from_capture, from_packets};

/// A stream of scans.
pub trait ScanSource {
    /// The next scan into `points`, which is cleared first; `None` at the end.
    ///
    /// # Errors
    /// The recording can't be read any further.
    fn next_scan(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Failure>;

    /// What was left out so far, by reason.
    fn dropped(&self) -> Vec<(String, u64)>;

    /// Packets that were decoded so far; 0 for a source of finished clouds.
    fn packets(&self) -> u64 {
        0
    }

    /// How many scans there are in all, where that is known beforehand.
    fn scan_count(&self) -> Option<u64> {
        None
    }
}

/// Opens a recording for its scans.
///
/// # Errors
/// The path holds nothing that can be read, or no LiDAR.
pub fn open(path: &Path) -> Result<Box<dyn ScanSource + Send>, Failure> {
    let input = Input::recognise(path).map_err(|e| unreadable(path, &e))?;
    match input.kind {
        InputKind::Pcap | InputKind::Pcapng => from_capture(path),
        kind if kind.is_bag() => match from_bag_packets(path) {
            Ok(source) => Ok(source),
            // No packets on any topic: perhaps whole clouds.
            Err(_) => match BagScans::open(path) {
                Ok(scans) => {
                    warn_of(scans.bag());
                    Ok(Box::new(Files {
                        scans,
                        unreadable: 0,
                    }))
                }
                Err(error) => Err(unreadable(path, &error)),
            },
        },
        _ => match ScanFiles::open(path) {
            Ok(scans) => Ok(Box::new(Files {
                scans,
                unreadable: 0,
            })),
            Err(error) => Err(unreadable(path, &error)),
        },
    }
}

/// Opens a recording for its packets only.
///
/// # Errors
/// As [`open`]; also where the recording holds finished clouds.
pub fn open_packets(path: &Path) -> Result<Box<dyn ScanSource + Send>, Failure> {
    let input = Input::recognise(path).map_err(|e| unreadable(path, &e))?;
    match input.kind {
        InputKind::Pcap | InputKind::Pcapng => from_capture(path),
        kind if kind.is_bag() => from_bag_packets(path),
        kind => Err(Failure::new(
            format_args!(
                "{} is {} and holds no packets",
                path.display(),
                kind.description()
            ),
            "give a pcap or pcapng capture, or a bag with LiDAR packets",
        )),
    }
}

fn unreadable(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    let text = error.to_string();
    let what = if text.contains(&*path.to_string_lossy()) {
        text
    } else {
        format!("{} can't be read: {text}", path.display())
    };
    Failure::new(what, "give a recording that `hachi replay --help` lists")
}

/// Says what reading a bag's container had to leave out: an index that breaks off, a log beside it.
fn warn_of(bag: &Bag) {
    for note in bag.notes() {
        warn!(path = %bag.path().display(), "{note}");
    }
}

/// How much [`warn_of`] has said, as a reason to count.
fn damage(bag: &Bag) -> (String, u64) {
    ("damaged_bag".to_owned(), bag.notes().len() as u64)
}

/// Readers whose scans can be broken one by one.
trait BrokenOneByOne {
    type Error: std::fmt::Display;
    fn next(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Self::Error>;
    fn points_without_room(&self) -> u64;
    fn damage(&self) -> Option<(String, u64)> {
        None
    }
    fn count(&self) -> Option<u64>;
}

impl BrokenOneByOne for ScanFiles {
    type Error = hachi_bridge::ReadError;
    fn next(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Self::Error> {
        Ok(self.next_scan(points)?.map(|(header, _)| header))
    }
    fn points_without_room(&self) -> u64 {
        self.dropped_points()
    }
    fn count(&self) -> Option<u64> {
        Some(self.len() as u64)
    }
}

impl BrokenOneByOne for BagScans {
    type Error = hachi_bridge::BagError;
    fn next(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Self::Error> {
        Ok(self.next_scan(points)?.map(|(header, _)| header))
    }
    fn points_without_room(&self) -> u64 {
        self.dropped_points()
    }
    fn damage(&self) -> Option<(String, u64)> {
        Some(damage(self.bag()))
    }
    fn count(&self) -> Option<u64> {
        None
    }
}

struct Files<R> {
    scans: R,
    unreadable: u64,
}

impl<R: BrokenOneByOne> ScanSource for Files<R> {
    fn next_scan(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Failure> {
        loop {
            match self.scans.next(points) {
                Ok(header) => return Ok(header),
                Err(error) => {
                    self.unreadable += 1;
                    warn!(%error, "a scan was left out");
                }
            }
        }
    }

    fn dropped(&self) -> Vec<(String, u64)> {
        let mut dropped = vec![
            ("unreadable_scan".to_owned(), self.unreadable),
            ("no_room".to_owned(), self.scans.points_without_room()),
        ];
        dropped.extend(self.scans.damage());
        dropped
    }

    fn scan_count(&self) -> Option<u64> {
        self.scans.count()
    }
}
