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

    /// The identity of a network that lies in memory as its file would.
    pub fn of_bytes(name: &str, bytes: &[u8]) -> Self {
        Self {
            name: shortened(name),
            sha256: Sha256::digest(bytes).into(),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_content_is_known_by_its_hash_in_a_file_and_in_memory() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("osnet.v2.onnx");
        std::fs::write(&path, b"abc").unwrap();
        let of_file = NetworkIdentity::of_file(&path).unwrap();
        // FIPS 180-2, appendix B.1.
        let hex = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(of_file.sha256_hex(), hex);
        assert_eq!(of_file.name, "osnet.v2");
        let in_memory = NetworkIdentity::of_bytes(&"x".repeat(500), b"abc");
        assert!(in_memory.is(&of_file));
        assert_eq!(in_memory.name.len(), 100);
    }
}
