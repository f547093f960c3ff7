//! Tracks of people: the same number for the same person, frame after frame.
//!
//! In: what a detector found in a frame ([`Detection`]), the time since the last one, features of
//! appearance where they are known ([`Frame`]). Out: [`Track`]s.
//! Elsewhere: whose track is the robot's person, and mending what breaks in long occlusions
//! (re-identification); detecting.
//!
//! [`Tracker::step`] is the pipeline: predict, pair sure detections with people who are known and then
//! with those who are not yet, pair unsure ones with the rest (ByteTrack, Zhang et al., ECCV 2022),
//! give birth. A track is believed once the scores it was seen with are evidence enough.

mod filter;
mod single;
mod tracker;

pub use single::{Track, TrackState};
pub use tracker::{Detection, Features, Frame, LEAST_SHARE, Tracker, TrackerConfig};
