//! Recordings: messages of ROS 1 and ROS 2 bags, in the order in which they were recorded.
//!
//! In: a `.bag` (ROS 1, format 2.0), a `.db3` (ROS 2, SQLite), an `.mcap`, or the folder that
//! `ros2 bag record` makes. Out: a [`Message`] at a time, borrowing a buffer that is reused.
//! Types that are not read here are listed with their counts in [`Bag::topics`].
//!
//! Files are opened for reading alone and never locked or changed. A recording that was cut off is
//! read up to the cut: [`Bag::notes`] says so. Messages come in time order across topics; only an
//! MCAP file without a usable index comes in the order it was written.

mod db3;
mod folder;
mod mcap_file;
mod mcap_records;
mod packets;
mod ros1;
mod ros1_records;
mod scans;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hachi_hal::Stamp;

pub use packets::BagPackets;
pub use scans::BagScans;

use crate::error::BagError;
use crate::input::{Input, InputKind};
use crate::message::{self, Body, Encoding, MessageKind};

/// The most bytes one message or one chunk may have. Real ones stay below some ten megabytes.
pub(crate) const BLOCK_LIMIT: u64 = 256 << 20;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Its type as the recording writes it.
    pub type_name: String,
    /// How many messages the recording holds.
    pub messages: u64,
    /// What it is read as; `None` for types that are not read here.
    pub kind: Option<MessageKind>,
    /// How its messages became bytes.
    pub encoding: Encoding,
}

impl Topic {
    /// A topic without messages yet. `encoding` is as the recording names it.
    fn new(name: &str, type_name: &str, encoding: &str) -> Self {
        let known = match encoding {
            "cdr" => Some(Encoding::Cdr),
            "ros1" => Some(Encoding::Ros1),
            _ => None,
        };
        Self {
            name: name.into(),
            type_name: type_name.into(),
            messages: 0,
            kind: known.and_then(|_| MessageKind::from_type_name(type_name)),
            encoding: known.unwrap_or(Encoding::Cdr),
        }
    }
}

/// A message of a recording.
#[derive(Debug, Clone)]
pub struct Message<'a> {
    /// The topic it was on.
    pub topic: &'a Topic,
    /// When it was recorded.
    pub stamp: Stamp,
    /// What it says.
    pub body: Body<'a>,
}

/// One file of a recording.
trait Storage: std::fmt::Debug + Send {
    fn path(&self) -> &Path;
    fn topics(&self) -> &[Topic];
    fn notes(&self) -> &[String];
    /// The next message on a topic that is wanted, its bytes into `buffer`: topic and record time.
    /// Makes progress also where it fails: asked often enough, it says `None`.
    fn next(
        &mut self,
        wanted: &[bool],
        buffer: &mut Vec<u8>,
    ) -> Result<Option<(usize, Stamp)>, BagError>;
}

#[derive(Debug)]
struct File {
    storage: Box<dyn Storage>,
    /// This file's topics among the bag's.
    topics: Vec<usize>,
    wanted: Vec<bool>,
}

/// A recording, open for reading.
#[derive(Debug)]
pub struct Bag {
    path: PathBuf,
    files: Vec<File>,
    current: usize,
    topics: Vec<Topic>,
    notes: Vec<String>,
    buffer: Vec<u8>,
}

impl Bag {
    /// Opens a recording, whatever its format. The index is built here: for files without one
    /// this reads the whole file.
    ///
    /// # Errors
    /// [`BagError`] where the path cannot be read or holds no recording.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, BagError> {
        let path = path.as_ref();
        let input = Input::recognise(path)?;
        let files = match input.kind {
            InputKind::BagFolder => folder::files(path)?,
            _ => vec![path.to_path_buf()],
        };
        let mut bag = Self {
            path: path.to_path_buf(),
            files: Vec::new(),
            current: 0,
            topics: Vec::new(),
            notes: Vec::new(),
            buffer: Vec::new(),
        };
        for file in files {
            bag.add(open_file(&file)?);
        }
        Ok(bag)
    }

    fn add(&mut self, storage: Box<dyn Storage>) {
        let mut topics = Vec::new();
        for topic in storage.topics() {
            let same = |known: &Topic| {
                known.name == topic.name
                    && known.type_name == topic.type_name
                    && known.encoding == topic.encoding
            };
            match self.topics.iter().position(same) {
                Some(index) => {
                    self.topics[index].messages += topic.messages;
                    topics.push(index);
                }
                None => {
                    topics.push(self.topics.len());
                    self.topics.push(topic.clone());
                }
            }
        }
        let wanted = storage.topics().iter().map(|t| t.kind.is_some()).collect();
        let file = storage.path().display().to_string();
        self.notes
            .extend(storage.notes().iter().map(|note| format!("{file}: {note}")));
        self.files.push(File {
            storage,
            topics,
            wanted,
        });
    }

    /// The path it was opened at.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All topics, also those whose type is not read here.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// What a user should know: a recording that was cut off, an index that was missing.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Reads only the topics for which `keep` holds from here on. Types that are not read here
    /// stay left out.
    pub fn retain(&mut self, keep: impl Fn(&Topic) -> bool) {
        for file in &mut self.files {
            for (wanted, &topic) in file.wanted.iter_mut().zip(&file.topics) {
                *wanted &= keep(&self.topics[topic]);
            }
        }
    }

    /// The next message, oldest first; `None` at the end.
    ///
    /// # Errors
    /// A broken message costs that message and a broken chunk that chunk: the next call goes on
    /// behind it.
    pub fn next_message(&mut self) -> Result<Option<Message<'_>>, BagError> {
        let (topic, stamp) = loop {
            let Some(file) = self.files.get_mut(self.current) else {
                return Ok(None);
            };
            match file.storage.next(&file.wanted, &mut self.buffer)? {
                Some((topic, stamp)) => break (&self.topics[file.topics[topic]], stamp),
                None => self.current += 1,
            }
        };
        let Some(kind) = topic.kind else {
            // Unwanted topics are not handed out.
            return Ok(None);
        };
        let body = message::decode(kind, topic.encoding, &self.buffer).map_err(|source| {
            BagError::Message {
                path: self.path.clone(),
                topic: topic.name.clone(),
                stamp,
                source,
            }
        })?;
        Ok(Some(Message { topic, stamp, body }))
    }

    /// The topic with the most messages among those that carry what is asked for.
    fn busiest(
        &self,
        wanted: &'static str,
        carries: impl Fn(MessageKind) -> bool,
    ) -> Result<usize, BagError> {
        let fits = |topic: &&(usize, &Topic)| topic.1.kind.is_some_and(&carries);
        let topics: Vec<_> = self.topics.iter().enumerate().collect();
        // The first of equals: `max_by_key` would give the last.
        topics
            .iter()
            .rev()
            .filter(fits)
            .max_by_key(|(_, topic)| topic.messages)
            .map(|&(index, _)| index)
            .ok_or_else(|| BagError::NoTopic {
                path: self.path.clone(),
                wanted,
                seen: self.contents(),
            })
    }

    /// Types and how many messages of each, in one line, the most frequent first.
    fn contents(&self) -> String {
        const SHOWN: usize = 12;
        let mut types: BTreeMap<&str, u64> = BTreeMap::new();
        for topic in &self.topics {
            *types.entry(&topic.type_name).or_default() += topic.messages;
        }
        let mut types: Vec<_> = types.into_iter().collect();
        types.sort_by_key(|&(_, messages)| std::cmp::Reverse(messages));
        let mut shown: Vec<_> = types
            .iter()
            .take(SHOWN)
            .map(|(name, messages)| format!("{messages} {name}"))
            .collect();
        if types.len() > SHOWN {
            shown.push(format!("{} more types", types.len() - SHOWN));
        }
        if shown.is_empty() {
            "nothing".into()
        } else {
            shown.join(", ")
        }
    }
}

fn open_file(path: &Path) -> Result<Box<dyn Storage>, BagError> {
    Ok(match Input::recognise(path)?.kind {
        InputKind::Ros1Bag => Box::new(ros1::Ros1Bag::open(path)?),
        InputKind::Db3 => Box::new(db3::Db3::open(path)?),
        InputKind::Mcap => Box::new(mcap_file::McapFile::open(path)?),
        other => {
            return Err(BagError::Container {
                path: path.to_path_buf(),
                problem: format!(
                    "this is {}, no recording: .bag, .db3, .mcap or a ROS 2 bag folder is",
                    other.description()
                ),
            });
        }
    })
}
