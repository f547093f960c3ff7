//! Where each laser points, as the DIFOP packet or a user says.
//!
//! The DIFOP packet has two tables of 32 entries, of which 16 count: sign byte (0 up or clockwise,
//! 1 down or against it, 0xFF not calibrated), then hundredths of a degree.

use super::LASER_COUNT;

/// Why a calibration was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The sensor says that it is not calibrated.
    #[error("laser {laser} is marked as not calibrated")]
    NotCalibrated {
        /// Index of the laser.
        laser: usize,
    },
    /// A sign byte that is neither 0, 1 nor 0xFF.
    #[error("laser {laser} has sign byte {got:#04x}")]
    Sign {
        /// Index of the laser.
        laser: usize,
        /// The byte.
        got: u8,
    },
    /// An angle that no laser can have.
    #[error("laser {laser} is said to point to {degrees} degrees")]
    Range {
        /// Index of the laser.
        laser: usize,
        /// The angle.
        degrees: f32,
    },
}

/// Where each laser points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    vertical_deg: [f32; LASER_COUNT],
    horizontal_deg: [f32; LASER_COUNT],
}

impl Calibration {
    /// The manual's fan, +15° to −15° in steps of 2°: for a sensor whose own angles are not known.
    /// A real sensor differs by degrees.
    pub fn nominal() -> Self {
        Self {
            vertical_deg: core::array::from_fn(|laser| 15.0 - 2.0 * laser as f32),
            horizontal_deg: [0.0; LASER_COUNT],
        }
    }

    /// From angles in degrees in laser order: elevation, and how far clockwise of the block's
    /// azimuth.
    pub fn new(
        vertical_deg: [f32; LASER_COUNT],
        horizontal_deg: [f32; LASER_COUNT],
    ) -> Result<Self, CalibrationError> {
        for (laser, angles) in vertical_deg.iter().zip(&horizontal_deg).enumerate() {
            for &degrees in [angles.0, angles.1] {
                // Not a number fails too.
                if !(-90.0..90.0).contains(&degrees) {
                    return Err(CalibrationError::Range { laser, degrees });
                }
            }
        }
        Ok(Self {
            vertical_deg,
            horizontal_deg,
        })
    }

    /// From the two tables of a DIFOP packet, three bytes to a laser.
    pub(super) fn from_tables(
        vertical: &[u8],
        horizontal: &[u8],
    ) -> Result<Self, CalibrationError> {
        let mut angles = [[0.0; LASER_COUNT]; 2];
        for (target, table) in angles.iter_mut().zip([vertical, horizontal]) {
            for (laser, (angle, entry)) in target.iter_mut().zip(table.chunks_exact(3)).enumerate()
            {
                let magnitude = f32::from(u16::from_be_bytes([entry[1], entry[2]])) * 0.01;
                *angle = match entry[0] {
                    0 => magnitude,
                    1 => -magnitude,
                    0xFF => return Err(CalibrationError::NotCalibrated { laser }),
                    got => return Err(CalibrationError::Sign { laser, got }),
                };
            }
        }
        Self::new(angles[0], angles[1])
    }

    /// Elevation of each laser, degrees.
    pub fn vertical_deg(&self) -> &[f32; LASER_COUNT] {
        &self.vertical_deg
    }

    /// How far each laser points clockwise of the block's azimuth, degrees.
    pub fn horizontal_deg(&self) -> &[f32; LASER_COUNT] {
        &self.horizontal_deg
    }

    /// Rank of each laser by elevation, 0 is the lowest. Of two that point equally high the earlier
    /// one ranks lower.
    pub fn rings(&self) -> [u16; LASER_COUNT] {
        core::array::from_fn(|laser| {
            let mine = (self.vertical_deg[laser], laser);
            let others = self.vertical_deg.iter().copied().zip(0..);
            others.filter(|other| *other < mine).count() as u16
        })
    }
}
