//! Records of an MCAP file: an opcode, a length of eight bytes and as many bytes; some of them are
//! chunks, which hold further records, compressed or not.
//!
//! Walked and parsed here, after the MCAP specification's list of records. The `mcap` crate's linear
//! reader subtracts a length inside an uncompressed chunk unchecked and its parser allocates what a
//! string claims; and a walk of our own goes on behind a broken chunk.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{ChunkIndex, op};

use super::{BLOCK_LIMIT, Topic};

/// Opcode and length.
const HEAD: u64 = 9;
const MAGIC_LEN: u64 = 8;
/// A footer record (summary start, summary offset start, checksum) and the closing magic.
const FOOTER_LEN: u64 = HEAD + 20 + MAGIC_LEN;

/// The record in front: its opcode, its body, and what follows. `None` where the bytes end first.
fn split_record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&opcode, rest) = bytes.split_first()?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (body, rest) = rest.split_at_checked(length)?;
    Some((opcode, body, rest))
}

/// Reads the fields of a record's body, all little-endian.
#[derive(Debug, Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*bytes)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(bytes)
    }

    fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        std::str::from_utf8(self.bytes(length.into())?).ok()
    }

    /// A map from channels to numbers, as its entries.
    fn map(&mut self) -> Option<impl Iterator<Item = (u16, u64)> + use<'a>> {
        let length = self.u32()?;
        let mut entries = Fields(self.bytes(length.into())?);
        Some(std::iter::from_fn(move || {
            Some((entries.u16()?, entries.u64()?))
        }))
    }
}

/// A message record: its channel, when it was logged (ns), its bytes.
pub(super) fn message(body: &[u8]) -> Option<(u16, u64, &[u8])> {
    let mut fields = Fields(body);
    let channel = fields.u16()?;
    let _sequence = fields.u32()?;
    let log_time = fields.u64()?;
    let _publish_time = fields.u64()?;
    Some((channel, log_time, fields.0))
}

fn chunk_index(mut fields: Fields<'_>) -> Option<ChunkIndex> {
    Some(ChunkIndex {
        message_start_time: fields.u64()?,
        message_end_time: fields.u64()?,
        chunk_start_offset: fields.u64()?,
        chunk_length: fields.u64()?,
        message_index_offsets: fields.map()?.collect(),
        message_index_length: fields.u64()?,
        compression: fields.string()?.into(),
        compressed_size: fields.u64()?,
        uncompressed_size: fields.u64()?,
    })
}

/// What a file says about itself, in its summary or on the way.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub(super) topics: Vec<Topic>,
    /// Channel number to topic.
    pub(super) channels: HashMap<u16, usize>,
    /// Messages in all, and of each channel, where a statistics record says so.
    pub(super) counts: Option<(u64, Vec<(u16, u64)>)>,
    pub(super) chunks: Vec<ChunkIndex>,
    schemas: HashMap<u16, String>,
}

impl Contents {
    /// Takes note of a record; those of no interest, and broken ones, change nothing.
    pub(super) fn add(&mut self, opcode: u8, body: &[u8]) {
        let fields = Fields(body);
        // `None` is a record that breaks off.
        let _ = match opcode {
            op::SCHEMA => self.add_schema(fields),
            op::CHANNEL => self.add_channel(fields),
            op::STATISTICS => self.add_statistics(fields),
            op::CHUNK_INDEX => chunk_index(fields).map(|index| self.chunks.push(index)),
            _ => None,
        };
    }

    fn add_schema(&mut self, mut fields: Fields<'_>) -> Option<()> {
        let id = fields.u16()?;
        self.schemas.insert(id, fields.string()?.into());
        Some(())
    }

    fn add_channel(&mut self, mut fields: Fields<'_>) -> Option<()> {
        let id = fields.u16()?;
        let kind = self.schemas.get(&fields.u16()?).map_or("", |name| name);
        let topic = Topic::new(fields.string()?, kind, fields.string()?);
        // Channels of the same topic, type and encoding are one topic.
        let same = |known: &Topic| {
            known.name == topic.name
                && known.type_name == topic.type_name
                && known.kind == topic.kind
                && known.encoding == topic.encoding
        };
        let place = self.topics.iter().position(same).unwrap_or_else(|| {
            self.topics.push(topic);
            self.topics.len() - 1
        });
        self.channels.insert(id, place);
        Some(())
    }

    fn add_statistics(&mut self, mut fields: Fields<'_>) -> Option<()> {
        let messages = fields.u64()?;
        // Counts of schemas, channels, attachments, metadata and chunks; first and last time.
        fields.bytes(2 + 4 * 4 + 2 * 8)?;
        self.counts = Some((messages, fields.map()?.collect()));
        Some(())
    }

    /// Counts a message.
    pub(super) fn count(&mut self, channel: u16, messages: u64) {
        if let Some(&topic) = self.channels.get(&channel) {
            let count = &mut self.topics[topic].messages;
            *count = count.saturating_add(messages);
        }
    }

    /// Reads the summary at the end of a file; `None` where there is none.
    pub(super) fn of_summary(file: &mut File, size: u64) -> io::Result<Option<Self>> {
        let Some(footer_at) = size.checked_sub(FOOTER_LEN) else {
            return Ok(None);
        };
        let mut footer = [0; FOOTER_LEN as usize];
        file.seek(SeekFrom::Start(footer_at))?;
        file.read_exact(&mut footer)?;
        let body = split_record(&footer).filter(|record| record.0 == op::FOOTER);
        let start = body.and_then(|(_, body, _)| body.first_chunk().copied());
        let start = match start.map(u64::from_le_bytes) {
            None | Some(0) => return Ok(None),
            Some(start) => start,
        };
        let Some(length) = footer_at.checked_sub(start).filter(|n| *n <= BLOCK_LIMIT) else {
            return Ok(None);
        };
        let mut section = vec![0; length as usize];
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut section)?;
        let mut contents = Self::default();
        let mut rest = &section[..];
        while let Some((opcode, body, behind)) = split_record(rest) {
            contents.add(opcode, body);
            rest = behind;
        }
        Ok(rest.is_empty().then_some(contents))
    }
}

/// A walk over a file's records from front to back, those in chunks included.
#[derive(Debug)]
pub(super) struct Walk {
    at: u64,
    size: u64,
    limit: u64,
    /// The record of the file that was read last.
    body: Vec<u8>,
    /// The chunk being walked over, unpacked, and how far.
    chunk: Vec<u8>,
    chunk_at: usize,
}

impl Walk {
    /// A walk over a file of `size` bytes with records of at most `limit`.
    pub(super) fn new(size: u64, limit: u64) -> Self {
        Self {
            at: MAGIC_LEN,
            size,
            limit,
            body: Vec::new(),
            chunk: Vec::new(),
            chunk_at: 0,
        }
    }

    /// Hands out records until `visit` finds what it looks for, or the data end.
    ///
    /// An error names what is broken; the next call goes on behind it.
    pub(super) fn find<T>(
        &mut self,
        file: &mut File,
        mut visit: impl FnMut(u8, &[u8]) -> Option<T>,
    ) -> Result<Option<T>, String> {
        loop {
            while self.chunk_at < self.chunk.len() {
                let here = self.chunk_at;
                let Some((opcode, body, rest)) = split_record(&self.chunk[here..]) else {
                    self.chunk_at = self.chunk.len();
                    return Err(format!(
                        "a chunk before byte {} breaks off at its byte {here}",
                        self.at
                    ));
                };
                self.chunk_at = self.chunk.len() - rest.len();
                if let Some(found) = visit(opcode, body) {
                    return Ok(Some(found));
                }
            }
            let Some(opcode) = self.read_record(file)? else {
                return Ok(None);
            };
            if opcode == op::CHUNK {
                self.chunk_at = 0;
                self.chunk.clear();
                if let Err(problem) = unpack(&self.body, self.limit, &mut self.chunk) {
                    self.chunk.clear();
                    return Err(format!("the chunk before byte {}: {problem}", self.at));
                }
            } else if let Some(found) = visit(opcode, &self.body) {
                return Ok(Some(found));
            }
        }
    }

    /// Reads the next record of the file. `None` at the end of the data.
    fn read_record(&mut self, file: &mut File) -> Result<Option<u8>, String> {
        let at = self.at;
        if at >= self.size {
            return Ok(None);
        }
        // Whatever happens below, the walk ends or goes on behind this record.
        self.at = self.size;
        let io = |error: io::Error| format!("{error} at byte {at}");
        let mut head = [0; HEAD as usize];
        file.seek(SeekFrom::Start(at)).map_err(io)?;
        file.read_exact(&mut head).map_err(io)?;
        let [opcode, length @ ..] = head;
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            return Ok(None);
        }
        let length = u64::from_le_bytes(length);
        let left = self.size - at - HEAD;
        if length > left {
            return Err(format!(
                "it breaks off: the record at byte {at} has {length} bytes and {left} are there"
            ));
        }
        self.at = at + HEAD + length;
        if length > BLOCK_LIMIT {
            return Err(format!("the record at byte {at} has {length} bytes"));
        }
        self.body.resize(length as usize, 0);
        file.read_exact(&mut self.body).map_err(io)?;
        Ok(Some(opcode))
    }
}

/// A chunk's unpacked size, its compression, the length of its data, and where they begin.
fn chunk_header(mut fields: Fields<'_>) -> Option<(u64, &str, u64, Fields<'_>)> {
    let _times = fields.bytes(16)?;
    let unpacked = fields.u64()?;
    let _checksum = fields.u32()?;
    Some((unpacked, fields.string()?, fields.u64()?, fields))
}

/// Unpacks a chunk record.
fn unpack(chunk: &[u8], limit: u64, bytes: &mut Vec<u8>) -> Result<(), String> {
    let (expected, compression, length, mut rest) =
        chunk_header(Fields(chunk)).ok_or("its header breaks off")?;
    let packed = rest.bytes(length).ok_or("its data break off")?;
    if expected > limit {
        return Err(format!("it claims {expected} bytes"));
    }
    let io = |error: io::Error| error.to_string();
    // Memory grows with what comes out, not with what is claimed.
    match compression {
        "" => packed.take(expected + 1).read_to_end(bytes),
        "zstd" => zstd::stream::read::Decoder::with_buffer(packed)
            .map_err(io)?
            .take(expected + 1)
            .read_to_end(bytes),
        "lz4" => lz4_flex::frame::FrameDecoder::new(packed)
            .take(expected + 1)
            .read_to_end(bytes),
        other => {
            return Err(format!(
                "compression {:?}; none, zstd and lz4 are known",
                crate::error::seen(other.as_bytes())
            ));
        }
    }
    .map_err(io)?;
    if bytes.len() as u64 == expected {
        Ok(())
    } else {
        Err(format!(
            "it claims {expected} bytes and unpacks to {}",
            bytes.len()
        ))
    }
}
