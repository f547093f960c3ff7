//! Why a data packet was refused.

/// Why a data packet was refused, with what was seen, so that the log line is enough to act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// Not the size of a data packet.
    #[error("expected 1206 bytes, got {got}")]
    Length {
        /// Bytes of the payload.
        got: usize,
    },
    /// Another sensor's packet, or a VLP-16 of a firmware that says so.
    #[error("product id {got:#04x} ({}), not a VLP-16 (0x22) or Hi-Res (0x24)", product_name(*got))]
    Product {
        /// The product byte.
        got: u8,
    },
    /// The factory byte names no return mode.
    #[error("return mode {got:#04x}, not 0x37 (strongest), 0x38 (last) or 0x39 (dual)")]
    ReturnMode {
        /// The mode byte.
        got: u8,
    },
    /// A block does not start with its flag.
    #[error("block {block} starts with {got:#06x}, not 0xeeff")]
    BlockFlag {
        /// Index of the block.
        block: usize,
        /// The two bytes, little-endian.
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
    /// Two blocks that hold the echoes of the same shots differ in azimuth.
    #[error("dual return blocks {block} and {} have azimuths {first} and {second}", block + 1)]
    PairAzimuth {
        /// Index of the first block of the pair.
        block: usize,
        /// Its azimuth, 0.01°.
        first: u16,
        /// Azimuth of the other block, 0.01°.
        second: u16,
    },
    /// All blocks have one azimuth.
    #[error("the rotor stands still at azimuth {azimuth} (hundredths of a degree)")]
    RotorStopped {
        /// The azimuth of all blocks, 0.01°.
        azimuth: u16,
    },
    /// A stamp outside the hour.
    #[error("stamp {got_us} µs is not within an hour")]
    Stamp {
        /// The stamp, µs.
        got_us: u32,
    },
}

/// The sensor that a product byte stands for, as far as known.
///
/// The VLS-128 appears as 0x63 in the manual and as 0xA1 in recordings; both are named.
pub const fn product_name(byte: u8) -> &'static str {
    match byte {
        0x21 => "HDL-32E",
        0x22 => "VLP-16",
        0x24 => "Puck Hi-Res",
        0x28 => "VLP-32C",
        0x31 => "Velarray",
        0x63 | 0xA1 => "VLS-128",
        _ => "unknown",
    }
}
