//! What a path holds, decided by what is in it rather than by its name.
//!
//! Files are known by their first bytes. KITTI's `.bin` has none to go by: there the name's ending
//! and a whole number of rows decide. Folders are known by what lies in them.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::cloud::{CloudFormat, bare_rows};
use crate::error::advice;

/// The formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum InputKind {
    /// A packet capture (libpcap's format, either byte order, micro- or nanoseconds).
    Pcap,
    /// A packet capture in the newer block format.
    Pcapng,
    /// A ROS 1 bag, format 2.0.
    Ros1Bag,
    /// A ROS 2 bag's SQLite file.
    Db3,
    /// An MCAP file.
    Mcap,
    /// The folder of a ROS 2 bag.
    BagFolder,
    /// A folder with `velodyne/` and, beside it, `times.txt`.
    KittiSequence,
    /// A folder of scans of one format, here or in a folder `Scans/` within.
    ScanFolder(CloudFormat),
    /// One cloud.
    Cloud(CloudFormat),
}

impl InputKind {
    /// A few words for a message.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Pcap => "a pcap capture",
            Self::Pcapng => "a pcapng capture",
            Self::Ros1Bag => "a ROS 1 bag",
            Self::Db3 => "a ROS 2 bag (db3)",
            Self::Mcap => "an MCAP file",
            Self::BagFolder => "a ROS 2 bag folder",
            Self::KittiSequence => "a KITTI sequence",
            Self::ScanFolder(CloudFormat::Bin) => "a folder of .bin scans",
            Self::ScanFolder(CloudFormat::Pcd) => "a folder of .pcd scans",
            Self::ScanFolder(CloudFormat::Ply) => "a folder of .ply scans",
            Self::Cloud(CloudFormat::Bin) => "a .bin scan",
            Self::Cloud(CloudFormat::Pcd) => "a PCD cloud",
            Self::Cloud(CloudFormat::Ply) => "a PLY cloud",
        }
    }

    /// Whether [`Bag`](crate::Bag) reads it.
    pub const fn is_bag(self) -> bool {
        matches!(
            self,
            Self::Ros1Bag | Self::Db3 | Self::Mcap | Self::BagFolder
        )
    }

    /// Whether [`ScanFiles`](crate::ScanFiles) reads it.
    pub const fn is_scans(self) -> bool {
        matches!(
            self,
            Self::KittiSequence | Self::ScanFolder(_) | Self::Cloud(_)
        )
    }
}

/// A path and what it holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Input {
    /// The path.
    pub path: PathBuf,
    /// What it holds.
    pub kind: InputKind,
}

/// What is read, for messages.
const ACCEPTED: &str = "accepted are pcap, pcapng, ROS 2 bags (.db3, .mcap or their folder), ROS 1 \
                        bags (.bag), a KITTI sequence folder, and a folder of .bin, .pcd or .ply scans";

/// Why a path is no input.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The operating system refused.
    #[error("cannot open {}: {source}{}", path.display(), advice(source))]
    Io {
        /// The path.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// A file of no bytes.
    #[error("{} is empty; {ACCEPTED}", path.display())]
    EmptyFile {
        /// The file.
        path: PathBuf,
    },
    /// A file of another kind.
    #[error("{} begins with {seen}, which is no format known here; {ACCEPTED}", path.display())]
    UnknownFile {
        /// The file.
        path: PathBuf,
        /// Its first bytes.
        seen: String,
    },
    /// A compressed file.
    #[error("{} is compressed with {compression}: unpack it first ({command})", path.display())]
    Compressed {
        /// The file.
        path: PathBuf,
        /// With what.
        compression: &'static str,
        /// The command that unpacks it.
        command: &'static str,
    },
    /// A bag of the format before 2.0.
    #[error("{} is a bag of format {seen}: run `rosbag migrate` on it first", path.display())]
    OldBag {
        /// The file.
        path: PathBuf,
        /// The version as written.
        seen: String,
    },
    /// A folder with nothing to read in it.
    #[error("{} holds no recording (found: {seen}); {ACCEPTED}", path.display())]
    NothingInFolder {
        /// The folder.
        path: PathBuf,
        /// What is there.
        seen: String,
    },
    /// A folder with files of several kinds.
    #[error(
        "{} mixes {seen}: keep one kind in the folder, so that it is clear what to read",
        path.display()
    )]
    MixedFolder {
        /// The folder.
        path: PathBuf,
        /// How many of which.
        seen: String,
    },
}

impl Input {
    /// Looks at a path.
    ///
    /// # Errors
    /// [`InputError`] says what was seen and what is accepted.
    pub fn recognise(path: impl AsRef<Path>) -> Result<Self, InputError> {
        let path = path.as_ref();
        let io = |source| InputError::Io {
            path: path.to_path_buf(),
            source,
        };
        let about = fs::metadata(path).map_err(io)?;
        let kind = if about.is_dir() {
            folder_kind(path)?
        } else {
            file_kind(path, about.len())?
        };
        Ok(Self {
            path: path.to_path_buf(),
            kind,
        })
    }
}

fn file_kind(path: &Path, size: u64) -> Result<InputKind, InputError> {
    let io = |source| InputError::Io {
        path: path.to_path_buf(),
        source,
    };
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(512).read_to_end(&mut head))
        .map_err(io)?;
    if let Some(kind) = magic(&head) {
        return Ok(kind);
    }
    let path = path.to_path_buf();
    if let Some((compression, command)) = compressed(&head) {
        return Err(InputError::Compressed {
            path,
            compression,
            command,
        });
    }
    if let Some(rest) = head.strip_prefix(b"#ROSBAG V") {
        let end = rest.iter().position(|&byte| byte == b'\n');
        let seen = crate::error::seen(&rest[..end.unwrap_or(rest.len())]);
        return Err(InputError::OldBag { path, seen });
    }
    let extension = path.extension().and_then(|ending| ending.to_str());
    let is_bin = extension.and_then(CloudFormat::from_extension) == Some(CloudFormat::Bin);
    // An empty scan is a scan: a lidar that saw nothing.
    if is_bin && bare_rows::fits(size) {
        return Ok(InputKind::Cloud(CloudFormat::Bin));
    }
    if head.is_empty() {
        return Err(InputError::EmptyFile { path });
    }
    let seen = format!("{:02x?}", &head[..head.len().min(8)]);
    Err(InputError::UnknownFile { path, seen })
}

/// The kind that a file's first bytes tell.
fn magic(head: &[u8]) -> Option<InputKind> {
    let number = head.first_chunk().copied().map(u32::from_be_bytes);
    match number {
        // libpcap's file header: both resolutions, both byte orders.
        Some(0xa1b2_c3d4 | 0xd4c3_b2a1 | 0xa1b2_3c4d | 0x4d3c_b2a1) => {
            return Some(InputKind::Pcap);
        }
        Some(0x0a0d_0d0a) => return Some(InputKind::Pcapng),
        _ => {}
    }
    let pcd = |head: &[u8]| {
        // A PCD may begin with comments; its own first line names the version or the fields.
        let text = String::from_utf8_lossy(head);
        text.starts_with("# .PCD")
            || text
                .lines()
                .find(|line| !line.starts_with('#') && !line.trim().is_empty())
                .is_some_and(|line| {
                    line.starts_with("VERSION ")
                        || line.starts_with("FIELDS ")
                        || line.starts_with("COLUMNS ")
                })
    };
    Some(match head {
        _ if head.starts_with(b"#ROSBAG V2.0\n") => InputKind::Ros1Bag,
        _ if head.starts_with(b"SQLite format 3\0") => InputKind::Db3,
        _ if head.starts_with(b"\x89MCAP0\r\n") => InputKind::Mcap,
        _ if head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n") => {
            InputKind::Cloud(CloudFormat::Ply)
        }
        _ if pcd(head) => InputKind::Cloud(CloudFormat::Pcd),
        _ => return None,
    })
}

/// The compression that a file's first bytes tell, and how to undo it.
fn compressed(head: &[u8]) -> Option<(&'static str, &'static str)> {
    const KNOWN: [(&[u8], &str, &str); 6] = [
        (&[0x1f, 0x8b], "gzip", "gunzip FILE"),
        (&[0x28, 0xb5, 0x2f, 0xfd], "zstd", "zstd -d FILE"),
        (b"BZh", "bzip2", "bunzip2 FILE"),
        (&[0xfd, b'7', b'z', b'X', b'Z', 0], "xz", "unxz FILE"),
        (&[0x04, 0x22, 0x4d, 0x18], "lz4", "lz4 -d FILE"),
        (b"PK\x03\x04", "zip", "unzip FILE"),
    ];
    KNOWN
        .iter()
        .find(|(magic, ..)| head.starts_with(magic))
        .map(|&(_, compression, command)| (compression, command))
}

/// How many files of which kind lie in a folder.
#[derive(Debug, Default)]
struct Counts {
    clouds: [usize; 3],
    bags: usize,
    compressed_bags: usize,
    captures: usize,
    others: usize,
}

const FORMATS: [CloudFormat; 3] = [CloudFormat::Bin, CloudFormat::Pcd, CloudFormat::Ply];

impl Counts {
    fn of(folder: &Path) -> Result<Self, InputError> {
        let io = |source| InputError::Io {
            path: folder.to_path_buf(),
            source,
        };
        let mut counts = Self::default();
        for entry in fs::read_dir(folder).map_err(io)? {
            let path = entry.map_err(io)?.path();
            let ending = path.extension().and_then(|ending| ending.to_str());
            let ending = ending.unwrap_or_default().to_ascii_lowercase();
            match ending.as_str() {
                "db3" | "mcap" => counts.bags += 1,
                "zstd" | "lz4" => counts.compressed_bags += 1,
                "pcap" | "pcapng" | "bag" => counts.captures += 1,
                _ => match FORMATS.iter().position(|f| f.extension() == ending) {
                    Some(format) => counts.clouds[format] += 1,
                    None => counts.others += 1,
                },
            }
        }
        Ok(counts)
    }

    fn summary(&self) -> String {
        let named = [
            (self.clouds[0], ".bin files"),
            (self.clouds[1], ".pcd files"),
            (self.clouds[2], ".ply files"),
            (self.bags, ".db3 or .mcap files"),
            (self.compressed_bags, "compressed files"),
            (
                self.captures,
                "captures or ROS 1 bags (give one of them instead)",
            ),
            (self.others, "other entries"),
        ];
        let there: Vec<_> = named
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        if there.is_empty() {
            "nothing".into()
        } else {
            there.join(", ")
        }
    }
}

fn folder_kind(folder: &Path) -> Result<InputKind, InputError> {
    let counts = Counts::of(folder)?;
    let formats: Vec<_> = FORMATS
        .into_iter()
        .zip(counts.clouds)
        .filter(|(_, count)| *count > 0)
        .map(|(format, _)| format)
        .collect();
    let path = folder.to_path_buf();
    match (&formats[..], counts.bags) {
        ([], 0) => {}
        ([], _) => return Ok(InputKind::BagFolder),
        ([format], 0) => return Ok(InputKind::ScanFolder(*format)),
        _ => {
            let seen = counts.summary();
            return Err(InputError::MixedFolder { path, seen });
        }
    }
    if folder.join("velodyne").is_dir() {
        return Ok(InputKind::KittiSequence);
    }
    let inner = folder.join("Scans");
    if inner.is_dir() {
        return folder_kind(&inner);
    }
    let seen = counts.summary();
    Err(InputError::NothingInFolder { path, seen })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind_of(name: &str, bytes: &[u8]) -> Result<InputKind, InputError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        Input::recognise(&path).map(|input| input.kind)
    }

    #[test]
    fn files_are_known_by_their_first_bytes_whatever_their_name() {
        let cases: [(&[u8], InputKind); 9] = [
            (&[0xd4, 0xc3, 0xb2, 0xa1, 2, 0], InputKind::Pcap),
            (&[0xa1, 0xb2, 0x3c, 0x4d, 0, 2], InputKind::Pcap),
            (&[0x0a, 0x0d, 0x0d, 0x0a], InputKind::Pcapng),
            (b"#ROSBAG V2.0\n", InputKind::Ros1Bag),
            (b"SQLite format 3\0", InputKind::Db3),
            (b"\x89MCAP0\r\n", InputKind::Mcap),
            (b"ply\nformat", InputKind::Cloud(CloudFormat::Ply)),
            (b"# .PCD v0.7", InputKind::Cloud(CloudFormat::Pcd)),
            (b"# mine\nVERSION .7\n", InputKind::Cloud(CloudFormat::Pcd)),
        ];
        for (bytes, kind) in cases {
            assert_eq!(kind_of("some.file", bytes).unwrap(), kind);
        }
        assert_eq!(
            kind_of("0.bin", &[0; 32]).unwrap(),
            InputKind::Cloud(CloudFormat::Bin)
        );
        assert_eq!(
            kind_of("points.bin", &[0; 36]).unwrap(),
            InputKind::Cloud(CloudFormat::Bin)
        );
    }

    #[test]
    fn what_cannot_be_read_is_said_with_what_was_seen() {
        let message = |name, bytes| kind_of(name, bytes).unwrap_err().to_string();
        assert!(message("a.txt", b"hello world").contains("[68, 65, 6c, 6c, 6f"));
        assert!(message("a.pcap", b"").contains("is empty"));
        assert!(message("a.bin", &[1; 17]).contains("accepted are"));
        assert!(message("a.bag", b"#ROSBAG V1.2\n").contains("rosbag migrate"));
        assert!(message("a.db3.zstd", &[0x28, 0xb5, 0x2f, 0xfd]).contains("zstd -d"));
        let missing = Input::recognise("/nowhere/at/all").unwrap_err().to_string();
        assert!(missing.contains("check the path"), "{missing}");
    }

    #[test]
    fn folders_are_known_by_what_lies_in_them() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let error = Input::recognise(root).unwrap_err().to_string();
        assert!(
            error.contains("holds no recording (found: nothing)"),
            "{error}"
        );
        fs::create_dir(root.join("velodyne")).unwrap();
        let kind = || Input::recognise(root).map(|input| input.kind);
        assert_eq!(kind().unwrap(), InputKind::KittiSequence);
        fs::write(root.join("1.ply"), "").unwrap();
        assert_eq!(kind().unwrap(), InputKind::ScanFolder(CloudFormat::Ply));
        fs::write(root.join("1.pcd"), "").unwrap();
        let error = kind().unwrap_err().to_string();
        assert!(
            error.contains("mixes 1 .pcd files, 1 .ply files"),
            "{error}"
        );
    }
}
