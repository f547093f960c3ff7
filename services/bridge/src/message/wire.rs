//! Reads values off the bytes of a ROS message.
//!
//! ROS 2 messages are CDR (the OMG's encapsulation, XCDR version 1, and plain version 2): four
//! bytes of encapsulation, then values aligned to their size counted from behind those four; a
//! string's length includes its closing zero. ROS 1 messages are packed little-endian; a string's
//! length has no zero to count.

use hachi_hal::Stamp;

use super::Encoding;
use crate::error::DecodeError;

/// A position in a message's bytes.
#[derive(Debug, Clone)]
pub(crate) struct Wire<'a> {
    /// Behind the encapsulation.
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Values are aligned to their size, but no further than this. 1: packed.
    max_align: usize,
    ros1: bool,
}

/// What every stamped ROS message begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Header<'a> {
    pub(crate) stamp: Stamp,
    /// Empty where it is no text.
    pub(crate) frame_id: &'a str,
}

impl<'a> Wire<'a> {
    pub(crate) fn new(encoding: Encoding, message: &'a [u8]) -> Result<Self, DecodeError> {
        if encoding == Encoding::Ros1 {
            return Ok(Self {
                bytes: message,
                at: 0,
                big_endian: false,
                max_align: 1,
                ros1: true,
            });
        }
        let (head, bytes) = message.split_at_checked(4).ok_or(DecodeError::Truncated {
            at: 0,
            needed: 4,
            left: message.len(),
        })?;
        // RTPS 2.5, table 10.4: plain CDR 0 and 1, plain CDR2 6 and 7; the low bit says little.
        let max_align = match (head[0], head[1]) {
            (0, 0 | 1) => 8,
            (0, 6 | 7) => 4,
            (first, second) => {
                return Err(DecodeError::Encapsulation {
                    got: [first, second],
                });
            }
        };
        Ok(Self {
            bytes,
            at: 0,
            big_endian: head[1] & 1 == 0,
            max_align,
            ros1: false,
        })
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], DecodeError> {
        let taken = self
            .at
            .checked_add(count)
            .and_then(|end| self.bytes.get(self.at..end))
            .ok_or(DecodeError::Truncated {
                at: self.at,
                needed: count as u64,
                left: self.left(),
            })?;
        self.at += count;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let align = N.min(self.max_align);
        let padding = self.at.next_multiple_of(align) - self.at;
        self.take(padding)?;
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, DecodeError> {
        self.number().map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, DecodeError> {
        self.number().map(u32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Result<f64, DecodeError> {
        self.number().map(f64::from_le_bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], DecodeError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// How many elements follow, refused if they cannot fit into what is left.
    pub(crate) fn length(&mut self, smallest_element: usize) -> Result<usize, DecodeError> {
        let claimed = self.u32()?;
        let needed = u64::from(claimed).saturating_mul(smallest_element as u64);
        if needed > self.left() as u64 {
            return Err(DecodeError::Truncated {
                at: self.at,
                needed,
                left: self.left(),
            });
        }
        // Fits: it is not above `left`.
        Ok(claimed as usize)
    }

    /// A sequence of bytes.
    pub(crate) fn byte_sequence(&mut self) -> Result<&'a [u8], DecodeError> {
        let length = self.length(1)?;
        self.take(length)
    }

    /// A string; empty where its bytes are no text.
    pub(crate) fn string(&mut self) -> Result<&'a str, DecodeError> {
        let bytes = self.byte_sequence()?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Ok(std::str::from_utf8(bytes).unwrap_or_default())
    }

    pub(crate) fn stamp(&mut self) -> Result<Stamp, DecodeError> {
        let seconds = self.u32()?;
        let nanos = self.u32()?;
        // ROS 2 counts seconds signed, ROS 1 unsigned.
        let seconds = if self.ros1 {
            i64::from(seconds)
        } else {
            i64::from(seconds.cast_signed())
        };
        Ok(Stamp::from_nanos(seconds * 1_000_000_000).offset(i64::from(nanos)))
    }

    pub(crate) fn header(&mut self) -> Result<Header<'a>, DecodeError> {
        if self.ros1 {
            // `seq`, which ROS 2 dropped.
            self.u32()?;
        }
        Ok(Header {
            stamp: self.stamp()?,
            frame_id: self.string()?,
        })
    }
}
