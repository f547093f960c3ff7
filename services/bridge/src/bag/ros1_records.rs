//! Records of a ROS 1 bag: a header of `name=value` fields and data, each with its length in front.

use hachi_hal::Stamp;

pub(super) const OP_MESSAGE: u8 = 2;
pub(super) const OP_INDEX: u8 = 4;
pub(super) const OP_CHUNK: u8 = 5;
pub(super) const OP_CONNECTION: u8 = 7;

#[derive(Debug, Clone, Copy)]
pub(super) enum Compression {
    None,
    Bzip2,
    Lz4,
}

/// A record within an unpacked chunk.
pub(super) struct Record<'a> {
    pub(super) fields: Fields<'a>,
    pub(super) data: &'a [u8],
    pub(super) end: usize,
}

impl<'a> Record<'a> {
    pub(super) fn parse(bytes: &'a [u8], at: usize) -> Option<Self> {
        let rest = bytes.get(at..)?;
        let (header, rest) = block(rest)?;
        let (data, rest) = block(rest)?;
        Some(Self {
            fields: Fields::parse(header)?,
            data,
            end: bytes.len() - rest.len(),
        })
    }
}

/// The fields of a record's header that are used here.
#[derive(Debug, Default)]
pub(super) struct Fields<'a> {
    pub(super) op: Option<u8>,
    pub(super) conn: Option<u32>,
    pub(super) time: Option<Stamp>,
    pub(super) size: Option<u32>,
    pub(super) count: Option<u32>,
    pub(super) compression: Option<&'a [u8]>,
    pub(super) topic: Option<&'a str>,
    pub(super) kind: &'a str,
}

impl<'a> Fields<'a> {
    /// `None` where the bytes are no fields.
    pub(super) fn parse(mut header: &'a [u8]) -> Option<Self> {
        let mut fields = Self::default();
        while !header.is_empty() {
            let (field, rest) = block(header)?;
            header = rest;
            let split = field.iter().position(|&byte| byte == b'=')?;
            let (name, value) = (&field[..split], &field[split + 1..]);
            let number = || value.first_chunk().copied().map(u32::from_le_bytes);
            match name {
                b"op" => fields.op = value.first().copied(),
                b"conn" => fields.conn = number(),
                b"size" => fields.size = number(),
                b"count" => fields.count = number(),
                b"time" if value.len() == 8 => fields.time = Some(stamp(value)),
                b"compression" => fields.compression = Some(value),
                b"topic" => fields.topic = std::str::from_utf8(value).ok(),
                b"type" => fields.kind = std::str::from_utf8(value).unwrap_or(""),
                _ => {}
            }
        }
        Some(fields)
    }

    pub(super) fn compression(&self) -> Result<Compression, String> {
        match self.compression {
            Some(b"none") => Ok(Compression::None),
            Some(b"bz2") => Ok(Compression::Bzip2),
            Some(b"lz4") => Ok(Compression::Lz4),
            other => Err(format!(
                "a chunk is compressed with {:?}; none, bz2 and lz4 are known",
                crate::error::seen(other.unwrap_or_default())
            )),
        }
    }
}

/// A u32 length and as many bytes; and what is behind them.
fn block(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// Seconds and nanoseconds, both u32.
pub(super) fn stamp(bytes: &[u8]) -> Stamp {
    Stamp::from_nanos(i64::from(u32_at(bytes, 0)) * 1_000_000_000)
        .offset(i64::from(u32_at(bytes, 4)))
}

/// Callers hold slices that are long enough.
pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
