//! Place recognition in LiDAR clouds: Scan Context++ and Gaussian Scan Context.
//!
//! In: levelled clouds (`[x, y, z, intensity]`, z up from the ground, the sensor above the origin).
//! Out: [`Descriptor`]s, and a [`Database`] that answers which known places look like this one,
//! turned by how much and how far aside. Elsewhere: poses and who may be a candidate (the caller's
//! closure), proving a match (`hachi-registration`), files.
//!
//! Sources: Kim, Choi, Kim: "Scan Context++: Structural Place Recognition Robust to Rotation and
//! Lateral Variations in Urban Environments", T-RO 2021; Gaussian Scan Context: Rollo's thesis
//! (2026).
//!
//! ```
//! use hachi_place::{Database, Describer, DescriberConfig, Leveller, Profile};
//!
//! # let scan = |turn: f32| -> Vec<[f32; 4]> {
//! #     (0..6000).map(|i| {
//! #         let a = i as f32 * 0.01;
//! #         let r = 6.0 + 3.0 * (2.0 * a).sin() + (5.0 * a).cos();
//! #         [r * (a + turn).cos(), r * (a + turn).sin(), (i % 9) as f32 * 0.3 - 0.5, 50.0]
//! #     }).collect()
//! # };
//! let mut levelled = Vec::new();
//! Leveller::default().level(&scan(0.0), None, &mut levelled);
//! let profile = Profile::for_cloud(&levelled).unwrap_or(Profile::OUTDOOR);
//! let mut describer = Describer::new(profile, DescriberConfig::default());
//! let mut database = Database::default();
//! let mut views = Vec::new();
//! describer.describe_views(&levelled, &mut views);
//! database.insert(7, &views[0])?;
//!
//! // Later, at the same place, turned by a quarter to the left.
//! Leveller::default().level(&scan(-std::f32::consts::FRAC_PI_2), None, &mut levelled);
//! describer.describe_views(&levelled, &mut views);
//! let mut matches = Vec::new();
//! database.query(&views, |id| id != 8, 1, &mut matches)?;
//! assert_eq!(matches[0].id, 7);
//! assert!((matches[0].yaw_rad - std::f32::consts::FRAC_PI_2).abs() < 0.1);
//! # Ok::<(), hachi_place::LayoutMismatch>(())
//! ```
#![forbid(unsafe_code)]

mod bytes;
mod comparison;
mod database;
mod database_file;
mod describer;
mod descriptor;
mod key_tree;
pub mod leveller;
mod polar;
pub mod precision_recall;
pub mod profile;
mod ring_key;

pub use bytes::Unreadable;
pub use comparison::{Comparison, ShiftSearch};
pub use database::{Database, DatabaseConfig, LayoutMismatch, Match, SearchConfig};
pub use describer::{Describer, DescriberConfig};
pub use descriptor::{Descriptor, Formula, Kind, Layout};
pub use leveller::{Ground, Levelled, Leveller};
pub use profile::{Profile, ProfileError};
pub use ring_key::RingKey;
