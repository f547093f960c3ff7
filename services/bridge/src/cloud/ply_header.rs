//! A PLY file's header: its format, and its elements up to the vertices.

use super::scalar::Scalar;
use crate::error::{CloudError, seen};

/// Headers of real files have a few hundred bytes; comments can make them longer.
const HEADER_LIMIT: usize = 64 * 1024;
/// More properties than any sensor's files have; bounds what a header can make us keep.
const PROPERTY_LIMIT: usize = 256;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    Little,
    Big,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Property<'a> {
    Scalar(&'a str, Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Element<'a> {
    pub(super) is_vertex: bool,
    pub(super) count: u64,
    pub(super) properties: Vec<Property<'a>>,
}

#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) format: Format,
    /// Up to and with the vertices.
    pub(super) elements: Vec<Element<'a>>,
    pub(super) body_start: usize,
    pub(super) body_line: usize,
}

impl<'a> Header<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, CloudError> {
        let mut format = None;
        let mut elements: Vec<Element<'a>> = Vec::new();
        let mut properties = 0;
        // Once the vertices are declared, what is declared behind them is only checked.
        let mut behind = false;
        let mut at = 0;
        let mut line_number = 0;
        loop {
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
            let starts = |word: &[u8]| line.starts_with(word);
            if starts(b"comment") || starts(b"obj_info") || line.trim_ascii().is_empty() {
                continue;
            }
            let text = std::str::from_utf8(line).map_err(|_| bad("text"))?;
            let words: [&str; 6] = first_words(text);
            match (line_number, words) {
                (1, ["ply", "", ..]) => {}
                (1, _) => return Err(bad("ply")),
                (_, ["format", "ascii", "1.0", ..]) => format = Some(Format::Ascii),
                (_, ["format", "binary_little_endian", "1.0", ..]) => format = Some(Format::Little),
                (_, ["format", "binary_big_endian", "1.0", ..]) => format = Some(Format::Big),
                (_, ["element", name, count, ..]) => {
                    let count = count.parse().map_err(|_| bad("element NAME COUNT"))?;
                    behind |= elements.last().is_some_and(|element| element.is_vertex);
                    if !behind {
                        elements.push(Element {
                            is_vertex: name == "vertex",
                            count,
                            properties: Vec::new(),
                        });
                    }
                }
                (_, ["property", "list", count, item, _, ""]) => {
                    let list = Property::List {
                        count: scalar(count).ok_or_else(|| bad("a type for the list's length"))?,
                        item: scalar(item).ok_or_else(|| bad("a type for the list's items"))?,
                    };
                    add(&mut elements, behind, list, &mut properties)
                        .ok_or_else(|| bad("at most 256 properties, behind their element,"))?;
                }
                (_, ["property", kind, name, "", ..]) if !name.is_empty() => {
                    let kind = scalar(kind).ok_or_else(|| bad("a property type"))?;
                    let property = Property::Scalar(name, kind);
                    add(&mut elements, behind, property, &mut properties)
                        .ok_or_else(|| bad("at most 256 properties, behind their element,"))?;
                }
                (_, ["end_header", ..]) => break,
                _ => return Err(bad("a PLY 1.0 header line")),
            }
        }
        // Elements of no properties have no bytes: without them, every step over one takes some.
        elements.retain(|element| element.is_vertex || !element.properties.is_empty());
        Ok(Self {
            format: format.ok_or(CloudError::Header {
                line: line_number,
                seen: "end_header".into(),
                expected: "a format line before it",
            })?,
            elements,
            body_start: at,
            body_line: line_number + 1,
        })
    }
}

fn first_words<const N: usize>(text: &str) -> [&str; N] {
    let mut words = [""; N];
    for (slot, word) in words.iter_mut().zip(text.split_ascii_whitespace()) {
        *slot = word;
    }
    words
}

/// Adds a property to the last element. `None` if there is none or there are too many.
fn add<'a>(
    elements: &mut [Element<'a>],
    behind: bool,
    property: Property<'a>,
    properties: &mut usize,
) -> Option<()> {
    let element = elements.last_mut()?;
    *properties += 1;
    if *properties > PROPERTY_LIMIT {
        return None;
    }
    if !behind {
        element.properties.push(property);
    }
    Some(())
}

/// A PLY type name, old or new.
fn scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}
