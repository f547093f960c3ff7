//! Why a packet was refused.

/// Why a packet was refused, with what was seen, so that the log line is enough to act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// Not the size of a packet.
    #[error("expected 1248 bytes, got {got}")]
    Length {
        /// Bytes of the payload.
        got: usize,
    },
    /// Neither MSOP nor DIFOP, or the other of the two; another RoboSense model has other markers.
    #[error("starts with {got:02x?}, not with the marker of an RS-Helios packet")]
    Magic {
        /// Its first bytes.
        got: [u8; 8],
    },
    /// A block does not start with its flag.
    #[error("block {block} starts with {got:#06x}, not 0xffee")]
    BlockFlag {
        /// Index of the block.
        block: usize,
        /// Its first two bytes.
        got: u16,
    },
    /// An azimuth outside the turn.
    #[error("block {block} has azimuth {got}, beyond 35999 (hundredths of a degree)")]
    Azimuth {
        /// Index of the block.
        block: usize,
        /// The azimuth, 0.01°.
        got: u16,
    },
    /// The azimuth moves further between two blocks than a rotor can turn.
    #[error(
        "azimuth goes from {from} to {to} at block {block}: more than the fastest rotor turns \
         (hundredths of a degree)"
    )]
    AzimuthStep {
        /// Index of the later block.
        block: usize,
        /// Azimuth of the block before, 0.01°.
        from: u16,
        /// Azimuth of the later block, 0.01°.
        to: u16,
    },
    /// All blocks have one azimuth.
    #[error("the rotor stands still at azimuth {azimuth} (hundredths of a degree)")]
    RotorStopped {
        /// The azimuth of all blocks, 0.01°.
        azimuth: u16,
    },
    /// A stamp that is no time.
    #[error("stamp {seconds} s and {micros} µs is no time")]
    Stamp {
        /// Its seconds.
        seconds: u64,
        /// Its microseconds.
        micros: u32,
    },
    /// The DIFOP packet names no return mode.
    #[error(
        "return mode {got:#04x}, not 0x00 (dual), 0x04 (strongest), 0x05 (last) or 0x06 (first)"
    )]
    ReturnMode {
        /// The byte.
        got: u8,
    },
}
