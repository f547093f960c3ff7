//! What can go wrong while reading or writing, each with what was seen.
//!
//! [`CloudError`] and [`DecodeError`] speak of bytes and name no file; [`ReadError`] and
//! [`BagError`] add the file. Every message says what to do where there is something to do.

use std::io;
use std::path::{Path, PathBuf};

use hachi_hal::{DeviceError, FaultKind};

/// Why the bytes of a cloud are not a cloud.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// A header line is not what the format asks for.
    #[error("header line {line} reads {seen:?} where {expected} was expected")]
    Header {
        /// Counted from 1.
        line: usize,
        /// The line, at most its first 60 characters.
        seen: String,
        /// What the format asks for.
        expected: &'static str,
    },
    /// The header never ends.
    #[error("no end of the header within its first {limit} bytes: cut short, or not a cloud file")]
    HeaderEnd {
        /// How far was searched.
        limit: usize,
    },
    /// A field that every cloud needs is missing.
    #[error("no field {missing} among [{seen}]")]
    NoField {
        /// The field.
        missing: &'static str,
        /// The fields that are there.
        seen: String,
    },
    /// The field table lies about the size of a point.
    #[error("field {field} ends at byte {end} of a point of {stride} bytes")]
    FieldOutside {
        /// The field.
        field: String,
        /// Where it would end.
        end: u64,
        /// Bytes in one point.
        stride: u64,
    },
    /// A field's type is not one this format knows.
    #[error("field {field} has the unknown type {seen}")]
    FieldType {
        /// The field.
        field: String,
        /// The type as written.
        seen: String,
    },
    /// Fewer bytes than the header promises.
    #[error("{points} points need {needed} bytes and {got} are there: the data was cut short")]
    Truncated {
        /// Points promised.
        points: u64,
        /// Bytes they need.
        needed: u64,
        /// Bytes there are.
        got: u64,
    },
    /// A text value is no number, or the line is too short.
    #[error("line {line} reads {seen:?}, which is not the {expected} numbers of a point")]
    Text {
        /// Counted from 1 at the start of the file.
        line: usize,
        /// The line, at most its first 60 characters.
        seen: String,
        /// How many numbers one point has.
        expected: usize,
    },
    /// A file of bare rows whose size is no whole number of rows.
    #[error(
        "{got} bytes are not a whole number of {row}-byte points (x, y, z, intensity as f32), nor of bare positions"
    )]
    Rows {
        /// Bytes there are.
        got: u64,
        /// Bytes of one row.
        row: usize,
    },
    /// The header promises more than any cloud this program handles.
    #[error("{what} is {seen}, more than the {limit} this program takes")]
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// How large it says it is.
        seen: u64,
        /// The limit.
        limit: u64,
    },
    /// A compressed body does not decompress to what it promises.
    #[error("the compressed body breaks off or lies at byte {at} of {len}")]
    Compressed {
        /// Where in the compressed bytes.
        at: usize,
        /// How many compressed bytes there are.
        len: usize,
    },
}

/// Why the bytes of a message are not that message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The message ends inside a value.
    #[error("{needed} bytes were needed at byte {at} and {left} are left")]
    Truncated {
        /// Where.
        at: usize,
        /// Bytes wanted.
        needed: u64,
        /// Bytes there are.
        left: usize,
    },
    /// The first two bytes name no encapsulation that is read here.
    #[error("encapsulation {got:02x?} is neither plain CDR nor plain CDR2")]
    Encapsulation {
        /// The bytes.
        got: [u8; 2],
    },
    /// A value is not one a sensor can send.
    #[error("{what} is not finite or not a rotation")]
    Value {
        /// Which value.
        what: &'static str,
    },
    /// A packet claims more bytes than its buffer has.
    #[error("packet {index} claims {claimed} bytes of a buffer of {capacity}")]
    PacketLength {
        /// Which packet of the message, from 0.
        index: usize,
        /// Bytes it claims.
        claimed: u64,
        /// Bytes it may have.
        capacity: usize,
    },
    /// The point cloud inside does not hold together.
    #[error(transparent)]
    Cloud(#[from] CloudError),
}

/// Why a file or folder could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}{}", path.display(), advice(source))]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// A cloud file that is none.
    #[error("{}: {source}", path.display())]
    Cloud {
        /// The file.
        path: PathBuf,
        /// Why.
        source: CloudError,
    },
    /// A line of a text file that cannot be read.
    #[error("{} line {line}: {seen:?} {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// The line, at most its first 60 characters.
        seen: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Fewer times than scans.
    #[error(
        "{} holds {times} times for {scans} scans: give one line for each scan, or remove the file to have the scans spaced at 0.1 s",
        path.display()
    )]
    MoreScansThanTimes {
        /// The file of times.
        path: PathBuf,
        /// Lines in it.
        times: usize,
        /// Scans in the folder.
        scans: usize,
    },
    /// The path holds nothing that could be scans.
    #[error(transparent)]
    Input(#[from] crate::input::InputError),
    /// A file larger than one scan may be.
    #[error("{} has {bytes} bytes, more than the {limit} that one scan may have", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
}

impl DeviceError for ReadError {
    /// A bad scan costs that scan: the next call goes on with the file after it.
    fn kind(&self) -> FaultKind {
        match self {
            Self::Io { .. } | Self::Cloud { .. } | Self::TooLarge { .. } => FaultKind::ReadAgain,
            _ => FaultKind::FixConfig,
        }
    }
}

/// Why a recording could not be read, or one of its messages.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}{}", path.display(), advice(source))]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// The path holds nothing that could be a recording.
    #[error(transparent)]
    Input(#[from] crate::input::InputError),
    /// The container is broken here; the next call goes on with what can still be read.
    #[error("{}: {problem}", path.display())]
    Container {
        /// The file.
        path: PathBuf,
        /// What was seen, and where.
        problem: String,
    },
    /// One message is broken; the next call goes on behind it.
    #[error("{}: message on {topic} at {stamp}: {source}", path.display())]
    Message {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// When it was recorded.
        stamp: hachi_hal::Stamp,
        /// Why.
        source: DecodeError,
    },
    /// Nothing in the recording is what was asked for.
    #[error("{}: no topic carries {wanted}; it holds {seen}", path.display())]
    NoTopic {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        wanted: &'static str,
        /// Topics and types that are there.
        seen: String,
    },
    /// A packet longer than the caller's buffer.
    #[error("{}: a packet of {got} bytes does not fit the buffer of {capacity}", path.display())]
    PacketTooLong {
        /// The file.
        path: PathBuf,
        /// Bytes of the packet.
        got: usize,
        /// Bytes of the buffer.
        capacity: usize,
    },
}

impl DeviceError for BagError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Message { .. } | Self::PacketTooLong { .. } | Self::Container { .. } => {
                FaultKind::ReadAgain
            }
            Self::NoTopic { .. } | Self::Input(_) => FaultKind::FixConfig,
            Self::Io { .. } => FaultKind::GiveUp,
        }
    }
}

/// Why a file could not be written. Nothing half-written is left behind.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The disk, the quota or the size limit is exhausted.
    #[error(
        "no room to write {}: {source}; free space or choose another folder, nothing half-written was left behind",
        path.display()
    )]
    NoRoom {
        /// The file that was to appear.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The operating system refused for another reason.
    #[error("cannot {doing} {}: {source}{}", path.display(), advice(source))]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// The name tells no format.
    #[error("{}: name the file .ply, .pcd or .csv, so that its format is known", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
}

impl WriteError {
    /// Sorts an operating system error into the two kinds.
    pub(crate) fn from_io(doing: &'static str, path: &Path, source: io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let path = path.to_path_buf();
        match source.kind() {
            StorageFull | QuotaExceeded | FileTooLarge => Self::NoRoom { path, source },
            _ => Self::Io {
                doing,
                path,
                source,
            },
        }
    }
}

/// What a person can do about an operating system error, as the end of a sentence.
pub(crate) fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::NotFound => "; check the path",
        io::ErrorKind::PermissionDenied => "; check who may read and write there",
        io::ErrorKind::NotADirectory => "; a folder was expected there",
        _ => "",
    }
}

/// At most the first 60 characters of what was read, for an error message.
pub(crate) fn seen(bytes: &[u8]) -> String {
    let head = &bytes[..bytes.len().min(240)];
    String::from_utf8_lossy(head)
        .trim_end()
        .chars()
        .take(60)
        .collect()
}
