//! What passes from task to task. Large things are boxes that go round: whoever empties one sends
//! it back, so that nothing is allocated once all are under way.

use std::time::Instant;

use hachi_cloud::Filtered;
use hachi_hal::{Point, Pose, ScanHeader};
use hachi_odometry::Estimate;
use hachi_runtime::{Receiver, Sender, TaskTable, WhenFull, bounded};

/// Points of a scan that boxes have room for from the beginning: a VLP-16's turn.
const POINTS: usize = 32_000;

/// A scan as the LiDAR's driver gave it.
#[derive(Debug, Default)]
pub struct Scan {
    /// What is true of all its points.
    pub header: ScanHeader,
    /// Its points, sensor frame.
    pub points: Vec<Point>,
}

/// What the filters left of a scan.
#[derive(Debug, Default)]
pub struct Kept {
    /// What is true of all its points.
    pub header: ScanHeader,
    /// The points that stayed, sensor frame.
    pub points: Vec<Point>,
    /// How many there were.
    pub scanned: usize,
    /// What went, and why.
    pub filtered: Option<Filtered>,
    /// When work on the scan began.
    pub begun: Option<Instant>,
}

/// A scan that odometry placed.
#[derive(Debug, Default)]
pub struct Placed {
    /// Where, and how sure; `None` in a box that goes back.
    pub estimate: Option<Estimate>,
    /// The base in the odometry's frame.
    pub odom_from_base: Pose,
    /// The points that stayed, base frame, as if taken at the scan's end.
    pub points: Vec<Point>,
    /// When work on the scan began.
    pub begun: Option<Instant>,
}

/// How the odometry's frame lies on the map, and whether to be trusted.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Takes points of the odometry's frame to the map.
    pub map_from_odom: Pose,
    /// Whether the robot is on the map.
    pub trusted: bool,
}

/// A way there for full boxes and a way back for empty ones.
#[derive(Debug)]
pub struct Belt<T> {
    /// Full boxes to the next task.
    pub full: Sender<Box<T>>,
    /// Empty boxes.
    pub empty: Receiver<Box<T>>,
    back: Sender<Box<T>>,
}

/// The other end of a [`Belt`].
#[derive(Debug)]
pub struct BeltEnd<T> {
    /// Full boxes.
    pub full: Receiver<Box<T>>,
    back: Sender<Box<T>>,
}

impl<T> Belt<T> {
    /// Sends a full box on; one that had to make room for it comes back to be filled again.
    pub fn send(&self, full: Box<T>) {
        if let Some(displaced) = self.full.send(full) {
            self.give_back(displaced);
        }
    }

    /// A box that was not needed after all.
    pub fn give_back(&self, empty: Box<T>) {
        // There is room for every box that was made.
        let _ = self.back.send(empty);
    }
}

impl<T> BeltEnd<T> {
    /// Sends an empty box back.
    pub fn give_back(&self, empty: Box<T>) {
        let _ = self.back.send(empty);
    }
}

/// A belt with room for `waiting` full boxes, which release the task behind `bell`; beside them one
/// is being filled and one emptied.
pub fn belt<T: Roomy + Send + 'static>(
    table: &TaskTable,
    name: &'static str,
    waiting: usize,
    bell: &hachi_runtime::Bell,
) -> (Belt<T>, BeltEnd<T>) {
    let (full, taken) = bounded(name, waiting, WhenFull::DropOldest, bell);
    let boxes = waiting + 2;
    let (back, empty) = bounded(name, boxes, WhenFull::DropNewest, &table.bell());
    for _ in 0..boxes {
        let _ = back.send(Box::new(T::with_room(POINTS)));
    }
    let end = BeltEnd {
        full: taken,
        back: back.clone(),
    };
    (Belt { full, empty, back }, end)
}

/// What can be made with room for a scan's points.
pub trait Roomy: Default {
    /// Made with room for so many points.
    fn with_room(points: usize) -> Self;
}

impl Roomy for Scan {
    fn with_room(points: usize) -> Self {
        Self {
            points: Vec::with_capacity(points),
            ..Self::default()
        }
    }
}

impl Roomy for Kept {
    fn with_room(points: usize) -> Self {
        Self {
            points: Vec::with_capacity(points),
            ..Self::default()
        }
    }
}

impl Roomy for Placed {
    fn with_room(points: usize) -> Self {
        Self {
            points: Vec::with_capacity(points),
            ..Self::default()
        }
    }
}
