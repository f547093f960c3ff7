//! MCAP files.
//!
//! With a summary whose index is sound, messages come in time order through the `mcap` crate's
//! indexed reader. Without one (a recorder that was killed) the file is walked once to list its
//! topics and once more for its messages, in the order they were written.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use hachi_hal::Stamp;
use mcap::records::{ChunkIndex, op};
use mcap::sans_io::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::{McapError, Summary};

use super::mcap_records::{Contents, Walk, message};
use super::{BLOCK_LIMIT, Storage, Topic};
use crate::error::BagError;

/// The most memory for chunks that overlap in time; beyond it they are not put in order.
const OVERLAP_LIMIT: u64 = 1 << 30;

#[derive(Debug)]
pub(super) struct McapFile {
    path: PathBuf,
    file: File,
    size: u64,
    contents: Contents,
    notes: Vec<String>,
    reader: Reader,
    chunk: Vec<u8>,
}

enum Reader {
    Indexed(Box<IndexedReader>),
    AsWritten(Walk),
    Ended,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Indexed(_) => "Indexed",
            Self::AsWritten(_) => "AsWritten",
            Self::Ended => "Ended",
        })
    }
}

impl McapFile {
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let io = |source| BagError::Io {
            doing: "open",
            path: path.to_path_buf(),
            source,
        };
        let mut file = File::open(path).map_err(io)?;
        let size = file.metadata().map_err(io)?.len();
        let summary = Contents::of_summary(&mut file, size).map_err(io)?;
        let mut mcap = Self {
            path: path.to_path_buf(),
            file,
            size,
            contents: Contents::default(),
            notes: Vec::new(),
            reader: Reader::Ended,
            chunk: Vec::new(),
        };
        let indexed = match summary {
            None => Err("it has no summary".into()),
            Some(mut contents) => mcap
                .use_index(&mut contents)
                .map(|reader| (contents, reader)),
        };
        match indexed {
            Ok((contents, reader)) => {
                mcap.contents = contents;
                mcap.reader = Reader::Indexed(Box::new(reader));
            }
            Err(problem) => {
                mcap.notes.push(format!(
                    "{problem}: its messages come in the order they were written"
                ));
                mcap.list_topics();
                mcap.reader = Reader::AsWritten(mcap.walk());
            }
        }
        Ok(mcap)
    }

    /// No record is larger than the file makes plausible: zstd reaches some hundredfold.
    fn record_limit(&self) -> u64 {
        self.size.saturating_mul(256).clamp(1 << 16, BLOCK_LIMIT)
    }

    fn walk(&self) -> Walk {
        Walk::new(self.size, self.record_limit())
    }

    /// Takes counts and order from the summary, if they can be trusted.
    fn use_index(&self, contents: &mut Contents) -> Result<IndexedReader, String> {
        let Some((messages, of_channels)) = contents.counts.take() else {
            return Err("its summary counts no messages".into());
        };
        let chunks = std::mem::take(&mut contents.chunks);
        if chunks.is_empty() && messages > 0 {
            return Err("its summary lists no chunks".into());
        }
        check_chunks(&chunks, self.size)?;
        for (channel, messages) in of_channels {
            contents.count(channel, messages);
        }
        let summary = Summary {
            chunk_indexes: chunks,
            ..Summary::default()
        };
        let limit = self.record_limit() as usize;
        let options = IndexedReaderOptions::new().with_record_length_limit(limit);
        IndexedReader::new_with_options(&summary, options)
            .map_err(|error| format!("its index is broken ({error})"))
    }

    /// Walks over the whole file for its topics and their counts.
    fn list_topics(&mut self) {
        let mut walk = self.walk();
        let mut broken = 0_u64;
        loop {
            let contents = &mut self.contents;
            let walked = walk.find::<()>(&mut self.file, |opcode, body| {
                if opcode == op::MESSAGE {
                    if let Some((channel, ..)) = message(body) {
                        contents.count(channel, 1);
                    }
                } else {
                    contents.add(opcode, body);
                }
                None
            });
            match walked {
                Ok(_) => break,
                // A broken chunk costs itself; the first tells what is wrong with all.
                Err(problem) if broken == 0 => {
                    broken += 1;
                    self.notes.push(problem);
                }
                Err(_) => broken += 1,
            }
        }
        if broken > 1 {
            self.notes
                .push(format!("{broken} of its parts are broken and left out"));
        }
    }
}

impl Storage for McapFile {
    fn path(&self) -> &Path {
        &self.path
    }

    fn topics(&self) -> &[Topic] {
        &self.contents.topics
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn next(
        &mut self,
        wanted: &[bool],
        buffer: &mut Vec<u8>,
    ) -> Result<Option<(usize, Stamp)>, BagError> {
        let channels = &self.contents.channels;
        let topic_of = |channel: u16| {
            let topic = *channels.get(&channel)?;
            wanted.get(topic)?.then_some(topic)
        };
        let found = match &mut self.reader {
            Reader::Ended => Ok(None),
            Reader::AsWritten(walk) => walk.find(&mut self.file, |opcode, body| {
                if opcode != op::MESSAGE {
                    return None;
                }
                let (channel, log_time, data) = message(body)?;
                let topic = topic_of(channel)?;
                buffer.clear();
                buffer.extend_from_slice(data);
                Some((topic, log_time))
            }),
            Reader::Indexed(reader) => {
                let found = next_indexed(
                    reader,
                    &mut self.file,
                    self.size,
                    &mut self.chunk,
                    topic_of,
                    buffer,
                );
                if found.is_err() {
                    // The reader would ask for the same chunk again.
                    self.reader = Reader::Ended;
                }
                found.map_err(|error| format!("{error}; what comes before was read"))
            }
        };
        match found {
            Ok(Some((topic, nanos))) => {
                let nanos = i64::try_from(nanos).unwrap_or(i64::MAX);
                Ok(Some((topic, Stamp::from_nanos(nanos))))
            }
            Ok(None) => Ok(None),
            Err(problem) => Err(BagError::Container {
                path: self.path.clone(),
                problem,
            }),
        }
    }
}

/// Chunks lie inside the file, each is listed once, and those that overlap fit into memory.
fn check_chunks(chunks: &[ChunkIndex], size: u64) -> Result<(), &'static str> {
    let mut offsets: Vec<u64> = Vec::new();
    let mut edges: Vec<(u64, u8, u64)> = Vec::new();
    for chunk in chunks {
        let end = chunk.chunk_start_offset.checked_add(chunk.chunk_length);
        if end.is_none_or(|end| end > size) || chunk.compressed_size > chunk.chunk_length {
            return Err("its index points outside the file");
        }
        offsets.push(chunk.chunk_start_offset);
        edges.push((chunk.message_start_time, 0, chunk.uncompressed_size));
        edges.push((chunk.message_end_time, 1, chunk.uncompressed_size));
    }
    offsets.sort_unstable();
    if offsets.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err("its index lists a chunk twice");
    }
    edges.sort_unstable();
    let mut open = 0_u64;
    for (_, edge, bytes) in edges {
        open = match edge {
            0 => open.saturating_add(bytes),
            _ => open.saturating_sub(bytes),
        };
        if open > OVERLAP_LIMIT {
            return Err("too many of its chunks overlap in time");
        }
    }
    Ok(())
}

fn next_indexed(
    reader: &mut IndexedReader,
    file: &mut File,
    size: u64,
    chunk: &mut Vec<u8>,
    topic_of: impl Fn(u16) -> Option<usize>,
    buffer: &mut Vec<u8>,
) -> Result<Option<(usize, u64)>, McapError> {
    loop {
        let (offset, length) = match reader.next_event().transpose()? {
            None => return Ok(None),
            Some(IndexedReadEvent::ReadChunkRequest { offset, length }) => (offset, length),
            Some(IndexedReadEvent::Message { header, data }) => {
                if let Some(topic) = topic_of(header.channel_id) {
                    buffer.clear();
                    buffer.extend_from_slice(data);
                    return Ok(Some((topic, header.log_time)));
                }
                continue;
            }
        };
        if offset
            .checked_add(length as u64)
            .is_none_or(|end| end > size)
        {
            return Err(McapError::UnexpectedEof);
        }
        file.seek(SeekFrom::Start(offset))?;
        chunk.resize(length, 0);
        file.read_exact(chunk)?;
        reader.insert_chunk_record_data(offset, chunk)?;
    }
}
