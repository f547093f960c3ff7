//! Trajectories: reading, writing, comparing and drawing them.
//!
//! In: text files of poses (TUM, KITTI, EuRoC; [`read`]) or poses pushed one at a time
//! ([`Trajectory::push`]). Out: absolute and relative pose errors ([`evaluate`]), text files
//! ([`mod@write`]), pictures ([`plot`]). No robot, no clock, no thread.
//!
//! The numbers are those of evo (the reference program of the field) on the same files, for its
//! translation part: `evo_ape`, `evo_rpe` with consecutive pairs. Its versions differ in one place,
//! the first stretch of relative errors over metres: both answers are given ([`Evaluation::rpe`],
//! [`Evaluation::rpe_from_first_pose`]). Where evo stops (a straight path, which leaves the
//! rotation about itself open), this crate goes on and says so.
//!
//! ```
//! use hachi_trajectory::{evaluate, read, Alignment, EvaluationOptions};
//!
//! let reference = "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 2 1 0 0 0 0 1\n";
//! let estimate = "0 5 0 0 0 0 0 1\n1 6 0 0 0 0 0 1\n2 7 1 0 0 0 0 1\n";
//! let reference = read::from_reader(reference.as_bytes())?.trajectory;
//! let estimate = read::from_reader(estimate.as_bytes())?.trajectory;
//! let options = EvaluationOptions { alignment: Alignment::Se3, ..Default::default() };
//! let evaluation = evaluate(&reference, &estimate, &options)?;
//! assert!(evaluation.ape.rmse < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod align;
mod associate;
mod decimal;
mod evaluate;
mod pose_error;
mod statistics;
mod trajectory;

pub mod plot;
pub mod read;
pub mod write;

pub use align::{Alignment, AlignmentError, Observed, Similarity, align};
pub use associate::{AssociationError, Pairing, associate};
pub use evaluate::{Evaluation, EvaluationError, EvaluationOptions, evaluate};
pub use pose_error::{DeltaError, RelativeDelta, absolute_errors, relative_errors, relative_pairs};
pub use statistics::Statistics;
pub use trajectory::{NotLater, Repairs, Trajectory};
