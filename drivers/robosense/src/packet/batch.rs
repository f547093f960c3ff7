//! Where the decoder puts the points of one packet.

use hachi_hal::Point;

use super::{BLOCKS, MAX_POINTS};

/// One firing of all lasers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Firing {
    /// Azimuth of the rotor at its first shot, degrees in `[0, 360)`.
    pub azimuth_deg: f32,
    /// Index of its first point in the batch.
    pub first_point: usize,
}

/// The points of one packet, oldest first, and the firings they come from. Made once and used
/// again.
#[derive(Debug, Clone)]
pub struct PointBatch {
    pub(super) points: [Point; MAX_POINTS],
    pub(super) len: usize,
    firings: [Firing; 2 * BLOCKS],
    firing_count: usize,
}

impl PointBatch {
    /// An empty batch.
    pub fn new() -> Self {
        Self {
            points: [Point::default(); MAX_POINTS],
            len: 0,
            firings: [Firing::default(); 2 * BLOCKS],
            firing_count: 0,
        }
    }

    /// The points.
    pub fn as_slice(&self) -> &[Point] {
        &self.points[..self.len]
    }

    /// The firings, in order of time.
    pub fn firings(&self) -> &[Firing] {
        &self.firings[..self.firing_count]
    }

    pub(super) fn clear(&mut self) {
        self.len = 0;
        self.firing_count = 0;
    }

    pub(super) fn begin_firing(&mut self, azimuth_deg: f32) {
        self.firings[self.firing_count] = Firing {
            azimuth_deg,
            first_point: self.len,
        };
        self.firing_count += 1;
    }
}

impl Default for PointBatch {
    fn default() -> Self {
        Self::new()
    }
}
