//! The formats: how each is recognised, and one line of it turned into a pose.
//!
//! - TUM, <https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats>: 8 numbers.
//! - KITTI odometry, development kit readme: 12 numbers, the upper rows of a 4x4 matrix.
//! - EuRoC, <https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets>: commas,
//!   time in nanoseconds, the quaternion's w first, then columns that are not read.

use std::fmt;

use hachi_hal::{Pose, Rotation, Stamp, Vector3};
use nalgebra::{Matrix3, Quaternion, Rotation3};

use super::ReadError;
use super::line::Fields;
use crate::decimal::parse_stamp;

/// How a trajectory is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Format {
    /// `t x y z qx qy qz qw`, seconds and metres.
    Tum,
    /// A 3x4 matrix row by row, no times.
    Kitti,
    /// `t, x, y, z, qw, qx, qy, qz, ...`, nanoseconds and metres.
    Euroc,
}

impl Format {
    /// Whether poses have times.
    pub fn has_times(self) -> bool {
        self != Self::Kitti
    }

    /// One line of it as a pose.
    pub(super) fn parse(self, fields: &Fields<'_>, line: u64) -> Result<Parsed, ReadError> {
        let expected = match self {
            Self::Kitti => 12,
            Self::Tum | Self::Euroc => 8,
        };
        let more_is_fine = self == Self::Euroc && fields.len() > expected;
        if fields.len() != expected && !more_is_fine {
            return Err(ReadError::FieldCount {
                line,
                got: fields.len(),
                expected,
                format: self,
            });
        }
        match self {
            Self::Kitti => matrix_line(fields, line),
            Self::Tum => quaternion_line(fields, line, 9, [4, 5, 6, 7]),
            Self::Euroc => quaternion_line(fields, line, 0, [5, 6, 7, 4]),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tum => "TUM",
            Self::Kitti => "KITTI",
            Self::Euroc => "EuRoC",
        })
    }
}

/// A pose of one line.
pub(super) struct Parsed {
    pub(super) stamp: Option<Stamp>,
    pub(super) pose: Pose,
    /// Whether the quaternion's length was off by more than 1 %.
    pub(super) normalised: bool,
}

/// What comments and headers said before the first numbers.
#[derive(Default)]
pub(super) struct Clues {
    header: bool,
    /// `qw` was named before `qx`.
    w_first: bool,
}

impl Clues {
    /// A comment. EuRoC's column names stand in one.
    pub(super) fn note(&mut self, text: &str) {
        let place = |names: [&str; 3]| names.iter().filter_map(|n| text.find(n)).min();
        if let (Some(w), Some(x)) = (
            place(["qw", "q_w", "q_RS_w"]),
            place(["qx", "q_x", "q_RS_x"]),
        ) {
            self.w_first = w < x;
        }
    }

    /// A header line. There may be one.
    pub(super) fn note_header(&mut self, text: &str) {
        self.header = true;
        self.note(text);
    }

    pub(super) fn header_seen(&self) -> bool {
        self.header
    }

    /// The format of a file by its first line of numbers.
    ///
    /// Commas alone don't make EuRoC: TUM is written with commas too. Then the time decides
    /// (whole nanoseconds, against seconds with a point), unless the columns are named.
    pub(super) fn recognise(&self, fields: &Fields<'_>, line: u64) -> Result<Format, ReadError> {
        let nanoseconds = || {
            let time = fields.get(0);
            let whole = time.bytes().all(|b| b.is_ascii_digit() || b == b'-');
            let large = time
                .parse::<f64>()
                .is_ok_and(|t| t.abs() >= LEAST_NANOSECONDS);
            whole || large
        };
        match fields.len() {
            12 => Ok(Format::Kitti),
            8 if !fields.commas => Ok(Format::Tum),
            8 if !self.w_first && !nanoseconds() => Ok(Format::Tum),
            8.. if fields.commas => Ok(Format::Euroc),
            fields => Err(ReadError::UnknownFormat { line, fields }),
        }
    }
}

/// A time this large is in nanoseconds: as seconds it would be 3,000 years on.
const LEAST_NANOSECONDS: f64 = 1e11;

/// Farther than this from the origin, metres, is no place of a robot, and squares of sums of it
/// still fit a double with room.
const FARTHEST_M: f64 = 1e12;

/// How far, by any element of `R' R`, a KITTI matrix may be from a rotation. The official files
/// have 7 digits and are within 1e-6; 1e-3 takes three digits.
const MATRIX_TOLERANCE: f64 = 1e-2;

/// The beginning of a field, for an error message.
fn excerpt(text: &str) -> String {
    text.chars().take(24).collect()
}

fn number(fields: &Fields<'_>, index: usize, line: u64) -> Result<f64, ReadError> {
    let text = fields.get(index);
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= FARTHEST_M => Ok(value), // false for NaN
        _ => Err(ReadError::NotANumber {
            line,
            field: index + 1,
            text: excerpt(text),
        }),
    }
}

/// `xyzw`: the columns of the quaternion's parts.
fn quaternion_line(
    fields: &Fields<'_>,
    line: u64,
    unit_exponent: i32,
    xyzw: [usize; 4],
) -> Result<Parsed, ReadError> {
    let time = fields.get(0);
    let stamp = parse_stamp(time, unit_exponent).ok_or_else(|| ReadError::Time {
        line,
        text: excerpt(time),
        unit: if unit_exponent == 0 {
            "nanoseconds"
        } else {
            "seconds"
        },
    })?;
    let value = |index| number(fields, index, line);
    let position = Vector3::new(value(1)?, value(2)?, value(3)?);
    let [x, y, z, w] = xyzw.map(value);
    let quaternion = Quaternion::new(w?, x?, y?, z?);
    let length = quaternion.norm();
    if length < 1e-6 {
        return Err(ReadError::NotARotation {
            line,
            reason: "the quaternion is zero",
        });
    }
    Ok(Parsed {
        stamp: Some(stamp),
        pose: Pose::from_parts(position.into(), Rotation::from_quaternion(quaternion)),
        normalised: (length - 1.0).abs() > 0.01,
    })
}

fn matrix_line(fields: &Fields<'_>, line: u64) -> Result<Parsed, ReadError> {
    let mut values = [0.0; 12];
    for (index, value) in values.iter_mut().enumerate() {
        *value = number(fields, index, line)?;
    }
    let [a, b, c, x, d, e, f, y, g, h, i, z] = values;
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let off = (matrix.transpose() * matrix - Matrix3::identity())
        .abs()
        .max();
    if off > MATRIX_TOLERANCE {
        return Err(ReadError::NotARotation {
            line,
            reason: "its matrix is not orthonormal",
        });
    }
    if matrix.determinant() < 0.0 {
        return Err(ReadError::NotARotation {
            line,
            reason: "its matrix is a reflection",
        });
    }
    let rotation = Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Ok(Parsed {
        stamp: None,
        pose: Pose::from_parts(Vector3::new(x, y, z).into(), rotation),
        normalised: false,
    })
}
