//! People in images: who is where from frame to frame, and how well that is known.
//!
//! In: images, and networks that find people and tell them apart; or what another detector found.
//! Out: people in each frame ([`detect`], [`appearance`]), tracks with lasting numbers ([`track`]),
//! and how they compare with the truth ([`metrics`]). No camera, no file, no clock, no thread.
//!
//! | module | holds |
//! |---|---|
//! | [`bounding_box`] | [`BoundingBox`]: a rectangle in an image |
//! | [`detect`] | people and things in an image, from the outputs of YOLO and YOLACT networks |
//! | [`appearance`] | what people look like, as features |
//! | [`gallery`] | how features compare, and how far one lies from the pictures of a person |
//! | [`observe`] | from an image to people with features |
//! | [`track`] | the tracker: Kalman boxes, gated assignment, birth and death |
//! | [`identify`] | which of them is the robot's person: FollowMe and CARPE-ID |
//! | [`pointing`] | whom the user means who points at a place or a track |
//! | [`watch`] | all of it, frame by frame: who is where |
//! | [`followed`] | how well one person was followed, against the truth |
//! | [`recording`] | tracks of a whole recording, completed once it is over |
//! | [`mot`] | MOTChallenge text: detections, truth and results |
//! | [`metrics`] | MOTA, IDF1 and their parts, as py-motmetrics computes them |
//! | [`assignment`] | the least-cost assignment of rows to columns |
#![forbid(unsafe_code)]

pub mod appearance;
pub mod assignment;
pub mod bounding_box;
pub mod detect;
pub mod followed;
pub mod gallery;
pub mod identify;
pub mod metrics;
pub mod mot;
pub mod observe;
pub mod pointing;
pub mod recording;
pub mod track;
pub mod watch;

pub use bounding_box::BoundingBox;
