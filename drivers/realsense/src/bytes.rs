//! Little-endian numbers at places that the caller has checked.

pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

pub(crate) fn f32_at(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_bits(u32_at(bytes, at)))
}

pub(crate) fn f32s_at<const N: usize>(bytes: &[u8], at: usize) -> [f64; N] {
    core::array::from_fn(|i| f32_at(bytes, at + 4 * i))
}
