//! Table 32: the colour camera, and where it stands beside the left imager.
//!
//! The maker calls the lens model "inverse Brown-Conrady" and applies its polynomial, in his library
//! and in his ROS driver alike, from the pin hole's picture to the lens's: the common model.

use hachi_hal::geometry::Rotation;
use hachi_hal::{Distortion, Intrinsics, Pose, Vector3};
use nalgebra::{Matrix3, Rotation3};

use super::{CalibrationError, TABLE_HEAD, believed, contents};
use crate::bytes::{f32s_at, u16_at};

pub(crate) const INTRINSIC_AT: usize = 16;
pub(crate) const DISTORTION_AT: usize = 52;
pub(crate) const SIZE_AT: usize = 144;
pub(crate) const ROTATION_AT: usize = 184;
pub(crate) const TRANSLATION_AT: usize = 220;

/// The table gives millimetres.
const METRES: f64 = 1e-3;
/// How far a stored rotation may be from a real one: single precision and the factory's rounding.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// The colour camera's calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorCalibration {
    /// Focal lengths and centre where the picture spans -1 to 1 in both directions.
    focal: [f64; 2],
    centre: [f64; 2],
    distortion: [f64; 5],
    /// Rows by columns of the picture it was calibrated with.
    aspect: f64,
    depth_from_color: Pose,
}

impl ColorCalibration {
    /// The table's number.
    pub const TABLE: u16 = 32;
    /// Bytes of the table.
    pub const LEN: usize = 256;

    /// Reads the table.
    ///
    /// # Errors
    /// It is not this table, damaged, or has numbers that are none.
    pub fn decode(bytes: &[u8]) -> Result<Self, CalibrationError> {
        let contents = contents(bytes, Self::TABLE, Self::LEN)?;
        // Offsets are those of the whole table.
        let at = |offset: usize| offset - TABLE_HEAD;
        let [fx, _, cx, _, fy, cy, ..]: [f64; 9] = f32s_at(contents, at(INTRINSIC_AT));
        let size = [0, 2].map(|i| u16_at(contents, at(SIZE_AT + i)));
        let aspect = match size {
            [0, _] | [_, 0] => 9.0 / 16.0,
            [width, height] => f64::from(height) / f64::from(width),
        };
        let rotation: [f64; 9] = f32s_at(contents, at(ROTATION_AT));
        let translation_mm: [f64; 3] = f32s_at(contents, at(TRANSLATION_AT));
        Ok(Self {
            focal: [fx, fy],
            centre: [cx, cy],
            distortion: f32s_at(contents, at(DISTORTION_AT)),
            aspect,
            depth_from_color: depth_from_color(&rotation, &translation_mm)?,
        })
    }

    /// From the colour camera's frame to the depth camera's.
    pub fn depth_from_color(&self) -> &Pose {
        &self.depth_from_color
    }

    /// Where the pixels of a colour image of this size look. A picture of another shape than the
    /// calibrated one is a part of it, cut at the top and bottom or at the sides.
    ///
    /// # Errors
    /// The table's numbers are no camera's.
    pub fn intrinsics(&self, width: u32, height: u32) -> Result<Intrinsics, CalibrationError> {
        let (columns, rows) = (f64::from(width), f64::from(height));
        let aspect = rows / columns;
        let (mut focal, mut centre) = (self.focal, self.centre);
        let (cut, by) = if aspect < self.aspect {
            (1, self.aspect / aspect)
        } else {
            (0, aspect / self.aspect)
        };
        focal[cut] *= by;
        centre[cut] *= by;
        let half = [columns / 2.0, rows / 2.0];
        let picture = Intrinsics {
            width,
            height,
            focal: [focal[0] * half[0], focal[1] * half[1]],
            centre: [(1.0 + centre[0]) * half[0], (1.0 + centre[1]) * half[1]],
            distortion: Distortion::BrownConrady(self.distortion),
        };
        believed(picture, Self::TABLE)
    }
}

/// The table holds the rotation column by column and the negated translation, as librealsense
/// reads it.
fn depth_from_color(
    rotation: &[f64; 9],
    translation_mm: &[f64; 3],
) -> Result<Pose, CalibrationError> {
    let matrix = Matrix3::from_column_slice(rotation);
    let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    let translation = Vector3::from_column_slice(translation_mm) * -METRES;
    // Written so that not-a-number is refused. The camera's case is well below a metre wide.
    let fits = off < ROTATION_TOLERANCE && matrix.determinant() > 0.0 && translation.amax() < 1.0;
    if !fits {
        return Err(CalibrationError::Impossible {
            table: ColorCalibration::TABLE,
            what: "extrinsics",
            width: 0,
            height: 0,
        });
    }
    let rotation = Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    let rotation = Rotation::new_normalize(rotation.into_inner());
    Ok(Pose::from_parts(translation.into(), rotation))
}
