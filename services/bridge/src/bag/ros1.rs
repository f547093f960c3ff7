//! ROS 1 bags, format 2.0.
//!
//! In: records of a header (`name=value` fields) and data; messages and connections sit in chunks
//! that may be compressed with bzip2 or LZ4; index records behind a chunk say where its messages
//! are. The layout is that of the ROS wiki's "Bags/Format/2.0". Out: messages in time order over
//! all chunks, also where a bag was written one topic after another.
//!
//! Parsed here because the crate for it takes offsets and sizes from the file unchecked. A chunk
//! without its index (the recorder was killed) is unpacked once while opening to find its messages.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use hachi_hal::Stamp;

use super::ros1_records::{
    Compression, Fields, OP_CHUNK, OP_CONNECTION, OP_INDEX, OP_MESSAGE, Record, stamp, u32_at,
};
use super::{BLOCK_LIMIT, Storage, Topic};
use crate::error::BagError;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// A header holds some short fields; a connection's data the text of a message definition.
const HEADER_LIMIT: u64 = 1 << 20;
/// More connections than any robot makes; each is kept in memory.
const CONNECTION_LIMIT: usize = 100_000;
/// Unpacked chunks kept at once: enough for a bag whose topics lie in different chunks.
const CACHE_BYTES: usize = 64 << 20;

/// How often a chunk may be unpacked again, on average: well-made bags need it once or twice.
const REREADS: u64 = 32;

#[derive(Debug)]
pub(super) struct Ros1Bag {
    path: PathBuf,
    file: BufReader<File>,
    size: u64,
    topics: Vec<Topic>,
    /// Connection number to topic.
    connections: HashMap<u32, usize>,
    chunks: Vec<Chunk>,
    index: Vec<Entry>,
    next: usize,
    /// Unpacked chunks, the one used last in front.
    cache: Vec<(usize, Vec<u8>)>,
    /// How many more bytes may be unpacked: a bag whose index jumps between chunks would
    /// otherwise unpack them over and over.
    budget: u64,
    notes: Vec<String>,
}

#[derive(Debug, Clone, Copy)]
struct Chunk {
    data_at: u64,
    data_len: u32,
    compression: Compression,
    unpacked_len: u32,
    indexed: bool,
    broken: bool,
}

/// Where a message is. Ordered by time first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    stamp: Stamp,
    chunk: usize,
    offset: u32,
    connection: u32,
}

impl Ros1Bag {
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let io = |source| BagError::Io {
            doing: "open",
            path: path.to_path_buf(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let size = file.metadata().map_err(io)?.len();
        let mut bag = Self {
            path: path.to_path_buf(),
            file: BufReader::new(file),
            size,
            topics: Vec::new(),
            connections: HashMap::new(),
            chunks: Vec::new(),
            index: Vec::new(),
            next: 0,
            cache: Vec::new(),
            budget: 0,
            notes: Vec::new(),
        };
        if let Err(problem) = bag.read_records() {
            bag.notes
                .push(format!("it breaks off ({problem}): read up to there"));
        }
        let claimed = bag.chunks.iter().map(|chunk| u64::from(chunk.unpacked_len));
        bag.budget = claimed.sum::<u64>().saturating_mul(REREADS);
        bag.find_unindexed();
        bag.index.sort_unstable();
        bag.index.dedup();
        for entry in &bag.index {
            if let Some(&topic) = bag.connections.get(&entry.connection) {
                bag.topics[topic].messages += 1;
            }
        }
        Ok(bag)
    }

    /// Walks over the file's records: chunks are noted, their indices and the connections read.
    fn read_records(&mut self) -> Result<(), String> {
        let mut at = MAGIC.len() as u64;
        let mut header = Vec::new();
        let mut data = Vec::new();
        while at < self.size {
            at = self.read_block(at, HEADER_LIMIT, &mut header)?;
            let fields = Fields::parse(&header).ok_or_else(|| broken_at(at))?;
            let data_len = self.read_length(at)?;
            let data_at = at + 4;
            let end = data_at + u64::from(data_len);
            if end > self.size {
                return Err(format!(
                    "the record at byte {at} needs {data_len} bytes and {} are there",
                    self.size - data_at.min(self.size)
                ));
            }
            match fields.op {
                Some(OP_CHUNK) => self.chunks.push(Chunk {
                    data_at,
                    data_len,
                    compression: fields.compression()?,
                    unpacked_len: fields.size.ok_or_else(|| broken_at(at))?,
                    indexed: false,
                    broken: false,
                }),
                Some(OP_INDEX) => {
                    self.read_block(at, BLOCK_LIMIT, &mut data)?;
                    self.add_index(&fields, &data);
                }
                Some(OP_CONNECTION) => {
                    self.read_block(at, HEADER_LIMIT, &mut data)?;
                    self.add_connection(&fields, &data);
                }
                _ => {}
            }
            at = end;
        }
        Ok(())
    }

    fn read_length(&mut self, at: u64) -> Result<u32, String> {
        let mut bytes = [0; 4];
        self.file
            .seek(SeekFrom::Start(at))
            .and_then(|_| self.file.read_exact(&mut bytes))
            .map_err(|error| format!("{error} at byte {at}"))?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Reads a length and as many bytes, if the file has them. The position behind them.
    fn read_block(&mut self, at: u64, limit: u64, block: &mut Vec<u8>) -> Result<u64, String> {
        let length = u64::from(self.read_length(at)?);
        let end = at + 4 + length;
        if length > limit || end > self.size {
            return Err(format!(
                "a length of {length} at byte {at} of {}",
                self.size
            ));
        }
        block.resize(length as usize, 0);
        self.file
            .read_exact(block)
            .map_err(|error| format!("{error} at byte {at}"))?;
        Ok(end)
    }

    /// Index data: a time and an offset for each message of one connection in the chunk before.
    fn add_index(&mut self, fields: &Fields<'_>, data: &[u8]) {
        let Some(chunk) = self.chunks.len().checked_sub(1) else {
            return;
        };
        let Some(connection) = fields.conn else {
            return;
        };
        // An index that contradicts itself is none: the chunk is unpacked instead.
        if fields.count.map(|count| u64::from(count) * 12) != Some(data.len() as u64) {
            return;
        }
        self.chunks[chunk].indexed = true;
        for entry in data.chunks_exact(12) {
            self.index.push(Entry {
                stamp: stamp(entry),
                chunk,
                offset: u32_at(entry, 8),
                connection,
            });
        }
    }

    fn add_connection(&mut self, fields: &Fields<'_>, data: &[u8]) {
        let (Some(id), Some(about)) = (fields.conn, Fields::parse(data)) else {
            return;
        };
        // The header's topic is the one that was recorded; the data's may be a remapped name.
        let topic = Topic::new(
            fields.topic.or(about.topic).unwrap_or(""),
            about.kind,
            "ros1",
        );
        if self.connections.len() >= CONNECTION_LIMIT || self.connections.contains_key(&id) {
            return;
        }
        let same = |known: &Topic| known.name == topic.name && known.type_name == topic.type_name;
        let index = self.topics.iter().position(same).unwrap_or_else(|| {
            self.topics.push(topic);
            self.topics.len() - 1
        });
        self.connections.insert(id, index);
    }

    /// Unpacks chunks whose index is missing, or all of them where connections are missing.
    fn find_unindexed(&mut self) {
        let known = |entry: &Entry| self.connections.contains_key(&entry.connection);
        let complete = self.index.iter().all(known);
        let mut unpacked = 0_u64;
        let mut broken = 0_u64;
        for number in 0..self.chunks.len() {
            if complete && self.chunks[number].indexed {
                continue;
            }
            unpacked += 1;
            match self.unpack(number) {
                Ok(bytes) => self.scan_chunk(number, &bytes),
                Err(problem) => {
                    self.chunks[number].broken = true;
                    broken += 1;
                    // The first tells what is wrong with all.
                    if broken == 1 {
                        self.notes
                            .push(format!("chunk {number} is left out: {problem}"));
                    }
                }
            }
        }
        if broken > 1 {
            self.notes.push(format!("{broken} chunks are left out"));
        }
        if unpacked > 0 {
            self.notes.push(format!(
                "{unpacked} of {} chunks had no index and were unpacked to find their messages",
                self.chunks.len()
            ));
        }
    }

    fn scan_chunk(&mut self, number: usize, bytes: &[u8]) {
        let mut at = 0;
        while let Some(record) = Record::parse(bytes, at) {
            match (record.fields.op, record.fields.conn, record.fields.time) {
                (Some(OP_CONNECTION), ..) => self.add_connection(&record.fields, record.data),
                (Some(OP_MESSAGE), Some(connection), Some(stamp))
                    if !self.chunks[number].indexed =>
                {
                    self.index.push(Entry {
                        stamp,
                        chunk: number,
                        // Fits: a chunk's unpacked length is a u32.
                        offset: at as u32,
                        connection,
                    });
                }
                _ => {}
            }
            at = record.end;
        }
    }

    fn unpack(&mut self, number: usize) -> Result<Vec<u8>, String> {
        let chunk = self.chunks[number];
        let unpacked = u64::from(chunk.unpacked_len);
        if unpacked > BLOCK_LIMIT || u64::from(chunk.data_len) > BLOCK_LIMIT {
            return Err(format!("it claims {unpacked} bytes"));
        }
        self.budget = self
            .budget
            .checked_sub(unpacked)
            .ok_or("its messages jump between chunks too often to be read in order")?;
        let io = |error: std::io::Error| error.to_string();
        self.file.seek(SeekFrom::Start(chunk.data_at)).map_err(io)?;
        let packed = (&mut self.file).take(u64::from(chunk.data_len));
        let mut bytes = Vec::new();
        // Memory grows with what comes out, not with what is claimed.
        match chunk.compression {
            Compression::None => packed.take(unpacked + 1).read_to_end(&mut bytes),
            Compression::Bzip2 => bzip2::read::BzDecoder::new(packed)
                .take(unpacked + 1)
                .read_to_end(&mut bytes),
            Compression::Lz4 => lz4_flex::frame::FrameDecoder::new(packed)
                .take(unpacked + 1)
                .read_to_end(&mut bytes),
        }
        .map_err(io)?;
        if bytes.len() as u64 == unpacked {
            Ok(bytes)
        } else {
            Err(format!(
                "it claims {unpacked} bytes and unpacks to {}",
                bytes.len()
            ))
        }
    }

    /// Brings a chunk to the front of the cache.
    fn load(&mut self, number: usize) -> Result<(), String> {
        if let Some(place) = self.cache.iter().position(|(cached, _)| *cached == number) {
            self.cache[..=place].rotate_right(1);
            return Ok(());
        }
        let bytes = self.unpack(number)?;
        self.cache.insert(0, (number, bytes));
        let mut total = 0;
        let mut kept = 0;
        for (_, bytes) in &self.cache {
            total += bytes.len();
            if kept > 0 && total > CACHE_BYTES {
                break;
            }
            kept += 1;
        }
        self.cache.truncate(kept);
        Ok(())
    }

    fn container(&self, problem: String) -> BagError {
        BagError::Container {
            path: self.path.clone(),
            problem,
        }
    }
}

impl Storage for Ros1Bag {
    fn path(&self) -> &Path {
        &self.path
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn next(
        &mut self,
        wanted: &[bool],
        buffer: &mut Vec<u8>,
    ) -> Result<Option<(usize, Stamp)>, BagError> {
        while let Some(&entry) = self.index.get(self.next) {
            self.next += 1;
            let Some(&topic) = self.connections.get(&entry.connection) else {
                continue;
            };
            if !wanted[topic] || self.chunks[entry.chunk].broken {
                continue;
            }
            if let Err(problem) = self.load(entry.chunk) {
                self.chunks[entry.chunk].broken = true;
                return Err(self.container(format!("chunk {} is left out: {problem}", entry.chunk)));
            }
            let record = Record::parse(&self.cache[0].1, entry.offset as usize).filter(|record| {
                record.fields.op == Some(OP_MESSAGE) && record.fields.conn == Some(entry.connection)
            });
            let Some(record) = record else {
                return Err(self.container(format!(
                    "the index puts a message at byte {} of chunk {}, where there is none",
                    entry.offset, entry.chunk
                )));
            };
            buffer.clear();
            buffer.extend_from_slice(record.data);
            return Ok(Some((topic, entry.stamp)));
        }
        Ok(None)
    }
}

fn broken_at(at: u64) -> String {
    format!("a header that is none before byte {at}")
}
