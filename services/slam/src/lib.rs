//! LEO-SLAM: nodes, submaps, loops, a map that stays true.
#![forbid(unsafe_code)]

pub mod alignment;
pub mod anchor;
pub mod cache;
pub mod candidates;
pub mod chain;
pub mod closing;
pub mod codec;
pub mod condition;
pub mod config;
pub mod confirmation;
pub mod covering;
pub mod edge;
pub mod graph;
pub mod grid;
pub mod ground;
pub mod growing;
pub mod input;
pub mod ledger;
pub mod map;
pub mod merge;
pub mod node;
pub mod overlay;
pub mod places;
pub mod recognition;
pub mod saved;
pub mod sight;
pub mod slam;
pub mod store;
pub mod submap;
pub mod surfaces;
pub mod tangent;
pub mod track;
pub mod uncertainty;
pub mod work;

pub use condition::{SlamCondition, SlamDoubt};
pub use config::SlamConfig;
pub use input::{ScanInput, SlamEstimate, SlamEvents, Visit};
pub use ledger::{LedgerEntry, LoopCounts, LoopId, Verdict};
pub use map::Map;
pub use node::{Node, NodeId, PieceId};
pub use slam::Slam;
pub use store::{MemoryStore, StoreError, StoreFault, SubmapStore};
