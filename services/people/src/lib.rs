//! People in images: who is where from frame to frame, and how well that is known.
//!
//! In: what a detector found in each frame (boxes with scores, and what the people look like where
//! a network says so). Out: tracks with lasting numbers ([`track::Tracker`]), and how they compare
//! with the truth ([`metrics`]). No camera, no file, no clock, no thread.
//!
//! | module | holds |
//! |---|---|
//! | [`bounding_box`] | [`BoundingBox`]: a rectangle in an image |
//! | [`track`] | the tracker: Kalman boxes, gated assignment, birth and death |
//! | [`recording`] | tracks of a whole recording, completed once it is over |
//! | [`mot`] | MOTChallenge text: detections, truth and results |
//! | [`metrics`] | MOTA, IDF1 and their parts, as py-motmetrics computes them |
//! | [`assignment`] | the least-cost assignment of rows to columns |
#![forbid(unsafe_code)]

pub mod assignment;
pub mod bounding_box;
pub mod metrics;
pub mod mot;
pub mod recording;
pub mod track;

pub use bounding_box::BoundingBox;
