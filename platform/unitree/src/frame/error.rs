//! Why bytes were refused, and why values were.

use super::layout::{FrameKind, Model};

/// Why bytes are not the frame that was expected, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Too long or too short, and no other frame that is known.
    #[error("a {} of a {} has {expected} bytes, got {got}", kind.name(), model.name())]
    Length {
        /// Expected robot.
        model: Model,
        /// Expected frame.
        kind: FrameKind,
        /// Its bytes.
        expected: usize,
        /// Bytes that came.
        got: usize,
    },
    /// As long as another frame, or as the same frame of another robot.
    #[error(
        "{got} bytes are a {} of a {}, not a {} of a {}",
        got_kind.name(), got_model.name(), kind.name(), model.name()
    )]
    OtherFrame {
        /// Expected robot.
        model: Model,
        /// Expected frame.
        kind: FrameKind,
        /// Robot whose frame has this length.
        got_model: Model,
        /// Frame of this length.
        got_kind: FrameKind,
        /// Bytes that came.
        got: usize,
    },
    /// The first two bytes are not 0xFE 0xEF.
    #[error("the frame begins with {:#04x} {:#04x}, not 0xfe 0xef", got[0], got[1])]
    Head {
        /// The first two bytes.
        got: [u8; 2],
    },
    /// The check value fits in no form that is allowed here.
    #[error("check value {stored:#010x} instead of {plain:#010x}, transformed {transformed:#010x}")]
    Check {
        /// The one in the frame.
        stored: u32,
        /// The frame's own, plain.
        plain: u32,
        /// The frame's own, transformed.
        transformed: u32,
    },
    /// The level flag is of another kind of frame.
    #[error("level flag {got:#04x} in a {}", kind.name())]
    Level {
        /// Expected frame.
        kind: FrameKind,
        /// The flag.
        got: u8,
    },
}

/// Why a value in a sound frame, or for one, can't be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// Not a number, or infinite.
    #[error("{field}[{index}] is {got}, not a finite number")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Which of its values; motors count from front right hip.
        index: usize,
        /// What it was.
        got: f32,
    },
    /// Farther out than the robot can be.
    #[error("{field}[{index}] is {got}, outside {least} to {most}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Which of its values.
        index: usize,
        /// What it was.
        got: f32,
        /// Least possible.
        least: f32,
        /// Most possible.
        most: f32,
    },
    /// The attitude's quaternion has not length 1: the robot's estimate is not running.
    #[error("the attitude's quaternion has length {length}, not 1")]
    Quaternion {
        /// Its length.
        length: f32,
    },
}

/// The first of `values` that is not finite.
pub(crate) fn all_finite(field: &'static str, values: &[f32]) -> Result<(), FieldError> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(FieldError::NotFinite {
            field,
            index,
            got: values[index],
        }),
    }
}
