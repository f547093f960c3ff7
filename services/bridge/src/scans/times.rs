//! `times.txt`: one line with a time in seconds for each scan, in the order of the scans.

use std::path::Path;

use hachi_hal::Stamp;

use crate::error::{ReadError, seen};
use crate::seconds::stamp_from_seconds;

/// Times of the bytes of a `times.txt`, strictly increasing. Blank lines and lines that begin with
/// `#` are skipped. `path` is for the errors.
///
/// # Errors
/// [`ReadError::Line`] names the first line that is no time or not after the one before.
pub fn parse_times(path: &Path, bytes: &[u8]) -> Result<Vec<Stamp>, ReadError> {
    let mut times: Vec<Stamp> = Vec::new();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let line = line.trim_ascii();
        if line.is_empty() || line[0] == b'#' {
            continue;
        }
        let bad = |problem| ReadError::Line {
            path: path.to_path_buf(),
            line: index + 1,
            seen: seen(line),
            problem,
        };
        let time = std::str::from_utf8(line)
            .ok()
            .and_then(stamp_from_seconds)
            .ok_or_else(|| bad("is no time in seconds"))?;
        if times.last().is_some_and(|&before| time <= before) {
            return Err(bad("is not after the time before it"));
        }
        times.push(time);
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<i64>, String> {
        parse_times(Path::new("times.txt"), text.as_bytes())
            .map(|times| times.into_iter().map(Stamp::as_nanos).collect())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn one_time_a_line_with_blank_lines_and_comments_is_read() {
        let times = parse("# seconds\n0.000000e+00\r\n1.037000e-01\n\n0.2074\n").unwrap();
        assert_eq!(times, [0, 103_700_000, 207_400_000]);
        assert!(parse("").unwrap().is_empty());
    }

    #[test]
    fn a_line_that_is_no_time_is_named_by_its_number() {
        assert!(
            parse("0.1\n\nabout two\n")
                .unwrap_err()
                .contains("line 3: \"about two\"")
        );
        assert!(parse("0.1\nnan\n").unwrap_err().contains("line 2"));
        assert!(parse("0.1\n0.1\n").unwrap_err().contains("line 2"));
        assert!(parse("0.2\n0.1\n").unwrap_err().contains("not after"));
    }
}
