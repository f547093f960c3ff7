//! MOTChallenge text: detections, ground truth and results of trackers.
//!
//! In: lines of `frame, id, left, top, width, height[, confidence[, ...]]`, parted by commas or
//! blanks; pixels counted from 1. Out: [`MotLine`]s in the order of the file, and lines again.
//! What follows the confidence (class, visibility, positions in the world) is not read.
//!
//! The format is that of <https://motchallenge.net/instructions>. Detections carry the id -1; a
//! confidence that is left out is 1.

use std::io::{self, BufRead, Read, Write};

use crate::BoundingBox;

/// A line longer than this is no line of boxes.
pub const MAX_LINE_BYTES: usize = 4096;

/// More boxes than this are refused: eleven hours at 25 frames a second with five people.
pub const MAX_BOXES: usize = 5_000_000;

/// Frames are counted up to this: a year at 30 frames a second.
pub const MAX_FRAME: u64 = 1_000_000_000;

/// No image has coordinates beyond this, pixels.
const MAX_PIXELS: f64 = 1e7;

/// One box of one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotLine {
    /// The frame, usually from 1.
    pub frame: u64,
    /// Whose box it is; -1 for detections.
    pub id: i64,
    /// Where, in pixels from the image's corner, whose pixel is (1, 1).
    pub bounding_box: BoundingBox,
    /// How sure; in ground truth 0 marks what shall not be counted.
    pub confidence: f64,
}

/// Why text is no MOTChallenge text. Lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotError {
    /// It can't be read.
    #[error("can't be read: {0}")]
    Io(#[from] io::Error),
    /// Too few fields.
    #[error(
        "line {line} has {got} fields, expected at least 6 (frame, id, left, top, width, height)"
    )]
    Fields {
        /// Where.
        line: u64,
        /// How many there are.
        got: usize,
    },
    /// A field that is no number in its range.
    #[error("line {line}: the {field} is {text:?}, expected {expected}")]
    Field {
        /// Where.
        line: u64,
        /// Which.
        field: &'static str,
        /// Its beginning.
        text: String,
        /// What it should be.
        expected: &'static str,
    },
    /// Not a text file of boxes.
    #[error("line {line} is longer than {MAX_LINE_BYTES} bytes")]
    LineTooLong {
        /// Where.
        line: u64,
    },
    /// Bytes that are no text.
    #[error("line {line} is not text")]
    NotText {
        /// Where.
        line: u64,
    },
    /// More boxes than fit.
    #[error("more than {MAX_BOXES} boxes")]
    TooMany,
}

/// Reads all boxes. Blank lines and lines that begin with `#` are skipped.
///
/// # Errors
/// [`MotError`], with the line.
pub fn read(mut reader: impl BufRead) -> Result<Vec<MotLine>, MotError> {
    let mut boxes = Vec::new();
    let mut bytes = Vec::new();
    for line in 1.. {
        bytes.clear();
        let limit = MAX_LINE_BYTES as u64 + 1;
        let got = (&mut reader).take(limit).read_until(b'\n', &mut bytes)?;
        if got == 0 {
            break;
        }
        if got > MAX_LINE_BYTES && bytes.last() != Some(&b'\n') {
            return Err(MotError::LineTooLong { line });
        }
        let text = std::str::from_utf8(&bytes).map_err(|_| MotError::NotText { line })?;
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        if boxes.len() == MAX_BOXES {
            return Err(MotError::TooMany);
        }
        boxes.push(parse(text, line)?);
    }
    Ok(boxes)
}

fn parse(text: &str, line: u64) -> Result<MotLine, MotError> {
    let comma = text.contains(',');
    let mut fields = [""; 7];
    let mut got = 0;
    let mut put = |field| {
        if let Some(slot) = fields.get_mut(got) {
            *slot = field;
        }
        got += 1;
    };
    match comma {
        true => text.split(',').map(str::trim).for_each(&mut put),
        false => text.split_whitespace().for_each(&mut put),
    }
    if got < 6 {
        return Err(MotError::Fields { line, got });
    }
    let number = |at: usize, field: &'static str, limit: f64, expected: &'static str| {
        let value = fields[at].parse::<f64>().ok();
        let value = value.filter(|v| v.is_finite() && v.abs() <= limit);
        value.ok_or_else(|| refused(line, field, fields[at], expected))
    };
    // Some tools write 1.0 or 1e3 for whole numbers.
    let whole = |at: usize, field: &'static str, limit: f64, expected: &'static str| {
        let value = number(at, field, limit, expected)?;
        match value.fract() == 0.0 {
            true => Ok(value as i64),
            false => Err(refused(line, field, fields[at], expected)),
        }
    };
    let frame = whole(0, "frame", MAX_FRAME as f64, "a whole number from 0 to 1e9")?;
    let frame = u64::try_from(frame)
        .map_err(|_| refused(line, "frame", fields[0], "a whole number from 0 to 1e9"))?;
    // Beyond 2^53 floating point no longer tells neighbours apart.
    let id = whole(1, "id", 9e15, "a whole number below 9e15")?;
    let pixels = |at, field| number(at, field, MAX_PIXELS, "a number of pixels within 1e7");
    Ok(MotLine {
        frame,
        id,
        bounding_box: BoundingBox::new(
            pixels(2, "left edge")?,
            pixels(3, "top edge")?,
            pixels(4, "width")?,
            pixels(5, "height")?,
        ),
        confidence: match got {
            6 => 1.0,
            _ => number(6, "confidence", f64::MAX, "a number")?,
        },
    })
}

fn refused(line: u64, field: &'static str, text: &str, expected: &'static str) -> MotError {
    MotError::Field {
        line,
        field,
        text: text.chars().take(24).collect(),
        expected,
    }
}

/// Writes one line for each box, as trackers' results are written: the last three columns, which
/// are positions in the world, are -1.
///
/// # Errors
/// The writer's.
pub fn write<'a>(
    lines: impl IntoIterator<Item = &'a MotLine>,
    out: &mut impl Write,
) -> io::Result<()> {
    for line in lines {
        let b = &line.bounding_box;
        writeln!(
            out,
            "{},{},{:.2},{:.2},{:.2},{:.2},{:.4},-1,-1,-1",
            line.frame, line.id, b.left, b.top, b.width, b.height, line.confidence
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detections_truth_and_results_are_read() {
        // First lines of a detector's, a ground truth's and a tracker's file, and one with blanks.
        let text = "\u{feff}1,-1,281.931,187.466,79.93,209.537,0.997784,-1,-1,-1\r\n\
                    # made by hand\n\n\
                    2,3,184,96,35.446,154.5,1,12.621,10.628,0\n\
                    3.0 7 1 2 3 4\n";
        let lines = read(text.as_bytes()).unwrap();
        assert_eq!(lines.len(), 3);
        assert_eq!((lines[0].frame, lines[0].id), (1, -1));
        assert_eq!(lines[0].confidence, 0.997784);
        assert_eq!(
            lines[1].bounding_box,
            BoundingBox::new(184.0, 96.0, 35.446, 154.5)
        );
        assert_eq!((lines[2].frame, lines[2].id), (3, 7));
        assert_eq!(lines[2].confidence, 1.0);
    }

    #[test]
    fn a_bad_line_is_named_with_what_is_wrong() {
        for (text, said) in [
            ("1,2,3\n", "line 1 has 3 fields"),
            (
                "1,1,0,0,1,1\n2,1,0,nan,1,1\n",
                "line 2: the top edge is \"nan\"",
            ),
            ("1.5,1,0,0,1,1\n", "the frame is \"1.5\""),
            ("-1,1,0,0,1,1\n", "the frame is \"-1\""),
            ("1,x,0,0,1,1\n", "the id is \"x\""),
            ("1,1,0,0,1e30,1\n", "the width is \"1e30\""),
            ("1,1,0,0,1,1,inf\n", "the confidence is \"inf\""),
        ] {
            let error = read(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        assert!(matches!(
            read(&[b'1'; 9000][..]),
            Err(MotError::LineTooLong { line: 1 })
        ));
        assert!(matches!(
            read(&b"\xff\xfe\n"[..]),
            Err(MotError::NotText { line: 1 })
        ));
    }

    #[test]
    fn what_is_written_is_a_trackers_line() {
        let line = MotLine {
            frame: 4,
            id: 2,
            bounding_box: BoundingBox::new(1.5, 2.0, 30.25, 60.0),
            confidence: 0.5,
        };
        let mut text = Vec::new();
        write([&line], &mut text).unwrap();
        assert_eq!(text, b"4,2,1.50,2.00,30.25,60.00,0.5000,-1,-1,-1\n");
        assert_eq!(read(&text[..]).unwrap(), [line]);
    }
}
