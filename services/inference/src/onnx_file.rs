//! Whether bytes are an ONNX file at all, and a whole one.
//!
//! In: the bytes. Out: that every field of the model, of its graph and of the graph's parts ends
//! where the next begins, and the last at the end. Back ends expect that: the embedded one takes a
//! file that is cut short, and does not come back from some that are none.
//!
//! The encoding is Protocol Buffers' (<https://protobuf.dev/programming-guides/encoding>); field
//! numbers are those of `onnx.proto3`.

/// `ModelProto.graph`.
const GRAPH: u64 = 7;
/// `GraphProto`'s node, initializer, input, output and `value_info`.
const GRAPH_PARTS: [u64; 5] = [1, 5, 11, 12, 13];
/// `GraphProto.node`: a graph without one computes nothing.
const NODE: u64 = 1;

/// Why bytes are no ONNX file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotOnnx {
    /// There is nothing.
    #[error("the file is empty")]
    Empty,
    /// A field ends outside its message, or is none.
    #[error("byte {at} begins no field of an ONNX file, or the file is cut short")]
    Field {
        /// Where.
        at: usize,
    },
    /// There is nothing to run.
    #[error("the file holds no graph with nodes")]
    NoGraph,
}

/// Checks the outer structure.
///
/// # Errors
/// [`NotOnnx`].
pub fn check(bytes: &[u8]) -> Result<(), NotOnnx> {
    if bytes.is_empty() {
        return Err(NotOnnx::Empty);
    }
    let mut nodes = 0;
    fields(bytes, 0, &mut |number, begin, content| {
        let Some(graph) = content.filter(|_| number == GRAPH) else {
            return Ok(());
        };
        fields(graph, begin, &mut |number, begin, content| {
            let part = content.filter(|_| GRAPH_PARTS.contains(&number));
            nodes += usize::from(number == NODE);
            part.map_or(Ok(()), |part| fields(part, begin, &mut |_, _, _| Ok(())))
        })
    })?;
    if nodes == 0 {
        Err(NotOnnx::NoGraph)
    } else {
        Ok(())
    }
}

/// Each field of a message: its number, where its content begins in the file, and the content of
/// one with a length.
fn fields(
    message: &[u8],
    offset: usize,
    visit: &mut impl FnMut(u64, usize, Option<&[u8]>) -> Result<(), NotOnnx>,
) -> Result<(), NotOnnx> {
    let mut at = 0;
    while at < message.len() {
        let broken = NotOnnx::Field { at: offset + at };
        let key = varint(message, &mut at).ok_or(broken)?;
        let (number, wire_type) = (key >> 3, key & 7);
        if number == 0 {
            return Err(broken);
        }
        let length = match wire_type {
            0 => {
                varint(message, &mut at).ok_or(broken)?;
                visit(number, offset + at, None)?;
                continue;
            }
            1 => 8,
            2 => varint(message, &mut at)
                .and_then(|length| usize::try_from(length).ok())
                .ok_or(broken)?,
            5 => 4,
            _ => return Err(broken),
        };
        let end = at.checked_add(length).filter(|end| *end <= message.len());
        let content = &message[at..end.ok_or(broken)?];
        visit(number, offset + at, (wire_type == 2).then_some(content))?;
        at += length;
    }
    Ok(())
}

fn varint(bytes: &[u8], at: &mut usize) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = *bytes.get(*at)?;
        *at += 1;
        value |= u64::from(byte & 0x7F) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}
