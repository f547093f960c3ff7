//! LEO-SLAM: nodes, submaps, loops, a map that stays true.
#![forbid(unsafe_code)]

pub mod cache;
pub mod codec;
pub mod edge;
pub mod ledger;
pub mod node;
pub mod store;
pub mod submap;
pub mod surfaces;
