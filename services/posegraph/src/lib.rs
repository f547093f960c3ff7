//! Pose graphs: factors, batch solvers, iSAM2, marginals, g2o files.
#![forbid(unsafe_code)]

mod anchor;
pub mod batch;
mod dense;
mod error;
mod factor;
pub mod g2o;
mod graph;
mod group;
pub mod initialise;
mod isam2;
mod kernel;
mod ordering;
pub mod replay;
mod slab;
mod sparse;
mod symbolic;

pub use error::Error;
pub use factor::{Factor, FactorDescription, FactorId, FactorKind, Key};
pub use graph::Graph;
pub use group::{Dense, Group, Se2, Se3, Square};
pub use isam2::{Isam2, Isam2Config, UpdateOptions, UpdateReport};
pub use kernel::Kernel;
