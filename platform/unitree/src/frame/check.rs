//! The check value at the end of every frame, plain and transformed.
//!
//! CRC over little-endian 32-bit words, most significant bit first: polynomial 0x04C11DB7, start
//! 0xFFFFFFFF, no reflection, no final inversion. Bytes after the last whole counted word are not
//! covered.

/// Which form of the check value a frame carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum CheckForm {
    /// The CRC as it is. What hosts send, and robots at low level.
    #[default]
    Plain,
    /// The CRC exclusive-or a constant, then rotated. What a Go1 sends at high level.
    Transformed,
}

const POLYNOMIAL: u32 = 0x04C1_1DB7;
/// What a transformed check value is mixed with.
const MASK: u32 = 0xEDCA_B9DE;

/// Remainders of each byte in the top eight bits.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u32) << 24;
        let mut bit = 0;
        while bit < 8 {
            let carry = crc & 0x8000_0000 != 0;
            crc <<= 1;
            if carry {
                crc ^= POLYNOMIAL;
            }
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// The plain check value of all whole words of `bytes`; up to three bytes at the end are not
/// covered.
pub fn check_value(bytes: &[u8]) -> u32 {
    let words = bytes.chunks_exact(4);
    words
        .flat_map(|word| word.iter().rev())
        .fold(u32::MAX, |crc, byte| {
            (crc << 8) ^ TABLE[((crc >> 24) as u8 ^ byte) as usize]
        })
}

/// The plain check value of a frame whose last four bytes hold it: `(len / 4 - 1)` words from the
/// front.
pub fn check_value_of_frame(frame: &[u8]) -> u32 {
    let words = (frame.len() / 4).saturating_sub(1);
    check_value(&frame[..words * 4])
}

/// A plain check value as it is transformed for the wire.
pub const fn transform(plain: u32) -> u32 {
    (plain ^ MASK).rotate_right(8)
}

/// The inverse of [`transform`].
pub const fn restore(transformed: u32) -> u32 {
    transformed.rotate_left(8) ^ MASK
}

impl CheckForm {
    /// A plain check value in this form.
    pub const fn of(self, plain: u32) -> u32 {
        match self {
            Self::Plain => plain,
            Self::Transformed => transform(plain),
        }
    }
}
