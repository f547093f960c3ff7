//! Registration: finds the rigid transform that lays one point cloud on another.
//!
//! Generalised ICP (Segal, Haehnel, Thrun: "Generalized-ICP", RSS 2009): every point stands for
//! the little piece of surface around it, so that points may slide along surfaces but not off
//! them. Solved by Gauss-Newton or Levenberg-Marquardt on SE(3).
//!
//! In: a source cloud with normals, a target that answers "which surface is nearest", a guess.
//! Out: `target_from_source`, and how far to trust it: converged, inlier share, residual,
//! information matrix, directions the clouds do not constrain. Elsewhere: removing points
//! (`hachi-cloud`), chaining poses (`hachi-odometry`).
//!
//! Parallel parts run in the caller's rayon pool over chunks of fixed size; sums are taken in
//! chunk order, so that the bits of the answer do not depend on the number of threads.
#![forbid(unsafe_code)]

pub mod align;
pub mod chain;
pub mod cloud;
pub mod degeneracy;
pub mod linearize;
pub mod local_map;
pub mod moving;
pub mod pair;

pub use align::{Aligner, AlignerConfig, Prior, Registration, Solver};
pub use chain::{Agility, Chain, Increment};
pub use cloud::{Preparer, SurfaceCloud, SurfacePoint};
pub use degeneracy::Degeneracy;
pub use linearize::SurfaceTarget;
pub use local_map::{LocalMap, LocalMapConfig};
pub use moving::{Fit, MovingAligner, MovingConfig, TimedSurface};
pub use pair::Kernel;
