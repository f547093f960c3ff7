//! Reads trajectories from text, whatever their format.
//!
//! In: a file or any reader. Out: a [`Trajectory`], which format it was, and what had to be put
//! right. The format is recognised by content ([`Format`]); comments (`#`, `%`, `//`), a header
//! line, blank lines, a byte order mark and CRLF ends are fine, fields are parted by spaces, tabs,
//! commas or semicolons.
//!
//! Files are streamed: at most one line and the poses are in memory, and both have limits
//! ([`MAX_LINE_BYTES`], [`MAX_POSES`]).

mod format;
mod line;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use hachi_hal::{Pose, Stamp};

use crate::{Repairs, Trajectory};

pub use format::Format;

/// A line longer than this is no line of a trajectory. EuRoC's 17 columns take about 350 bytes.
pub const MAX_LINE_BYTES: usize = 16 * 1024;

/// More poses than this are refused: 5 hours at 1 kHz, about 1.3 GB while being sorted.
pub const MAX_POSES: usize = 18_000_000;

/// What a file held.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The poses.
    pub trajectory: Trajectory,
    /// How they were written.
    pub format: Format,
    /// What was changed to make times increase and quaternions unit.
    pub repairs: Repairs,
}

/// Why a trajectory can't be read. Line numbers start at 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file can't be opened or read.
    #[error("can't be read: {0}")]
    Io(#[from] std::io::Error),
    /// There is not one pose in it.
    #[error("holds no pose")]
    Empty,
    /// The first line of numbers fits no format.
    #[error(
        "line {line}: {fields} numbers fit no known format (TUM has 8: t x y z qx qy qz qw; KITTI 12: \
         a 3x4 matrix; EuRoC 8 or more, parted by commas, time in ns)"
    )]
    UnknownFormat {
        /// Where.
        line: u64,
        /// How many fields it has.
        fields: usize,
    },
    /// A line has another number of fields than its format.
    #[error("line {line}: {got} numbers, expected {expected} ({format})")]
    FieldCount {
        /// Where.
        line: u64,
        /// How many there are.
        got: usize,
        /// How many the format has.
        expected: usize,
        /// The format the file began with.
        format: Format,
    },
    /// A field is not a finite number of sensible size.
    #[error("line {line}: field {field} is {text:?}, not a number a pose can have")]
    NotANumber {
        /// Where.
        line: u64,
        /// Which field, from 1.
        field: usize,
        /// Its beginning.
        text: String,
    },
    /// A time that fits no clock.
    #[error("line {line}: time {text:?} is not a number of {unit} within ±292 years")]
    Time {
        /// Where.
        line: u64,
        /// Its beginning.
        text: String,
        /// `seconds` or `nanoseconds`.
        unit: &'static str,
    },
    /// A quaternion without length, or a matrix that is no rotation.
    #[error("line {line}: the orientation is no rotation ({reason})")]
    NotARotation {
        /// Where.
        line: u64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Not a text file of poses.
    #[error("line {line} is longer than {limit} bytes: not a trajectory", limit = MAX_LINE_BYTES)]
    LineTooLong {
        /// Where.
        line: u64,
    },
    /// Bytes that are not text.
    #[error("line {line} is not text: not a trajectory")]
    NotText {
        /// Where.
        line: u64,
    },
    /// More poses than fit.
    #[error("more than {limit} poses; split the file", limit = MAX_POSES)]
    TooManyPoses,
}

/// Reads the trajectory in the file at `path`.
///
/// # Errors
/// [`ReadError`], with the line where it lies in the text.
pub fn from_file(path: &Path) -> Result<Loaded, ReadError> {
    from_reader(BufReader::new(File::open(path)?))
}

/// Reads a trajectory from text.
///
/// # Errors
/// [`ReadError`], with the line where it lies in the text.
pub fn from_reader(reader: impl BufRead) -> Result<Loaded, ReadError> {
    let mut lines = Lines::new(reader);
    let mut clues = format::Clues::default();
    let mut format = None;
    let mut poses = Poses::default();
    let mut text = Vec::new();
    while let Some(number) = lines.next_into(&mut text)? {
        let text = std::str::from_utf8(&text).map_err(|_| ReadError::NotText { line: number })?;
        let fields = match line::content(text) {
            line::Content::Nothing => continue,
            line::Content::Comment(comment) => {
                clues.note(comment);
                continue;
            }
            line::Content::Fields(fields) => fields,
        };
        let known = match format {
            Some(known) => known,
            // A first line with a word in it is a header.
            None if fields.is_header() && !clues.header_seen() => {
                clues.note_header(text);
                continue;
            }
            None => *format.insert(clues.recognise(&fields, number)?),
        };
        poses.push(known.parse(&fields, number)?)?;
    }
    match format {
        Some(format) => Ok(poses.finish(format)),
        None => Err(ReadError::Empty),
    }
}

/// The poses read so far.
#[derive(Default)]
struct Poses {
    timed: Vec<(Stamp, Pose)>,
    untimed: Vec<Pose>,
    normalised: usize,
}

impl Poses {
    fn push(&mut self, parsed: format::Parsed) -> Result<(), ReadError> {
        if self.timed.len() + self.untimed.len() >= MAX_POSES {
            return Err(ReadError::TooManyPoses);
        }
        self.normalised += usize::from(parsed.normalised);
        match parsed.stamp {
            Some(stamp) => self.timed.push((stamp, parsed.pose)),
            None => self.untimed.push(parsed.pose),
        }
        Ok(())
    }

    fn finish(self, format: Format) -> Loaded {
        let (trajectory, mut repairs) = match format.has_times() {
            true => Trajectory::from_samples(self.timed),
            false => (Trajectory::untimed(self.untimed), Repairs::default()),
        };
        repairs.normalised = self.normalised;
        Loaded {
            trajectory,
            format,
            repairs,
        }
    }
}

/// Lines of bounded length, without their ends, numbered from 1.
struct Lines<R> {
    reader: R,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    fn new(reader: R) -> Self {
        Self { reader, number: 0 }
    }

    /// The next line into `text`; `None` at the end.
    fn next_into(&mut self, text: &mut Vec<u8>) -> Result<Option<u64>, ReadError> {
        text.clear();
        self.number += 1;
        let limit = MAX_LINE_BYTES as u64 + 1;
        let read = (&mut self.reader).take(limit).read_until(b'\n', text)?;
        if read == 0 {
            return Ok(None);
        }
        if text.last() == Some(&b'\n') {
            text.pop();
        } else if read > MAX_LINE_BYTES {
            return Err(ReadError::LineTooLong { line: self.number });
        }
        if self.number == 1 && text.starts_with(b"\xef\xbb\xbf") {
            text.drain(..3);
        }
        Ok(Some(self.number))
    }
}
