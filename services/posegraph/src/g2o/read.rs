//! Reading g2o files, line by line.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, BufRead};

use super::line::{self, Line, LineProblem, Stored};
use super::{Contents, Document, Repairs};
use crate::factor::Factor;
use crate::group::{Dense, Se2, Se3};

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Reading failed.
    #[error("line {line} can't be read: {source}")]
    Io {
        /// After how many lines, and one.
        line: u64,
        /// Why.
        source: io::Error,
    },
    /// A line can't be understood.
    #[error("line {line}: {problem}")]
    Line {
        /// Counted from 1.
        line: u64,
        /// What is wrong with it.
        problem: LineProblem,
    },
    /// There is neither a pose nor an edge.
    #[error("no pose and no edge in {lines} lines")]
    Empty {
        /// Lines that were read.
        lines: u64,
    },
}

/// No line of such a file comes near: an edge in space has 31 words.
const LONGEST_LINE: usize = 1 << 14;
/// Tags that are told apart in [`Repairs::unknown_tags`].
const MOST_TAGS: usize = 32;

/// Reads a file. Lines may end in CRLF; `#` begins a comment.
///
/// # Errors
/// The first line that can't be understood, by its number.
pub fn read(mut input: impl BufRead) -> Result<Document, ReadError> {
    let mut reader = Reader::default();
    let mut bytes = Vec::new();
    let mut line = 0;
    while next_line(&mut input, &mut bytes, line + 1)? {
        line += 1;
        let text = String::from_utf8_lossy(&bytes);
        let read = reader.line(&text);
        read.map_err(|problem| ReadError::Line { line, problem })?;
    }
    reader.finish(line)
}

/// The next line without its end; false if there is none.
fn next_line(input: &mut impl BufRead, bytes: &mut Vec<u8>, line: u64) -> Result<bool, ReadError> {
    bytes.clear();
    loop {
        let part = match input.fill_buf() {
            Ok(part) => part,
            Err(source) if source.kind() == io::ErrorKind::Interrupted => continue,
            Err(source) => return Err(ReadError::Io { line, source }),
        };
        if part.is_empty() {
            return Ok(!bytes.is_empty());
        }
        let end = part.iter().position(|&b| b == b'\n');
        let used = end.map_or(part.len(), |end| end + 1);
        if bytes.len() + used > LONGEST_LINE {
            let limit = LONGEST_LINE;
            let problem = LineProblem::TooLong { limit };
            return Err(ReadError::Line { line, problem });
        }
        bytes.extend_from_slice(&part[..used]);
        input.consume(used);
        if end.is_some() {
            return Ok(true);
        }
    }
}

#[derive(Default)]
struct Reader {
    plane: Option<Collected<Se2>>,
    space: Option<Collected<Se3>>,
    fixed: Vec<u64>,
    repairs: Repairs,
}

struct Collected<G: Stored> {
    began: &'static str,
    vertices: Vec<(u64, G)>,
    keys: HashSet<u64>,
    edges: Vec<Factor<G>>,
    seen: HashSet<u64>,
}

impl Reader {
    fn line(&mut self, text: &str) -> Result<(), LineProblem> {
        let words: Vec<&str> = line::words(text).collect();
        let Some((&tag, rest)) = words.split_first() else {
            return Ok(());
        };
        match tag {
            Se2::VERTEX => self.plane(Se2::VERTEX, line::vertex(rest)?),
            Se2::EDGE => self.plane(Se2::EDGE, line::edge(rest)?),
            Se3::VERTEX => self.space(Se3::VERTEX, line::vertex(rest)?),
            Se3::EDGE => self.space(Se3::EDGE, line::edge(rest)?),
            "FIX" => {
                for word in rest {
                    self.fixed.push(line::key(word)?);
                }
                Ok(())
            }
            other => {
                self.unknown(other);
                Ok(())
            }
        }
    }

    fn plane(&mut self, tag: &'static str, line: Line<Se2>) -> Result<(), LineProblem> {
        if let Some(other) = &self.space {
            let began = other.began;
            return Err(LineProblem::OtherSpace { tag, began });
        }
        let collected = self.plane.get_or_insert_with(|| Collected::new(tag));
        collected.add(line, &mut self.repairs);
        Ok(())
    }

    fn space(&mut self, tag: &'static str, line: Line<Se3>) -> Result<(), LineProblem> {
        if let Some(other) = &self.plane {
            let began = other.began;
            return Err(LineProblem::OtherSpace { tag, began });
        }
        let collected = self.space.get_or_insert_with(|| Collected::new(tag));
        collected.add(line, &mut self.repairs);
        Ok(())
    }

    fn unknown(&mut self, tag: &str) {
        let tags = &mut self.repairs.unknown_tags;
        let mut tag = line::cut_short(tag);
        if !tags.contains_key(&tag) && tags.len() >= MOST_TAGS {
            tag = "...".to_owned();
        }
        *tags.entry(tag).or_default() += 1;
    }

    fn finish(self, lines: u64) -> Result<Document, ReadError> {
        let Self {
            plane,
            space,
            fixed,
            repairs,
        } = self;
        match (plane, space) {
            (Some(plane), _) => Ok(Document::Plane(plane.contents(fixed, repairs))),
            (None, Some(space)) => Ok(Document::Space(space.contents(fixed, repairs))),
            (None, None) => Err(ReadError::Empty { lines }),
        }
    }
}

impl<G: Stored> Collected<G> {
    fn new(began: &'static str) -> Self {
        Self {
            began,
            vertices: Vec::new(),
            keys: HashSet::new(),
            edges: Vec::new(),
            seen: HashSet::new(),
        }
    }

    fn add(&mut self, line: Line<G>, repairs: &mut Repairs) {
        match line {
            Line::Vertex(key, pose, scaled) => {
                repairs.scaled_quaternions += usize::from(scaled);
                if self.keys.insert(key) {
                    self.vertices.push((key, pose));
                } else {
                    repairs.duplicate_vertices += 1;
                }
            }
            Line::Edge(factor, scaled, clipped) => {
                repairs.scaled_quaternions += usize::from(scaled);
                repairs.clipped_information += usize::from(clipped);
                if !self.seen.insert(fingerprint(&factor)) {
                    repairs.duplicate_edges += 1;
                }
                self.edges.push(factor);
            }
        }
    }

    fn contents(self, fixed: Vec<u64>, repairs: Repairs) -> Contents<G> {
        Contents {
            vertices: self.vertices,
            edges: self.edges,
            fixed,
            repairs,
        }
    }
}

/// A hash of everything an edge says: two different edges of a million share one with a chance of
/// one in ten million, and then a count is off by one.
fn fingerprint<G: Stored>(factor: &Factor<G>) -> u64 {
    let mut hasher = DefaultHasher::new();
    (factor.from(), factor.to()).hash(&mut hasher);
    for v in factor.measured().to_numbers() {
        v.to_bits().hash(&mut hasher);
    }
    for v in factor.information().numbers() {
        v.to_bits().hash(&mut hasher);
    }
    hasher.finish()
}
