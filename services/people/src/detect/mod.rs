//! Who and what is in an image.
//!
//! In: an image, a detector's network with its manifest. Out: boxes with scores and classes, and
//! masks where the network has them, in pixels of the image. Elsewhere: who is who.
//!
//! [`Detector::detect`] is the pipeline: fit the image in, run, decode the outputs by their family
//! ([`yolox`], [`yolov8`], [`yolact`]), leave out what was found twice, bring the rest back to the
//! image, assemble masks.

mod candidate;
mod detector;
mod mask;
mod suppress;
pub mod yolact;
pub mod yolov8;
pub mod yolox;

pub use candidate::{Candidate, DecodeError};
pub use detector::{DetectError, Detector, Found, NotADetector, Wanted};
pub use mask::Mask;
pub use suppress::suppress;
