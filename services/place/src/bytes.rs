//! Numbers to bytes and back, little-endian, every length checked before it is used.

use crate::profile::ProfileError;

/// Why stored bytes can't be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unreadable {
    /// They begin with something else.
    #[error("these bytes are not {expected}: they begin with {got:02x?}")]
    Magic {
        /// What was looked for.
        expected: &'static str,
        /// The first bytes.
        got: [u8; 4],
    },
    /// They end too early.
    #[error("cut short: {needed} bytes needed at byte {at}, {left} left")]
    CutShort {
        /// Where.
        at: usize,
        /// How many were needed.
        needed: usize,
        /// How many there are.
        left: usize,
    },
    /// Something follows the end.
    #[error("{0} bytes too many")]
    TooLong(usize),
    /// A number that names something names nothing known: written by a newer version, or damaged.
    #[error("{name} {got} is not known to this version")]
    Code {
        /// What it names.
        name: &'static str,
        /// The number.
        got: u8,
    },
    /// A value out of its range.
    #[error("{name} has a value it can't have: the bytes are damaged")]
    Number {
        /// Which.
        name: &'static str,
    },
    /// An id twice.
    #[error("id {0} is there twice: the bytes are damaged")]
    Twice(u64),
    /// A grid that is none.
    #[error(transparent)]
    Profile(#[from] ProfileError),
}

/// Bytes being written.
#[derive(Debug, Default)]
pub(crate) struct Writer(Vec<u8>);

impl Writer {
    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }
    pub(crate) fn u8(&mut self, value: u8) {
        self.0.push(value);
    }
    pub(crate) fn u16(&mut self, value: u16) {
        self.bytes(&value.to_le_bytes());
    }
    pub(crate) fn i16(&mut self, value: i16) {
        self.bytes(&value.to_le_bytes());
    }
    pub(crate) fn u32(&mut self, value: u32) {
        self.bytes(&value.to_le_bytes());
    }
    pub(crate) fn u64(&mut self, value: u64) {
        self.bytes(&value.to_le_bytes());
    }
    pub(crate) fn f32(&mut self, value: f32) {
        self.bytes(&value.to_le_bytes());
    }
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

/// Bytes being read.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    left: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { left: bytes, at: 0 }
    }

    /// That so many bytes are there, before anything is made to hold them.
    pub(crate) fn expect(&self, needed: usize) -> Result<(), Unreadable> {
        if self.left.len() < needed {
            return Err(Unreadable::CutShort {
                at: self.at,
                needed,
                left: self.left.len(),
            });
        }
        Ok(())
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Unreadable> {
        self.expect(N)?;
        let mut out = [0; N];
        let (taken, left) = self.left.split_at(N);
        out.copy_from_slice(taken);
        self.left = left;
        self.at += N;
        Ok(out)
    }

    pub(crate) fn magic(
        &mut self,
        magic: &[u8; 4],
        expected: &'static str,
    ) -> Result<(), Unreadable> {
        let got = self.take()?;
        if &got != magic {
            return Err(Unreadable::Magic { expected, got });
        }
        Ok(())
    }
    pub(crate) fn u8(&mut self) -> Result<u8, Unreadable> {
        Ok(u8::from_le_bytes(self.take()?))
    }
    pub(crate) fn u16(&mut self) -> Result<u16, Unreadable> {
        Ok(u16::from_le_bytes(self.take()?))
    }
    pub(crate) fn i16(&mut self) -> Result<i16, Unreadable> {
        Ok(i16::from_le_bytes(self.take()?))
    }
    pub(crate) fn u32(&mut self) -> Result<u32, Unreadable> {
        Ok(u32::from_le_bytes(self.take()?))
    }
    pub(crate) fn u64(&mut self) -> Result<u64, Unreadable> {
        Ok(u64::from_le_bytes(self.take()?))
    }
    pub(crate) fn f32(&mut self) -> Result<f32, Unreadable> {
        Ok(f32::from_le_bytes(self.take()?))
    }

    /// That nothing is left.
    pub(crate) fn end(&self) -> Result<(), Unreadable> {
        match self.left.len() {
            0 => Ok(()),
            left => Err(Unreadable::TooLong(left)),
        }
    }
}
