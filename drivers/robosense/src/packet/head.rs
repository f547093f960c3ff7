//! What can be told of an MSOP packet without decoding its points: its number, time and model.

use super::{MSOP_MAGIC, PACKET_LEN, PacketError, time_ns_at, u32_at};

/// What stands at the head of an MSOP packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MsopHeader {
    /// Counts packets; wraps.
    pub counter: u32,
    /// Time of the first firing on the sensor's clock, ns.
    pub time_ns: u64,
    /// Bytes 30 to 32: family and model, as they stand. Manuals disagree on them; the recorded
    /// sensor sends 6, 0, 0.
    pub model: [u8; 3],
}

impl MsopHeader {
    /// Reads the head of a packet, after its length and marker.
    pub fn decode(payload: &[u8]) -> Result<Self, PacketError> {
        let bytes = as_packet(payload)?;
        Ok(Self {
            counter: u32_at(bytes, 12),
            time_ns: time_ns_at(bytes, 20)?,
            model: [bytes[30], bytes[31], bytes[32]],
        })
    }
}

/// A payload of an MSOP packet's length and marker.
pub(super) fn as_packet(payload: &[u8]) -> Result<&[u8; PACKET_LEN], PacketError> {
    let got = payload.len();
    let bytes: &[u8; PACKET_LEN] = payload
        .try_into()
        .map_err(|_| PacketError::Length { got })?;
    if !bytes.starts_with(&MSOP_MAGIC) {
        return Err(PacketError::Magic {
            got: core::array::from_fn(|at| bytes[at]),
        });
    }
    Ok(bytes)
}
