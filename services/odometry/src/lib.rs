//! LiDAR odometry: where the sensor went, scan by scan, and how sure that is.
//!
//! In: scans (filtered points with their times, sensor frame), and where there are any, inertial
//! samples and odometry from legs or wheels. Out: `odom_from_lidar` at the time of each scan's
//! last point, with a [`Condition`]. Elsewhere: removing points (`hachi-cloud`), the alignment
//! itself (`hachi-registration`), loops and maps that last.
//!
//! [`Odometry::step`] reads top to bottom as the data flows: scale, guess, deskew, reduce, align,
//! judge, remember. It holds no thread, clock or file, and once warm it allocates nothing.
#![forbid(unsafe_code)]

mod agility;
pub mod condition;
pub mod config;
pub mod measured;
pub mod motion;
mod news;
pub mod odometry;
pub mod scale;
pub mod search;
mod timing;

pub use condition::{Condition, Doubt};
pub use config::OdometryConfig;
pub use odometry::{Estimate, Guess, Odometry, ScanInput};
