//! Points from the bytes of one cloud: a file's or a message's.
//!
//! In: the bytes. Out: hal points in the caller's `Vec`, and a [`CloudInfo`] with what is true of
//! all of them. Files and folders are opened in [`scans`](crate::scans); ROS messages are parsed
//! in [`message`](crate::message).

pub(crate) mod bare_rows;
pub(crate) mod decode;
pub(crate) mod layout;
mod lzf;
pub(crate) mod pcd;
pub(crate) mod ply;
mod ply_header;
pub(crate) mod point_times;
pub(crate) mod scalar;

use hachi_hal::Point;

pub use decode::CloudDecoder;
pub use point_times::PointTimes;

use crate::error::CloudError;

/// The most points one cloud may have: a hundred times the largest LiDAR's scan.
pub const MAX_POINTS: u64 = 1 << 26;

/// A file format that holds one cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CloudFormat {
    /// Bare rows of little-endian f32: x, y, z, intensity as KITTI has them, or x, y, z alone.
    Bin,
    /// The point cloud library's format: ascii, binary or binary_compressed.
    Pcd,
    /// The polygon file format: ascii or binary in either byte order; only vertices are read.
    Ply,
}

impl CloudFormat {
    /// The file name ending, without its dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Bin => "bin",
            Self::Pcd => "pcd",
            Self::Ply => "ply",
        }
    }

    /// The format a file name's ending promises, whatever its case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        [Self::Bin, Self::Pcd, Self::Ply]
            .into_iter()
            .find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }
}

/// What is true of all points of one cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CloudInfo {
    /// How many points there are.
    pub points: usize,
    /// How many of them have a coordinate that is no finite number. They are kept.
    pub non_finite: usize,
    /// What the points' own times say.
    pub times: PointTimes,
}

/// Reads one cloud into `points`, which is cleared first; oldest point first where points carry
/// times.
///
/// `decoder` remembers what a stream's first clouds settled (the intensity's scale, the unit of
/// the times): use one for all scans of a folder.
pub fn read_cloud_bytes(
    format: CloudFormat,
    bytes: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    points.clear();
    match format {
        CloudFormat::Bin => bare_rows::read(bytes, decoder, points),
        CloudFormat::Pcd => pcd::read(bytes, decoder, points),
        CloudFormat::Ply => ply::read(bytes, decoder, points),
    }
}
