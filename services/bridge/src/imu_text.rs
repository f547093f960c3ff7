//! IMU samples from a text file: seven numbers a line, a time and two vectors.
//!
//! Two orders are common: `time ax ay az gx gy gz` (most exporters) and EuRoC's
//! `time,gx,gy,gz,ax,ay,az`. The numbers tell them apart: over the first lines the specific force
//! of a robot that is not falling averages near 9.81 m/s², an angular velocity in rad/s far below.
//! (In the recording this was settled on, columns 2 to 4 average 9.81 in norm and columns 5 to 7
//! 0.12, and the latter agree with the turning of the trajectory beside it to 0.05 %.)
//! Times are seconds, or nanoseconds where they are whole numbers of UNIX size.

use std::path::{Path, PathBuf};

use hachi_hal::{ImuSample, Stamp, Vector3};

use crate::error::{ReadError, seen};
use crate::scans::read_limited;
use crate::seconds::stamp_from_seconds;

/// A day at 1 kHz has 86 million samples and some gigabytes of text; recordings are shorter.
const FILE_LIMIT: u64 = 2 << 30;
/// How many lines decide the order of the columns.
const DECIDING_LINES: usize = 200;

/// The samples of a text file, oldest first.
#[derive(Debug)]
pub struct ImuText {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Where the next line begins, and its number less one.
    at: usize,
    line: usize,
    force_first: bool,
    last: Option<Stamp>,
}

impl ImuText {
    /// Opens a file and settles the order of its columns.
    ///
    /// # Errors
    /// [`ReadError`] where it cannot be read, a line among the first is no sample, or neither
    /// vector looks like gravity.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let mut bytes = Vec::new();
        read_limited(path, FILE_LIMIT, &mut bytes)?;
        Self::new(path.to_path_buf(), bytes)
    }

    /// Takes the bytes of a file; `path` is for the errors.
    pub fn new(path: PathBuf, bytes: Vec<u8>) -> Result<Self, ReadError> {
        let mut text = Self {
            path,
            bytes,
            at: 0,
            line: 0,
            force_first: true,
            last: None,
        };
        let (mut sums, mut count) = ([0.0; 2], 0);
        while count < DECIDING_LINES
            && let Some((_, first, second)) = text.next_numbers()?
        {
            sums[0] += first.norm();
            sums[1] += second.norm();
            count += 1;
        }
        if count > 0 {
            let means = sums.map(|sum| sum / count as f64);
            text.force_first = order(means).ok_or_else(|| ReadError::Line {
                path: text.path.clone(),
                line: 1,
                seen: format!("columns average {:.2} and {:.2} in norm", means[0], means[1]),
                problem: "where one of the two vectors should be near 9.81 (m/s²) and the other below it (rad/s)",
            })?;
        }
        (text.at, text.line) = (0, 0);
        Ok(text)
    }

    /// The next line that is not blank, a comment or a heading: its time and two vectors.
    fn next_numbers(&mut self) -> Result<Option<(Stamp, Vector3, Vector3)>, ReadError> {
        loop {
            let Some(rest) = self.bytes.get(self.at..).filter(|rest| !rest.is_empty()) else {
                return Ok(None);
            };
            let end = rest.iter().position(|&byte| byte == b'\n');
            let line = &rest[..end.unwrap_or(rest.len())];
            self.at += line.len() + 1;
            self.line += 1;
            let line = line.trim_ascii();
            if line.is_empty() || line[0] == b'#' {
                continue;
            }
            return match parse_imu_line(line) {
                Some(numbers) => Ok(Some(numbers)),
                None => Err(ReadError::Line {
                    path: self.path.clone(),
                    line: self.line,
                    seen: seen(line),
                    problem: "is not a time and six finite numbers",
                }),
            };
        }
    }
}

impl Iterator for ImuText {
    type Item = Result<ImuSample, ReadError>;

    /// A line that is no sample, or not after the one before, is an error; the next call goes on
    /// behind it.
    fn next(&mut self) -> Option<Self::Item> {
        let (stamp, first, second) = match self.next_numbers() {
            Ok(numbers) => numbers?,
            Err(error) => return Some(Err(error)),
        };
        if self.last.is_some_and(|last| stamp <= last) {
            return Some(Err(ReadError::Line {
                path: self.path.clone(),
                line: self.line,
                seen: format!("{stamp}"),
                problem: "is not after the time before it",
            }));
        }
        self.last = Some(stamp);
        let (specific_force, angular_velocity) = if self.force_first {
            (first, second)
        } else {
            (second, first)
        };
        Some(Ok(ImuSample {
            stamp,
            angular_velocity,
            specific_force,
        }))
    }
}

/// Whether the first vector is the specific force, by the mean norms of both; `None` if neither
/// can be.
fn order(means: [f64; 2]) -> Option<bool> {
    /// Means of a walking or driving robot stay inside, m/s².
    const GRAVITY: std::ops::RangeInclusive<f64> = 7.0..=13.0;
    match means.map(|mean| GRAVITY.contains(&mean)) {
        [true, false] => Some(true),
        [false, true] => Some(false),
        // Turning at more than a turn a second for seconds on end: the usual order.
        [true, true] => Some(true),
        [false, false] => None,
    }
}

/// A time and two vectors from one line, separated by blanks or commas, in the order written.
pub fn parse_imu_line(line: &[u8]) -> Option<(Stamp, Vector3, Vector3)> {
    let text = std::str::from_utf8(line).ok()?;
    let mut words = text
        .split(|c: char| c == ',' || c.is_ascii_whitespace())
        .filter(|word| !word.is_empty());
    let time = words.next()?;
    let mut values = [0.0; 6];
    for value in &mut values {
        *value = words.next()?.parse().ok()?;
    }
    if !values.iter().all(|value: &f64| value.is_finite()) {
        return None;
    }
    let stamp = match time.parse::<i64>() {
        // Whole numbers of this size are UNIX nanoseconds; as seconds they would be millennia off.
        Ok(nanos) if nanos > 100_000_000_000_000_000 => Stamp::from_nanos(nanos),
        _ => stamp_from_seconds(time)?,
    };
    let [a, b, c, d, e, f] = values;
    Some((stamp, Vector3::new(a, b, c), Vector3::new(d, e, f)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ImuSample>, String> {
        ImuText::new(PathBuf::from("imu.txt"), text.into())
            .and_then(Iterator::collect)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn the_specific_force_is_found_in_either_place() {
        let force_first = "# t a g\n1.5 0 0 9.8 0.1 0.2 0.3\n1.51 0 0 9.8 0.1 0.2 0.3\n";
        let euroc = "#timestamp [ns],w,a\n1500000000000000000,0.1,0.2,0.3,0,0,9.8\n";
        for (text, nanos) in [
            (force_first, 1_500_000_000),
            (euroc, 1_500_000_000_000_000_000),
        ] {
            let sample = read(text).unwrap()[0];
            assert_eq!(sample.stamp, Stamp::from_nanos(nanos));
            assert_eq!(sample.specific_force, Vector3::new(0.0, 0.0, 9.8));
            assert_eq!(sample.angular_velocity, Vector3::new(0.1, 0.2, 0.3));
        }
    }

    #[test]
    fn bad_lines_are_named_by_their_number() {
        let good = "1 0 0 9.8 0 0 0\n";
        for (line, said) in [
            ("2 0 0 9.8 0 0\n", "line 2"),
            ("2 0 0 nan 0 0 0\n", "line 2"),
            ("1 0 0 9.8 0 0 0\n", "not after"),
            ("two 0 0 9.8 0 0 0\n", "line 2"),
        ] {
            let error = read(&format!("{good}{line}")).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        assert!(read("1 0 0 1 0 0 0\n").unwrap_err().contains("near 9.81"));
        assert!(read("").unwrap().is_empty());
    }
}
