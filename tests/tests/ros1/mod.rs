//! Messages of a ROS 1 bag as bytes, whatever their type: enough for recordings of cameras that are
//! trusted. The reader for recordings that are not is `hachi-bridge`'s.

use std::collections::HashMap;
use std::io::Read;

/// A message as it was recorded.
pub struct Message {
    pub topic: String,
    pub data: Vec<u8>,
}

/// Fields of one record's header, and its data.
type Record<'a> = (HashMap<String, Vec<u8>>, &'a [u8]);

fn records(bytes: &[u8]) -> Vec<Record<'_>> {
    let mut rest = bytes;
    let mut block = || {
        let (len, after) = rest.split_first_chunk::<4>()?;
        let (block, after) = after.split_at(u32::from_le_bytes(*len) as usize);
        rest = after;
        Some(block)
    };
    let mut found = Vec::new();
    while let (Some(header), Some(data)) = (block(), block()) {
        found.push((fields(header), data));
    }
    found
}

fn fields(mut header: &[u8]) -> HashMap<String, Vec<u8>> {
    let mut fields = HashMap::new();
    while let Some((len, after)) = header.split_first_chunk::<4>() {
        let (field, after) = after.split_at(u32::from_le_bytes(*len) as usize);
        let equals = field.iter().position(|&b| b == b'=').unwrap();
        let name = String::from_utf8(field[..equals].to_vec()).unwrap();
        fields.insert(name, field[equals + 1..].to_vec());
        header = after;
    }
    fields
}

/// All messages, in the order in which they were written.
pub fn messages(bag: &[u8]) -> Vec<Message> {
    const MAGIC: usize = b"#ROSBAG V2.0\n".len();
    let (mut topics, mut messages) = (HashMap::new(), Vec::new());
    for (header, data) in records(&bag[MAGIC..]) {
        if header["op"] != [5] {
            continue;
        }
        let mut chunk = Vec::new();
        lz4_flex::frame::FrameDecoder::new(data)
            .read_to_end(&mut chunk)
            .unwrap();
        for (mut header, data) in records(&chunk) {
            match header["op"][0] {
                7 => {
                    let topic = String::from_utf8(header["topic"].clone()).unwrap();
                    topics.insert(header.remove("conn").unwrap(), topic);
                }
                2 => messages.push(Message {
                    topic: topics[&header["conn"]].clone(),
                    data: data.to_vec(),
                }),
                _ => {}
            }
        }
    }
    messages
}

/// The only message whose topic has both parts.
pub fn one<'a>(messages: &'a [Message], part: &str, end: &str) -> &'a Message {
    let fits = |m: &&Message| m.topic.contains(part) && m.topic.ends_with(end);
    let mut found = messages.iter().filter(fits);
    let message = found.next().unwrap();
    assert!(found.next().is_none(), "{part} {end} is not one topic");
    message
}

/// Values of a message, one after the other.
pub struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    /// Behind a `std_msgs/Header`.
    pub fn after_header(data: &'a [u8]) -> Self {
        let mut reader = Self(data);
        reader.skip(12);
        reader.string();
        reader
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (value, rest) = self.0.split_first_chunk().unwrap();
        self.0 = rest;
        *value
    }

    pub fn skip(&mut self, len: usize) {
        self.0 = &self.0[len..];
    }

    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    pub fn bytes(&mut self) -> Vec<u8> {
        let len = self.u32() as usize;
        let (bytes, rest) = self.0.split_at(len);
        self.0 = rest;
        bytes.to_vec()
    }

    pub fn string(&mut self) -> String {
        String::from_utf8(self.bytes()).unwrap()
    }
}
