//! Every file format that goes in or out of Hachi, and none of its algorithms.
//!
//! In: recordings (ROS 1 and ROS 2 bags), folders of scans, cloud files, IMU text. Out: hal's
//! [`Point`](hachi_hal::Point)s and [`ScanHeader`](hachi_hal::ScanHeader)s, sensor packets behind
//! hal's [`PacketSource`](hachi_hal::PacketSource), IMU and odometry samples; and cloud files
//! written whole or not at all. Captures (pcap, pcapng) are recognised here and read by
//! `hachi-datagram`; packets are decoded by the drivers; trajectories belong to
//! `hachi-trajectory`.
//!
//! | module | holds |
//! |---|---|
//! | [`input`] | [`Input`]: what a path holds, decided by content |
//! | [`scans`] | [`ScanFiles`]: folders of `.bin`, `.pcd`, `.ply`, one scan at a time; [`read_cloud`] |
//! | [`bag`] | [`Bag`]: messages of a recording in time order; [`BagPackets`], [`BagScans`] |
//! | [`message`] | the ROS messages a recording is read for, from CDR and ROS 1 bytes |
//! | [`cloud`] | points from the bytes of one cloud file or message |
//! | [`imu_text`] | IMU samples from a text file |
//! | [`mod@write`] | clouds to PLY, PCD and CSV, atomically |
//!
//! Bytes come from outside and may say anything: every length is checked against what is there
//! before memory is asked for, and an error carries what was seen.
#![forbid(unsafe_code)]

pub mod bag;
pub mod cloud;
pub mod error;
pub mod imu_text;
pub mod input;
pub mod message;
pub mod scans;
mod seconds;
pub mod write;

pub use bag::{Bag, BagPackets, BagScans, Message, Topic};
pub use cloud::{CloudFormat, CloudInfo, PointTimes};
pub use error::{BagError, CloudError, DecodeError, ReadError, WriteError};
pub use imu_text::{ImuText, parse_imu_line};
pub use input::{Input, InputError, InputKind};
pub use message::{Body, MessageKind};
pub use scans::{ScanFiles, read_cloud};
pub use write::{AtomicFile, MapWriter, write_cloud, write_file};
