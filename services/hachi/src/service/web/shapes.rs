//! What `/people` tells and takes, as JSON: the service writes what the commands read, and the other way.

use serde::{Deserialize, Serialize};

use crate::service::enrolment::Stage;

/// What `GET /people` says.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct People {
    /// The last picture that was looked at; `None` before the first one.
    pub picture: Option<PictureStatus>,
    /// Everybody in view.
    pub in_view: Vec<InViewStatus>,
    /// Everybody whom the robot knows.
    pub known: Vec<KnownStatus>,
    /// The enrolment that goes on, or the last one.
    pub enrolment: Option<EnrolmentStatus>,
}

/// The last picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureStatus {
    /// The middle of its exposure on the robot's clock, nanoseconds.
    pub stamp_ns: i64,
    /// How long that is ago, seconds.
    pub age_s: f64,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
}

/// Somebody in view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InViewStatus {
    /// The track's number.
    pub track: u64,
    /// Where, pixels.
    #[serde(rename = "box")]
    pub bounding_box: BoxStatus,
    /// Whether they are believed to be a person.
    pub confirmed: bool,
    /// Time since they were seen: 0 if in this picture, seconds.
    pub unseen_s: f64,
}

/// A rectangle in the picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxStatus {
    /// Its left edge.
    pub left: f64,
    /// Its upper edge.
    pub top: f64,
    /// From left to right.
    pub width: f64,
    /// From top to bottom.
    pub height: f64,
}

/// Somebody whom the robot knows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownStatus {
    /// Their number while the service runs.
    pub number: u32,
    /// What they are called, if they are in the store.
    pub name: Option<String>,
    /// Whether they are the robot's person.
    pub picked: bool,
    /// `SEEN`, `FOUND`, `UNSURE`, `LOST` or `SEARCHING`.
    pub condition: String,
    /// How much they look like themselves, 0 to 1.
    pub confidence: f64,
    /// Their track, while they are in view.
    pub track: Option<u64>,
    /// Since when they are not in view, seconds.
    pub unseen_s: f64,
}

/// An enrolment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnrolmentStatus {
    /// Its number.
    pub number: u32,
    /// How far it is.
    pub stage: Stage,
    /// Looks taken.
    pub taken: usize,
    /// Looks wanted.
    pub wanted: usize,
    /// When it ends by itself, seconds.
    pub left_s: f64,
    /// The number of the person, once they are known.
    pub person: Option<u32>,
    /// What there is to be done, in a sentence.
    pub advice: String,
}

/// An order to pick somebody.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PickOrder {
    /// A track's number,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track: Option<u64>,
    /// or a place in the picture, pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 2]>,
}

/// An order to enrol somebody.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnrolOrder {
    /// What to call them.
    pub name: String,
}

/// An order that needs no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BareOrder {}

/// Somebody is the robot's person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PickedStatus {
    /// Their track.
    pub track: u64,
    /// Their number.
    pub person: u32,
    /// Whether the robot knew them before.
    pub known: bool,
}

/// An enrolment has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BegunStatus {
    /// Its number.
    pub enrolment: u32,
    /// Looks wanted.
    pub wanted: usize,
}

/// The enrolment is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancelledStatus {
    /// Whether there was one.
    pub cancelled: bool,
}

/// The robot has no person any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReleasedStatus {
    /// Who was it, if somebody was.
    pub released: Option<u32>,
}

/// Why something was not done, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorStatus {
    /// In a sentence.
    pub error: String,
}
