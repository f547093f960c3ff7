//! Reads PLY, the polygon file format, version 1.0: its vertices are the points.
//!
//! In: a text header (format, elements and their properties, end_header) and a body that is ascii
//! or binary in either byte order. Elements before the vertices are stepped over, elements after
//! them are not looked at. List properties, also within a vertex, are skipped.

use hachi_hal::Point;

use super::layout::{Field, Layout};
use super::ply_header::{Element, Format, Header, Property};
use super::scalar::{Column, Scalar};
use super::{CloudDecoder, CloudInfo, MAX_POINTS};
use crate::error::{CloudError, seen};

/// Appends the vertices of one file.
pub(super) fn read(
    bytes: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let header = Header::parse(bytes)?;
    let body = &bytes[header.body_start..];
    let (vertices, before) = header
        .elements
        .split_last()
        .filter(|(last, _)| last.is_vertex)
        .ok_or(CloudError::NoField {
            missing: "element vertex",
            seen: String::new(),
        })?;
    let layout = vertices.layout(header.format == Format::Big)?;
    if vertices.count > MAX_POINTS {
        return Err(CloudError::TooLarge {
            what: "the number of vertices",
            seen: vertices.count,
            limit: MAX_POINTS,
        });
    }
    if header.format == Format::Ascii {
        return read_ascii(&header, vertices, before, &layout, body, decoder, points);
    }
    let mut cursor = Cursor {
        bytes: body,
        at: 0,
        big_endian: header.format == Format::Big,
    };
    for element in before {
        cursor.step_over(element)?;
    }
    read_binary(vertices, &layout, cursor, decoder, points)
}

fn read_binary(
    vertices: &Element<'_>,
    layout: &Layout,
    mut cursor: Cursor<'_>,
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    if let Some(stride) = vertices.fixed_size() {
        let left = cursor.bytes.len() - cursor.at;
        let needed = vertices.count.saturating_mul(stride as u64);
        let rows = usize::try_from(needed)
            .ok()
            .and_then(|needed| cursor.bytes[cursor.at..].get(..needed))
            .ok_or(CloudError::Truncated {
                points: vertices.count,
                needed,
                got: left as u64,
            })?;
        points.reserve(rows.len() / stride);
        return Ok(decoder.decode(layout, rows.chunks_exact(stride), points));
    }
    let mut row = std::mem::take(&mut decoder.row);
    decoder.begin();
    for _ in 0..vertices.count {
        row.clear();
        for property in &vertices.properties {
            match *property {
                Property::Scalar(_, scalar) => row.extend_from_slice(cursor.take(scalar.size())?),
                Property::List { count, item } => cursor.step_over_list(count, item)?,
            }
        }
        decoder.push(layout, &row, points);
    }
    decoder.row = row;
    Ok(decoder.finish(layout, points))
}

fn read_ascii(
    header: &Header<'_>,
    vertices: &Element<'_>,
    before: &[Element<'_>],
    layout: &Layout,
    body: &[u8],
    decoder: &mut CloudDecoder,
    points: &mut Vec<Point>,
) -> Result<CloudInfo, CloudError> {
    let mut skip: u64 = before
        .iter()
        .fold(0, |sum, element| sum.saturating_add(element.count));
    let mut row = std::mem::take(&mut decoder.row);
    decoder.begin();
    let mut read = 0;
    for (index, line) in body.split(|&byte| byte == b'\n').enumerate() {
        if read == vertices.count {
            break;
        }
        if line.trim_ascii().is_empty() {
            continue;
        }
        if skip > 0 {
            skip -= 1;
            continue;
        }
        row.clear();
        if !vertices.push_line(line, &mut row) {
            return Err(CloudError::Text {
                line: header.body_line + index,
                seen: seen(line),
                expected: vertices.properties.len(),
            });
        }
        decoder.push(layout, &row, points);
        read += 1;
    }
    decoder.row = row;
    if read < vertices.count {
        return Err(CloudError::Truncated {
            points: vertices.count,
            // Each value takes two bytes at least, counting what parts it from the next.
            needed: vertices
                .count
                .saturating_mul(2 * vertices.properties.len() as u64),
            got: body.len() as u64,
        });
    }
    Ok(decoder.finish(layout, points))
}

impl Element<'_> {
    /// Where the quantities lie in a row of this element's scalar properties.
    fn layout(&self, big_endian: bool) -> Result<Layout, CloudError> {
        let scalars = self
            .properties
            .iter()
            .filter_map(|property| match *property {
                Property::Scalar(name, scalar) => Some((name, scalar)),
                Property::List { .. } => None,
            });
        let fields = scalars.scan(0_u64, |end, (name, scalar)| {
            let offset = *end;
            *end += scalar.size() as u64;
            Some(Field {
                name,
                scalar,
                offset,
            })
        });
        let stride = fields.clone().map(|field| field.scalar.size()).sum();
        Layout::new(fields, stride, big_endian)
    }

    /// Bytes of one element, if all have the same.
    fn fixed_size(&self) -> Option<usize> {
        self.properties
            .iter()
            .try_fold(0, |sum, property| match property {
                Property::Scalar(_, scalar) => Some(sum + scalar.size()),
                Property::List { .. } => None,
            })
    }

    /// Appends the scalars of one line of text. `false` if the line does not hold them.
    fn push_line(&self, line: &[u8], row: &mut Vec<u8>) -> bool {
        let Ok(text) = std::str::from_utf8(line) else {
            return false;
        };
        let mut words = text.split_ascii_whitespace();
        for property in &self.properties {
            let Some(word) = words.next() else {
                return false;
            };
            match property {
                Property::Scalar(_, scalar) => {
                    if !scalar.push_text(word, row) {
                        return false;
                    }
                }
                Property::List { .. } => {
                    let Ok(items) = word.parse::<usize>() else {
                        return false;
                    };
                    if items > 0 && words.nth(items - 1).is_none() {
                        return false;
                    }
                }
            }
        }
        true
    }
}

/// Steps through a binary body.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], CloudError> {
        let taken = self
            .at
            .checked_add(count)
            .and_then(|end| self.bytes.get(self.at..end))
            .ok_or(CloudError::Truncated {
                points: 1,
                needed: count as u64,
                got: (self.bytes.len() - self.at) as u64,
            })?;
        self.at += count;
        Ok(taken)
    }

    fn step_over_list(&mut self, count: Scalar, item: Scalar) -> Result<(), CloudError> {
        let column = Column {
            offset: 0,
            scalar: count,
            big_endian: self.big_endian,
        };
        let items = column.i64(self.take(count.size())?).max(0);
        let bytes = usize::try_from(items)
            .ok()
            .and_then(|items| items.checked_mul(item.size()))
            .unwrap_or(usize::MAX);
        self.take(bytes).map(|_| ())
    }

    fn step_over(&mut self, element: &Element<'_>) -> Result<(), CloudError> {
        if let Some(size) = element.fixed_size() {
            let bytes = element.count.saturating_mul(size as u64);
            let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
            return self.take(bytes).map(|_| ());
        }
        // Each turn takes bytes or fails: a list has its count at least.
        for _ in 0..element.count {
            for property in &element.properties {
                match *property {
                    Property::Scalar(_, scalar) => {
                        self.take(scalar.size())?;
                    }
                    Property::List { count, item } => self.step_over_list(count, item)?,
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "ply_tests.rs"]
mod tests;
