//! Folders of scans, one scan at a time; and single clouds.
//!
//! In: a folder of `.bin`, `.pcd` or `.ply` files in numeric order of their names, with an optional
//! `times.txt`; a KITTI odometry sequence (`velodyne/`, `times.txt`, `calib.txt`); or one file. Out:
//! points in the caller's `Vec` and a [`ScanHeader`]. Memory is reused from scan to scan.
//!
//! A scan's stamp, the time of its last point, comes from the first of these that is there: a line
//! of `times.txt`; the points' own UNIX times; names that are UNIX nanoseconds; 0.1 s after the
//! scan before, from zero.
//!
//! The clouds of a KITTI sequence, recognised by `velodyne/` and the `Tr` of its `calib.txt`, are
//! corrected for the vertical angles of its LiDAR (`hdl64`). Scans in any other folder, KITTI's too, come
//! as they are.

mod hdl64;
pub(crate) mod names;
mod times;

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use hachi_hal::{Completeness, LidarScans, Point, PointSink, Pose, ScanHeader, Stamp};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

pub use times::parse_times;

use crate::cloud::{CloudDecoder, CloudFormat, CloudInfo, PointTimes, read_cloud_bytes};
use crate::error::{ReadError, seen};
use crate::input::{Input, InputKind};

/// The most bytes one scan file may have.
const FILE_LIMIT: u64 = 2 << 30;
/// The most bytes a text file beside the scans may have: a million lines of times.
const TEXT_LIMIT: u64 = 64 << 20;
/// Between scans that say nothing about their time: LiDARs turn at 10 Hz by default.
const DEFAULT_SPACING_NS: i64 = 100_000_000;

/// A folder of scans, open for reading.
#[derive(Debug)]
pub struct ScanFiles {
    format: CloudFormat,
    files: Vec<PathBuf>,
    times: Option<Vec<Stamp>>,
    names_are_stamps: bool,
    camera_from_lidar: Option<Pose>,
    next: usize,
    sequence: u32,
    decoder: CloudDecoder,
    bytes: Vec<u8>,
    /// For [`LidarScans`], which hands out points to any sink.
    points: Vec<Point>,
    dropped_points: u64,
}

impl ScanFiles {
    /// Opens a folder of scans, a KITTI sequence or a single scan.
    ///
    /// # Errors
    /// [`ReadError`] where the path holds no scans, where `times.txt` cannot be read or has fewer
    /// lines than there are scans.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let input = Input::recognise(path)?;
        let (folder, format, beside) = match input.kind {
            InputKind::KittiSequence => (path.join("velodyne"), CloudFormat::Bin, Some(path)),
            InputKind::ScanFolder(format) => {
                let inner = path.join("Scans");
                let is_outer = list(path, format)?.is_empty();
                if is_outer {
                    (inner, format, Some(path))
                } else {
                    let parent = named_as_inner(path).then(|| path.parent()).flatten();
                    (path.to_path_buf(), format, parent)
                }
            }
            InputKind::Cloud(format) => {
                return Ok(Self::new(format, vec![path.to_path_buf()], None));
            }
            other => {
                return Err(ReadError::Io {
                    doing: "read scans from",
                    path: path.to_path_buf(),
                    source: io::Error::new(
                        io::ErrorKind::InvalidInput,
                        format!("it is {}", other.description()),
                    ),
                });
            }
        };
        let files = list(&folder, format)?;
        let times = read_times(&folder, beside, files.len())?;
        let mut scans = Self::new(format, files, times);
        if input.kind == InputKind::KittiSequence {
            scans.camera_from_lidar = read_calibration(&path.join("calib.txt"))?;
        }
        Ok(scans)
    }

    fn new(format: CloudFormat, files: Vec<PathBuf>, times: Option<Vec<Stamp>>) -> Self {
        Self {
            format,
            names_are_stamps: files.iter().all(|file| names::stamp_of(file).is_some()),
            files,
            times,
            camera_from_lidar: None,
            next: 0,
            sequence: 0,
            decoder: CloudDecoder::default(),
            bytes: Vec::new(),
            points: Vec::new(),
            dropped_points: 0,
        }
    }

    /// How many scans there are.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The files, in the order in which they are read.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Their format.
    pub fn format(&self) -> CloudFormat {
        self.format
    }

    /// Whether a `times.txt` stamps them.
    pub fn has_times(&self) -> bool {
        self.times.is_some()
    }

    /// KITTI's `Tr`, where the sequence has a `calib.txt`: the left camera's frame (x right, y
    /// down, z forward), in which KITTI's poses are given.
    pub fn camera_from_lidar(&self) -> Option<&Pose> {
        self.camera_from_lidar.as_ref()
    }

    /// Whether the points are raised by 0.205 degrees: KITTI's calibration of its HDL-64 has its
    /// vertical angles too low by so much. Done for a sequence with a `calib.txt`, and not for bare
    /// folders of scans, which may come from any sensor.
    pub fn corrects_vertical_angles(&self) -> bool {
        self.camera_from_lidar.is_some()
    }

    /// What intensities are multiplied by: 1 or 255, `None` before a scan has settled it.
    pub fn intensity_scale(&self) -> Option<f32> {
        self.decoder.intensity_scale()
    }

    /// Points that did not fit a caller's sink, with the scans they belonged to.
    pub fn dropped_points(&self) -> u64 {
        self.dropped_points
    }

    /// The next scan into `points`, which is cleared first; `None` at the end.
    ///
    /// # Errors
    /// A broken file costs that scan: the next call goes on with the file after it.
    pub fn next_scan(
        &mut self,
        points: &mut Vec<Point>,
    ) -> Result<Option<(ScanHeader, CloudInfo)>, ReadError> {
        points.clear();
        let Some(file) = self.files.get(self.next) else {
            return Ok(None);
        };
        let place = self.next;
        self.next += 1;
        read_limited(file, FILE_LIMIT, &mut self.bytes)?;
        let info = read_cloud_bytes(self.format, &self.bytes, &mut self.decoder, points).map_err(
            |source| ReadError::Cloud {
                path: file.clone(),
                source,
            },
        )?;
        if self.corrects_vertical_angles() {
            hdl64::raise(points);
        }
        let given = self.times.as_ref().and_then(|times| times.get(place));
        let header = self.header(place, given.copied(), info.times);
        self.sequence = self.sequence.wrapping_add(1);
        Ok(Some((header, info)))
    }

    fn header(&self, place: usize, given: Option<Stamp>, times: PointTimes) -> ScanHeader {
        let (length, unix_end) = match times {
            PointTimes::None => (0, None),
            PointTimes::Same(at) => (0, Some(at)),
            PointTimes::Relative(first, last) => (last - first, None),
            PointTimes::Absolute(first, last) => (last - first, Some(last)),
        };
        let named = || {
            self.names_are_stamps
                .then(|| names::stamp_of(&self.files[place]))
                .flatten()
        };
        let end = given
            .or_else(|| unix_end.map(Stamp::from_nanos))
            .or_else(named)
            .unwrap_or_else(|| {
                let place = i64::try_from(place).unwrap_or(i64::MAX);
                Stamp::from_nanos(place.saturating_mul(DEFAULT_SPACING_NS))
            });
        ScanHeader {
            sequence: self.sequence,
            start: end.offset(-length),
            end,
            sensor_start_ns: match times {
                PointTimes::Absolute(first, _) => u64::try_from(first).ok(),
                _ => None,
            },
            completeness: Completeness::Complete,
            has_point_times: length > 0,
        }
    }
}

impl LidarScans for ScanFiles {
    type Error = ReadError;

    /// Never waits: files are there, whatever the deadline. A scan that does not fit the sink is
    /// dropped whole and counted.
    fn read_scan(
        &mut self,
        points: &mut dyn PointSink,
        _deadline: Stamp,
    ) -> Result<Option<ScanHeader>, ReadError> {
        points.clear();
        let mut own = std::mem::take(&mut self.points);
        let read = self.next_scan(&mut own);
        let header = read.map(|scan| {
            let (header, _) = scan?;
            if points.extend(&own).is_ok() {
                return Some(header);
            }
            self.dropped_points += own.len() as u64;
            None
        });
        self.points = own;
        header
    }

    fn at_end(&self) -> bool {
        self.next == self.files.len()
    }
}

/// Reads one cloud file of any format into `points`, which is cleared first.
///
/// # Errors
/// [`ReadError`] where it cannot be opened or is no cloud.
pub fn read_cloud(path: impl AsRef<Path>, points: &mut Vec<Point>) -> Result<CloudInfo, ReadError> {
    let path = path.as_ref();
    let InputKind::Cloud(format) = Input::recognise(path)?.kind else {
        return Err(ReadError::Io {
            doing: "read a cloud from",
            path: path.to_path_buf(),
            source: io::Error::new(
                io::ErrorKind::InvalidInput,
                "give one .pcd, .ply or .bin file",
            ),
        });
    };
    let mut bytes = Vec::new();
    read_limited(path, FILE_LIMIT, &mut bytes)?;
    read_cloud_bytes(format, &bytes, &mut CloudDecoder::default(), points).map_err(|source| {
        ReadError::Cloud {
            path: path.to_path_buf(),
            source,
        }
    })
}

/// Whether a folder is by its name the part of a sequence that holds the scans, so that the files
/// about them lie beside it.
fn named_as_inner(folder: &Path) -> bool {
    folder
        .file_name()
        .is_some_and(|name| name == "velodyne" || name == "Scans")
}

fn list(folder: &Path, format: CloudFormat) -> Result<Vec<PathBuf>, ReadError> {
    let io = |source| ReadError::Io {
        doing: "list",
        path: folder.to_path_buf(),
        source,
    };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let ending = path.extension().and_then(|ending| ending.to_str());
        if ending.and_then(CloudFormat::from_extension) == Some(format) {
            files.push(path);
        }
    }
    names::sort_naturally(&mut files);
    Ok(files)
}

/// The times beside the scans, or beside their folder.
fn read_times(
    folder: &Path,
    beside: Option<&Path>,
    scans: usize,
) -> Result<Option<Vec<Stamp>>, ReadError> {
    let candidates = [Some(folder), beside].into_iter().flatten();
    let Some(path) = candidates
        .map(|folder| folder.join("times.txt"))
        .find(|path| path.exists())
    else {
        return Ok(None);
    };
    let mut bytes = Vec::new();
    read_limited(&path, TEXT_LIMIT, &mut bytes)?;
    let times = parse_times(&path, &bytes)?;
    if times.len() < scans {
        return Err(ReadError::MoreScansThanTimes {
            path,
            times: times.len(),
            scans,
        });
    }
    Ok(Some(times))
}

/// The line `Tr: ` of KITTI's `calib.txt`, a 3x4 matrix by rows; `None` without file or line.
fn read_calibration(path: &Path) -> Result<Option<Pose>, ReadError> {
    if !path.exists() {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    read_limited(path, TEXT_LIMIT, &mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    for (index, line) in text.lines().enumerate() {
        let Some(numbers) = line.strip_prefix("Tr:").or(line.strip_prefix("Tr ")) else {
            continue;
        };
        let values: Result<Vec<f64>, _> =
            numbers.split_ascii_whitespace().map(str::parse).collect();
        let pose = values.ok().and_then(|values| rigid(&values));
        return match pose {
            Some(pose) => Ok(Some(pose)),
            None => Err(ReadError::Line {
                path: path.to_path_buf(),
                line: index + 1,
                seen: seen(line.as_bytes()),
                problem: "is not a rotation and a translation in twelve numbers",
            }),
        };
    }
    Ok(None)
}

/// A row-major 3x4 matrix as a transform, if its left part is a rotation but for rounding.
fn rigid(values: &[f64]) -> Option<Pose> {
    let m: &[f64; 12] = values.try_into().ok()?;
    let matrix = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let off = (matrix * matrix.transpose() - Matrix3::identity()).norm();
    // NaN fails this too.
    if !(off < 1e-2 && matrix.determinant() > 0.0) {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix));
    let translation = Translation3::new(m[3], m[7], m[11]);
    Some(Pose::from_parts(translation, rotation))
}

/// Reads a whole file into `bytes`, if it is not larger than `limit`.
pub(crate) fn read_limited(path: &Path, limit: u64, bytes: &mut Vec<u8>) -> Result<(), ReadError> {
    bytes.clear();
    let io = |source| ReadError::Io {
        doing: "read",
        path: path.to_path_buf(),
        source,
    };
    let file = File::open(path).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    let read = if size <= limit {
        // One more than the limit: a file can grow, and a pipe has no size.
        file.take(limit + 1).read_to_end(bytes).map_err(io)? as u64
    } else {
        size
    };
    if read > limit {
        return Err(ReadError::TooLarge {
            path: path.to_path_buf(),
            bytes: read,
            limit,
        });
    }
    Ok(())
}
