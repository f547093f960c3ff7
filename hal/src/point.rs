//! One LiDAR return, and the place where decoders put them.

/// Which of several echoes of one laser shot a point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
pub enum ReturnKind {
    /// The source does not say (a file of bare points).
    #[default]
    Unknown = 0,
    /// The strongest echo.
    Strongest = 1,
    /// The last echo.
    Last = 2,
    /// The first echo.
    First = 3,
    /// The sensor was in dual mode and both echoes are this one.
    StrongestAndLast = 4,
    /// The second strongest, which a dual sensor sends when the strongest is also the last.
    SecondStrongest = 5,
}

/// One LiDAR return in the sensor's frame: x forward, y left, z up.
///
/// 32 bytes, no padding of consequence: two fill a cache line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Point {
    /// Forward, metres.
    pub x: f32,
    /// Left, metres.
    pub y: f32,
    /// Up, metres.
    pub z: f32,
    /// As the sensor gives it, 0 to 255.
    pub intensity: f32,
    /// Nanoseconds after the scan's first point.
    pub time_offset_ns: u32,
    /// The firing's azimuth in the sensor's own sense, degrees in `[0, 360)`.
    pub azimuth_deg: f32,
    /// The measured distance, metres, before any lens or beam offset.
    pub range_m: f32,
    /// Beam, 0 is the lowest.
    pub ring: u16,
    /// Which echo.
    pub returned: ReturnKind,
}

impl Point {
    /// The position in the sensor's frame, metres.
    pub const fn position(&self) -> [f32; 3] {
        [self.x, self.y, self.z]
    }

    /// A bare point at a position, with range filled in and everything else at its default.
    pub fn at(x: f32, y: f32, z: f32) -> Self {
        let range_m = nalgebra::Vector3::new(x, y, z).norm();
        Self {
            x,
            y,
            z,
            range_m,
            ..Self::default()
        }
    }

    /// Whether all three coordinates are finite.
    pub fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

/// The sink can take no more points; the rest of the scan is counted as dropped by the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinkFull;

/// Where a decoder puts points: a fixed-capacity buffer on the robot, a `Vec` elsewhere.
pub trait PointSink {
    /// Appends all of `points`, or none of them.
    fn extend(&mut self, points: &[Point]) -> Result<(), SinkFull>;
    /// Empties the sink, keeping its memory.
    fn clear(&mut self);
    /// What was put in so far.
    fn points(&self) -> &[Point];
}

impl<const N: usize> PointSink for heapless::Vec<Point, N> {
    fn extend(&mut self, points: &[Point]) -> Result<(), SinkFull> {
        self.extend_from_slice(points).map_err(|_| SinkFull)
    }
    fn clear(&mut self) {
        heapless::Vec::clear(self);
    }
    fn points(&self) -> &[Point] {
        self
    }
}

#[cfg(feature = "alloc")]
impl PointSink for alloc::vec::Vec<Point> {
    fn extend(&mut self, points: &[Point]) -> Result<(), SinkFull> {
        self.extend_from_slice(points);
        Ok(())
    }
    fn clear(&mut self) {
        alloc::vec::Vec::clear(self);
    }
    fn points(&self) -> &[Point] {
        self
    }
}
