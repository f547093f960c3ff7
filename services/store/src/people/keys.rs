//! The key file: one key for each person, mode 0600.
//!
//! In and out: text. The first line names the store that it belongs to, then one line a person (number,
//! 64 hexadecimal digits), then `end`. A change writes a new file beside it, brings that to the disk,
//! renames it, and overwrites the old one's bytes: a reader sees the old keys or the new ones, and a key
//! that was taken out is in no file.
//!
//! Whoever changes the file holds the store's write lock.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use zeroize::Zeroizing;

use super::PeopleError;
use super::network::hex;
use super::seal::Key;

const HEADING: &str = "hachi people keys 1 ";
const END: &str = "end";
/// Far more than all keys together.
const MOST_BYTES: u64 = 1 << 20;
/// A file that is replaced while it is read may be caught when its old bytes are overwritten; the
/// next time it is the new one.
const ATTEMPTS: usize = 3;
/// The owner alone.
const MODE: u32 = 0o600;

/// The keys of everybody in a store.
pub(super) struct KeyRing {
    /// Which store it belongs to.
    pub(super) id: [u8; 16],
    /// A key for each person's number.
    pub(super) keys: BTreeMap<i64, Key>,
}

impl KeyRing {
    /// The keys of a new store.
    pub(super) fn new() -> Result<Self, getrandom::Error> {
        let mut id = [0; 16];
        getrandom::fill(&mut id)?;
        Ok(Self {
            id,
            keys: BTreeMap::new(),
        })
    }

    /// Reads a key file; `None` if there is none.
    pub(super) fn read(path: &Path) -> Result<Option<Self>, PeopleError> {
        let mut read = Self::read_once(path);
        for _ in 1..ATTEMPTS {
            if !matches!(read, Err(PeopleError::DamagedKeys { .. })) {
                break;
            }
            read = Self::read_once(path);
        }
        read
    }

    fn read_once(path: &Path) -> Result<Option<Self>, PeopleError> {
        let problem = |error: io::Error| PeopleError::of_system(path, &error);
        let file = match File::open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(problem(error)),
        };
        let damaged = |what: String| PeopleError::DamagedKeys {
            key: path.to_owned(),
            what,
        };
        let about = file.metadata().map_err(problem)?;
        if !about.is_file() {
            return Err(damaged("it is no file".to_owned()));
        }
        let mode = about.permissions().mode() & 0o777;
        if mode & 0o077 != 0 {
            return Err(PeopleError::ExposedKeys {
                key: path.to_owned(),
                mode,
            });
        }
        let mut text = Zeroizing::new(String::new());
        match file.take(MOST_BYTES).read_to_string(&mut text) {
            Ok(_) => Self::parse(&text).map_err(damaged).map(Some),
            Err(error) if error.kind() == io::ErrorKind::InvalidData => {
                Err(damaged("it is no text".to_owned()))
            }
            Err(error) => Err(problem(error)),
        }
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        let id = lines.next().and_then(|line| line.strip_prefix(HEADING));
        let id = id.ok_or("its first line is another program's")?;
        let id = digits(id).ok_or("its first line breaks off")?;
        let mut keys = BTreeMap::new();
        for (number, line) in lines.by_ref().enumerate() {
            if line == END {
                return Ok(Self { id, keys });
            }
            let key = line.split_once(' ').and_then(|(person, key)| {
                Some((person.parse().ok()?, Key::from_bytes(digits(key)?)))
            });
            let (person, key) = key.ok_or_else(|| format!("line {} is no key", number + 2))?;
            keys.insert(person, key);
        }
        Err("it is cut short".to_owned())
    }

    /// Replaces the key file by these keys; the old bytes are overwritten.
    pub(super) fn write(&self, path: &Path) -> Result<(), PeopleError> {
        // A link to another disk stays one.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        self.replace(&path)
            .map_err(|error| PeopleError::of_system(&path, &error))
    }

    fn replace(&self, path: &Path) -> io::Result<()> {
        let mut text = Zeroizing::new(String::with_capacity(64 + 96 * self.keys.len()));
        // Writing to a string can't fail.
        let _ = writeln!(text, "{HEADING}{}", hex(&self.id));
        for (person, key) in &self.keys {
            let key = Zeroizing::new(hex(key.bytes()));
            let _ = writeln!(text, "{person} {}", *key);
        }
        let _ = writeln!(text, "{END}");

        let new = beside(path);
        // Of a change that was interrupted: its keys may be taken out one day, and nobody would find
        // these bytes again.
        discard(&new)?;
        if let Err(error) = write_new(&new, text.as_bytes()) {
            // On a full disk; where even that fails, the next change removes it.
            let _ = discard(&new);
            return Err(error);
        }
        let old = match OpenOptions::new().write(true).open(path) {
            Ok(old) => Some(old),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        fs::rename(&new, path)?;
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
        match old {
            Some(old) => overwrite(old),
            None => Ok(()),
        }
    }
}

/// Where a new key file is written before it takes the old one's place.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    PathBuf::from(name)
}

/// A file of ours alone, on the disk when this is done.
fn write_new(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut options = OpenOptions::new();
    let mut file = options.write(true).create_new(true).mode(MODE).open(path)?;
    file.write_all(content)?;
    file.sync_all()
}

/// Overwrites and removes a file, if there is one; of a link the link alone.
fn discard(path: &Path) -> io::Result<()> {
    let about = match fs::symlink_metadata(path) {
        Ok(about) => about,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    if about.is_file() {
        overwrite(OpenOptions::new().write(true).open(path)?)?;
    }
    fs::remove_file(path)
}

/// Nothing instead of what a file holds, on the disk as far as its file system writes in place.
fn overwrite(mut file: File) -> io::Result<()> {
    let length = file.metadata()?.len().min(MOST_BYTES);
    file.write_all(&vec![0; length as usize])?;
    file.sync_all()
}

/// Bytes from hexadecimal digits.
fn digits<const N: usize>(text: &str) -> Option<[u8; N]> {
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    if pairs.len() != N || !rest.is_empty() {
        return None;
    }
    let digit = |byte: u8| char::from(byte).to_digit(16);
    let mut bytes = [0; N];
    for (byte, [high, low]) in bytes.iter_mut().zip(pairs) {
        *byte = (16 * digit(*high)? + digit(*low)?) as u8;
    }
    Some(bytes)
}
