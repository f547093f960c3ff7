//! What passes from task to task. Large things are boxes that go round: whoever empties one sends
//! it back, so that nothing is allocated once all are under way.

use std::time::Instant;

use hachi_cloud::Filtered;
use hachi_hal::{Point, Pose, ScanHeader, Stamp};
use hachi_odometry::Estimate;
use hachi_people::detect::Found;
use hachi_people::observe::Observation;
use hachi_people::track::{Detection, Features};
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

/// A colour picture.
#[derive(Debug, Default)]
pub struct Picture {
    /// The middle of its exposure.
    pub stamp: Stamp,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Red, green, blue, row by row.
    pub rgb: Vec<u8>,
}

/// A picture that was looked at.
#[derive(Debug, Default)]
pub struct Looked {
    /// The picture.
    pub picture: Picture,
    /// What was found in it, with masks, in the order of the detections.
    pub found: Vec<Found>,
    detections: Vec<Detection>,
    /// Numbers in a feature; 0 where no network tells people apart.
    dimension: usize,
    features: Vec<f32>,
    same_person_distance: f64,
}

impl Looked {
    /// Keeps an observation.
    pub fn keep(&mut self, observed: &Observation<'_>) {
        self.detections.clear();
        self.detections.extend_from_slice(observed.detections);
        self.features.clear();
        self.dimension = 0;
        if let Some(features) = observed.features {
            self.dimension = features.dimension;
            self.features.extend_from_slice(features.values);
            self.same_person_distance = features.same_person_distance;
        }
    }

    /// What was kept.
    pub fn observation(&self) -> Observation<'_> {
        Observation {
            detections: &self.detections,
            features: (self.dimension > 0).then_some(Features {
                dimension: self.dimension,
                values: &self.features,
                same_person_distance: self.same_person_distance,
            }),
            columns: (self.picture.width > 0).then_some(self.picture.width),
        }
    }
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

/// Pictures make room for themselves: how large they are, the camera says.
impl Roomy for Picture {
    fn with_room(_: usize) -> Self {
        Self::default()
    }
}

impl Roomy for Looked {
    fn with_room(_: usize) -> Self {
        Self::default()
    }
}
