//! What happened to packets, and why some gave no points.

use crate::packet::PacketError;

/// Counts of what came and of what was left out, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VelodyneCounters {
    /// Data packets whose points went into turns.
    pub packets: u64,
    /// Position packets read.
    pub position_packets: u64,
    /// Turns handed out, partial ones included.
    pub turns: u64,
    /// Data packets that never came, by the gaps between stamps.
    pub lost: u64,
    /// Data packets that came again.
    pub duplicate: u64,
    /// Data packets that came after a later one.
    pub out_of_order: u64,
    /// Packets left out because their stamp fits neither the stream nor the one after them.
    pub stamp_jump: u64,
    /// Payloads that are neither data nor position packets by their length.
    pub wrong_size: u64,
    /// Data packets of another product.
    pub wrong_product: u64,
    /// Data packets with an unknown return mode.
    pub return_mode: u64,
    /// Data packets with a block that does not start with its flag.
    pub block_flag: u64,
    /// Data packets with an azimuth outside the turn, or differing within a dual pair.
    pub azimuth: u64,
    /// Data packets whose azimuth jumps.
    pub azimuth_step: u64,
    /// Data packets of a rotor that stands still.
    pub rotor_stopped: u64,
    /// Data packets with a stamp outside the hour.
    pub bad_stamp: u64,
    /// Position packets that could not be read.
    pub bad_position: u64,
    /// Turns divided because they never passed the cut angle.
    pub turn_too_long: u64,
    /// Points that the caller's sink had no room for.
    pub sink_full: u64,
    /// How often the receiver's clock was set back.
    pub receiver_clock_set_back: u64,
}

impl VelodyneCounters {
    /// Reasons for which something was left out, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("lost", self.lost),
            ("duplicate", self.duplicate),
            ("out_of_order", self.out_of_order),
            ("stamp_jump", self.stamp_jump),
            ("wrong_size", self.wrong_size),
            ("wrong_product", self.wrong_product),
            ("return_mode", self.return_mode),
            ("block_flag", self.block_flag),
            ("azimuth", self.azimuth),
            ("azimuth_step", self.azimuth_step),
            ("rotor_stopped", self.rotor_stopped),
            ("bad_stamp", self.bad_stamp),
            ("bad_position", self.bad_position),
            ("turn_too_long", self.turn_too_long),
            ("sink_full", self.sink_full),
            ("receiver_clock_set_back", self.receiver_clock_set_back),
        ]
        .into_iter()
    }

    pub(super) fn count(&mut self, error: PacketError) {
        let counter = match error {
            PacketError::Length { .. } => &mut self.wrong_size,
            PacketError::Product { .. } => &mut self.wrong_product,
            PacketError::ReturnMode { .. } => &mut self.return_mode,
            PacketError::BlockFlag { .. } => &mut self.block_flag,
            PacketError::Azimuth { .. } | PacketError::PairAzimuth { .. } => &mut self.azimuth,
            PacketError::AzimuthStep { .. } => &mut self.azimuth_step,
            PacketError::RotorStopped { .. } => &mut self.rotor_stopped,
            PacketError::Stamp { .. } => &mut self.bad_stamp,
        };
        *counter += 1;
    }
}
