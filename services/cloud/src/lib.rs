//! Point clouds: filters that label, a voxel grid, nearest neighbours and surface shape.
//!
//! In: slices of [`hachi_hal::Point`] or bare positions (`[f32; 3]`, metres). Out: labels, smaller
//! clouds, neighbours, normals. Elsewhere: aligning clouds (`hachi-registration`), reading files
//! (`hachi-bridge`).
//!
//! `no_std` with `alloc`; the `std` feature only brings faster mathematics. Every stage keeps its
//! buffers: once warm, nothing allocates.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod adaptive;
mod angular;
pub mod ceiling;
mod chains;
pub mod config;
pub mod crop;
pub mod filters;
mod float;
pub mod ghost;
pub mod ground;
pub mod ground_tracker;
pub mod intensity;
pub mod label;
pub mod nearest;
pub mod normals;
pub mod outlier;
pub mod surface;
pub mod voxel;

pub use adaptive::IntensityModel;
pub use ceiling::CeilingFilter;
pub use config::{FilterConfig, FilterConfigError};
pub use crop::BodyBox;
pub use filters::{Filtered, Filters, GroundUse, IntensityUse, ScanFrames};
pub use ghost::GhostFilter;
pub use ground::{GroundFinder, GroundPlane, NoGround};
pub use ground_tracker::{GroundEstimate, GroundSource, GroundTracker};
pub use intensity::{Height, IntensityMode, RejectRange};
pub use label::{Reason, RemovalCounts, compact};
pub use nearest::{KdTree, NearestK, Neighbour};
pub use normals::Normals;
pub use outlier::OutlierFilter;
pub use surface::Surface;
pub use voxel::VoxelGrid;
