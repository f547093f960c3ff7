//! Reads PCD, the point cloud library's file format, version 0.7 and before.
//!
//! In: a text header (VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS, DATA)
//! and a body that is ascii, binary (points one after another) or binary_compressed (an LZF
//! stream of all values of the first field, then of the second, ...). Fields may stand in any
//! order and have any type; of a field with a COUNT above one the first value counts. Some
//! writers leave WIDTH at 0, so POINTS is believed before WIDTH times HEIGHT.

use hachi_hal::Point;

use super::layout::{Field, Layout};
use super::scalar::Scalar;
use super::{CloudDecoder, CloudInfo, MAX_POINTS};
use crate::error::{CloudError, seen};

/// Headers of real files have a few hundred bytes.
const HEADER_LIMIT: usize = 64 * 1024;
/// More fields than any sensor sends; bounds what a header can make us keep.
const FIELD_LIMIT: usize = 256;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Body {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Debug)]
struct PcdField<'a> {
    name: &'a str,
    scalar: Scalar,
    count: u64,
    /// Where it lies in a point of the binary body.
    offset: u64,
}

#[derive(Debug)]
struct Header<'a> {
    fields: Vec<PcdField<'a>>,
    stride: usize,
    points: u64,
    body: Body,
    /// Where the body begins, and the number of its first line.
    body_start: usize,
    body_line: usize,
}

/// Appends the points of one file.
pub(super) fn read(
    bytes: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let header = Header::parse(bytes)?;
    let body = &bytes[header.body_start..];
    let layout = Layout::new(header.fields(), header.stride, false)?;
    match header.body {
        Body::Ascii => read_ascii(&header, &layout, body, decoder, points),
        Body::Binary => {
            let rows = whole_rows(body, header.points, header.stride)?;
            points.reserve(rows.len() / header.stride);
            Ok(decoder.decode(&layout, rows.chunks_exact(header.stride), points))
        }
        Body::Compressed => read_compressed(&header, body, decoder, points),
    }
}

/// The first `points` rows, if the bytes hold that many.
fn whole_rows(body: &[u8], points: u64, stride: usize) -> Result<&[u8], CloudError> {
    let needed = points.saturating_mul(stride as u64);
    usize::try_from(needed)
        .ok()
        .and_then(|needed| body.get(..needed))
        .ok_or(CloudError::Truncated {
            points,
            needed,
            got: body.len() as u64,
        })
}

fn read_ascii(
    header: &Header<'_>,
    layout: &Layout,
    body: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let per_point: u64 = header.fields.iter().map(|field| field.count).sum();
    let mut row = std::mem::take(&mut decoder.row);
    decoder.begin();
    let mut read = 0;
    for (index, line) in body.split(|&byte| byte == b'\n').enumerate() {
        if read == header.points {
            break;
        }
        if line.trim_ascii().is_empty() {
            continue;
        }
        let bad = || CloudError::Text {
            line: header.body_line + index,
            seen: seen(line),
            expected: per_point as usize,
        };
        let text = std::str::from_utf8(line).map_err(|_| bad())?;
        let mut tokens = text.split_ascii_whitespace();
        row.clear();
        for field in &header.fields {
            for _ in 0..field.count {
                let token = tokens.next().ok_or_else(bad)?;
                if !field.scalar.push_text(token, &mut row) {
                    return Err(bad());
                }
            }
        }
        decoder.push(layout, &row, points);
        read += 1;
    }
    decoder.row = row;
    if read < header.points {
        return Err(CloudError::Truncated {
            points: header.points,
            // Each value takes two bytes at least, counting what parts it from the next.
            needed: header.points.saturating_mul(per_point).saturating_mul(2),
            got: body.len() as u64,
        });
    }
    Ok(decoder.finish(layout, points))
}

fn read_compressed(
    header: &Header<'_>,
    body: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let too_short = CloudError::Truncated {
        points: header.points,
        needed: 8,
        got: body.len() as u64,
    };
    let (sizes, stream) = body.split_at_checked(8).ok_or(too_short)?;
    let size_at = |at: usize| {
        u64::from(u32::from_le_bytes([
            sizes[at],
            sizes[at + 1],
            sizes[at + 2],
            sizes[at + 3],
        ]))
    };
    let (compressed, expanded) = (size_at(0), size_at(4));
    let needed = header.points.saturating_mul(header.stride as u64);
    let stream = stream
        .get(..usize::try_from(compressed).unwrap_or(usize::MAX))
        .ok_or(CloudError::Truncated {
            points: header.points,
            needed: compressed.saturating_add(8),
            got: body.len() as u64,
        })?;
    if expanded != needed {
        return Err(CloudError::Truncated {
            points: header.points,
            needed,
            got: expanded,
        });
    }
    let mut columns = std::mem::take(&mut decoder.body);
    super::lzf::decompress(stream, expanded, &mut columns)?;
    // Fits: that many bytes were just written.
    let count = header.points as usize;
    let layout = Layout::new(header.fields(), header.stride, false)?;
    let mut row = std::mem::take(&mut decoder.row);
    row.clear();
    row.resize(header.stride, 0);
    decoder.begin();
    points.reserve(count);
    for index in 0..count {
        for field in &header.fields {
            let size = field.scalar.size() * field.count as usize;
            // The field's column starts where it would lie in `count` points.
            let from = field.offset as usize * count + index * size;
            let to = field.offset as usize;
            row[to..to + size].copy_from_slice(&columns[from..from + size]);
        }
        decoder.push(&layout, &row, points);
    }
    decoder.row = row;
    decoder.body = columns;
    Ok(decoder.finish(&layout, points))
}

impl<'a> Header<'a> {
    fn fields(&self) -> impl Iterator<Item = Field<'a>> + Clone {
        self.fields.iter().map(|field| Field {
            name: field.name,
            scalar: field.scalar,
            offset: field.offset,
        })
    }

    fn parse(bytes: &'a [u8]) -> Result<Self, CloudError> {
        let mut names: Vec<&str> = Vec::new();
        let mut sizes: Vec<&str> = Vec::new();
        let mut types: Vec<&str> = Vec::new();
        let mut counts: Vec<&str> = Vec::new();
        let (mut width, mut height, mut points) = (None, None, None);
        let mut at = 0;
        let mut line_number = 0;
        let body = loop {
            line_number += 1;
            let rest = bytes.get(at..).unwrap_or_default();
            let window = &rest[..rest.len().min(HEADER_LIMIT.saturating_sub(at))];
            let Some(end) = window.iter().position(|&byte| byte == b'\n') else {
                return Err(CloudError::HeaderEnd {
                    limit: HEADER_LIMIT.min(bytes.len()),
                });
            };
            let line = &rest[..end];
            at += end + 1;
            let bad = |expected| CloudError::Header {
                line: line_number,
                seen: seen(line),
                expected,
            };
            if line.trim_ascii().is_empty() || line.first() == Some(&b'#') {
                continue;
            }
            let text = std::str::from_utf8(line).map_err(|_| bad("text"))?;
            let mut words = text.split_ascii_whitespace();
            let key = words.next().unwrap_or_default();
            let number = |mut words: std::str::SplitAsciiWhitespace<'_>| {
                words
                    .next()
                    .and_then(|word| word.parse::<u64>().ok())
                    .ok_or_else(|| bad("a whole number"))
            };
            match key {
                "FIELDS" | "COLUMNS" => names = words.take(FIELD_LIMIT + 1).collect(),
                "SIZE" => sizes = words.take(FIELD_LIMIT + 1).collect(),
                "TYPE" => types = words.take(FIELD_LIMIT + 1).collect(),
                "COUNT" => counts = words.take(FIELD_LIMIT + 1).collect(),
                "WIDTH" => width = Some(number(words)?),
                "HEIGHT" => height = Some(number(words)?),
                "POINTS" => points = Some(number(words)?),
                "VERSION" | "VIEWPOINT" => {}
                "DATA" => {
                    break match words.next() {
                        Some("ascii") => Body::Ascii,
                        Some("binary") => Body::Binary,
                        Some("binary_compressed") => Body::Compressed,
                        _ => return Err(bad("DATA ascii, binary or binary_compressed")),
                    };
                }
                _ => return Err(bad("a PCD header line")),
            }
        };
        let fault = |expected| CloudError::Header {
            line: line_number,
            seen: format!(
                "{} FIELDS, {} SIZE, {} TYPE, {} COUNT",
                names.len(),
                sizes.len(),
                types.len(),
                counts.len()
            ),
            expected,
        };
        if names.len() > FIELD_LIMIT || sizes.len() != names.len() || types.len() != names.len() {
            return Err(fault("as many SIZE and TYPE as FIELDS, at most 256,"));
        }
        if !counts.is_empty() && counts.len() != names.len() {
            return Err(fault("as many COUNT as FIELDS, or none,"));
        }
        let (fields, stride) = fields_of(&names, &sizes, &types, &counts)?;
        let points = points
            .or_else(|| width.unwrap_or(0).checked_mul(height.unwrap_or(1)))
            .unwrap_or(u64::MAX);
        if points > MAX_POINTS {
            return Err(CloudError::TooLarge {
                what: "the number of points",
                seen: points,
                limit: MAX_POINTS,
            });
        }
        Ok(Self {
            fields,
            stride,
            points,
            body,
            body_start: at,
            body_line: line_number + 1,
        })
    }
}

/// The field table and the bytes of one point.
fn fields_of<'a>(
    names: &[&'a str],
    sizes: &[&str],
    types: &[&str],
    counts: &[&str],
) -> Result<(Vec<PcdField<'a>>, usize), CloudError> {
    /// Larger points exist in no sensor's files (a histogram descriptor has 1,344 bytes).
    const STRIDE_LIMIT: u64 = 64 * 1024;
    let mut fields = Vec::with_capacity(names.len());
    let mut offset = 0_u64;
    for (index, &name) in names.iter().enumerate() {
        let scalar = match (types[index], sizes[index]) {
            ("F", "4") => Scalar::F32,
            ("F", "8") => Scalar::F64,
            ("I", "1") => Scalar::I8,
            ("I", "2") => Scalar::I16,
            ("I", "4") => Scalar::I32,
            ("I", "8") => Scalar::I64,
            ("U", "1") => Scalar::U8,
            ("U", "2") => Scalar::U16,
            ("U", "4") => Scalar::U32,
            ("U", "8") => Scalar::U64,
            (kind, size) => {
                return Err(CloudError::FieldType {
                    field: seen(name.as_bytes()),
                    seen: seen(format!("TYPE {kind} SIZE {size}").as_bytes()),
                });
            }
        };
        let count = match counts.get(index) {
            None => 1,
            Some(text) => text.parse::<u64>().map_err(|_| CloudError::FieldType {
                field: seen(name.as_bytes()),
                seen: seen(format!("COUNT {text}").as_bytes()),
            })?,
        };
        // A field without values is no field.
        if count > 0 {
            fields.push(PcdField {
                name,
                scalar,
                count,
                offset,
            });
        }
        offset = offset.saturating_add(count.saturating_mul(scalar.size() as u64));
        if offset > STRIDE_LIMIT {
            return Err(CloudError::TooLarge {
                what: "the size of one point in bytes",
                seen: offset,
                limit: STRIDE_LIMIT,
            });
        }
    }
    Ok((fields, offset as usize))
}

#[cfg(test)]
#[path = "pcd_tests.rs"]
mod tests;
