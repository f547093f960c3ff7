//! Which network made a model: features of two networks can't be compared.

use std::fmt;
use std::io::Read;
use std::path::Path;

use sha2::{Digest, Sha256};

/// A network by its name and what is in its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkIdentity {
    /// The file's name without its ending.
    pub name: String,
    /// SHA-256 of the file.
    pub sha256: [u8; 32],
}

impl NetworkIdentity {
    /// The identity of the network in this file.
    ///
    /// # Errors
    /// It can't be read.
    pub fn of_file(path: &Path) -> std::io::Result<Self> {
        let mut file = std::fs::File::open(path)?;
        let mut hash = Sha256::new();
        let mut part = vec![0; 1 << 16];
        loop {
            match file.read(&mut part)? {
                0 => break,
                length => hash.update(&part[..length]),
            }
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self {
            name: shortened(&name),
            sha256: hash.finalize().into(),
        })
    }

    /// The hash in hexadecimal digits.
    pub fn sha256_hex(&self) -> String {
        hex(&self.sha256)
    }

    /// Whether it is the same network, whatever its file is called.
    pub fn is(&self, other: &Self) -> bool {
        self.sha256 == other.sha256
    }
}

impl fmt::Display for NetworkIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (sha256 {})", self.name, hex(&self.sha256[..6]))
    }
}

/// Names of files may be longer than what a model's bytes have room for.
fn shortened(name: &str) -> String {
    name.chars().take(super::codec::LONGEST_NAME).collect()
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
