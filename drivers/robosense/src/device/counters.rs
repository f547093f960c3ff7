//! What happened to packets, and why some gave no points.

use crate::packet::PacketError;

/// Counts of what came and of what was left out, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RobosenseCounters {
    /// MSOP packets whose points went into turns.
    pub packets: u64,
    /// DIFOP packets read.
    pub difop_packets: u64,
    /// Turns handed out, partial ones included.
    pub turns: u64,
    /// MSOP packets decoded with the manual's angles because the sensor's were not known.
    pub uncalibrated_packets: u64,
    /// MSOP packets that never came, by the gaps of the counter.
    pub lost: u64,
    /// MSOP packets that came again.
    pub duplicate: u64,
    /// MSOP packets that came after a later one.
    pub out_of_order: u64,
    /// MSOP packets left out because counter and stamp fit neither the stream nor the one after.
    pub stamp_jump: u64,
    /// Payloads of another length.
    pub wrong_size: u64,
    /// Payloads of the right length that start with no known marker: another model.
    pub wrong_product: u64,
    /// MSOP packets with a block that does not start with its flag.
    pub block_flag: u64,
    /// MSOP packets with an azimuth outside the turn.
    pub azimuth: u64,
    /// MSOP packets whose azimuth jumps.
    pub azimuth_step: u64,
    /// MSOP packets of a rotor that stands still.
    pub rotor_stopped: u64,
    /// Packets with a stamp that is no time.
    pub bad_stamp: u64,
    /// DIFOP packets that could not be read.
    pub bad_difop: u64,
    /// DIFOP packets whose calibration could not be used.
    pub bad_calibration: u64,
    /// Turns divided because they never passed the cut angle.
    pub turn_too_long: u64,
    /// Points that the caller's sink had no room for.
    pub sink_full: u64,
    /// How often the receiver's clock was set back.
    pub receiver_clock_set_back: u64,
}

impl RobosenseCounters {
    /// Reasons for which something was left out or is in doubt, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("uncalibrated_packets", self.uncalibrated_packets),
            ("lost", self.lost),
            ("duplicate", self.duplicate),
            ("out_of_order", self.out_of_order),
            ("stamp_jump", self.stamp_jump),
            ("wrong_size", self.wrong_size),
            ("wrong_product", self.wrong_product),
            ("block_flag", self.block_flag),
            ("azimuth", self.azimuth),
            ("azimuth_step", self.azimuth_step),
            ("rotor_stopped", self.rotor_stopped),
            ("bad_stamp", self.bad_stamp),
            ("bad_difop", self.bad_difop),
            ("bad_calibration", self.bad_calibration),
            ("turn_too_long", self.turn_too_long),
            ("sink_full", self.sink_full),
            ("receiver_clock_set_back", self.receiver_clock_set_back),
        ]
        .into_iter()
    }

    pub(super) fn count(&mut self, error: PacketError) {
        let counter = match error {
            PacketError::Length { .. } => &mut self.wrong_size,
            PacketError::Magic { .. } => &mut self.wrong_product,
            PacketError::BlockFlag { .. } => &mut self.block_flag,
            PacketError::Azimuth { .. } => &mut self.azimuth,
            PacketError::AzimuthStep { .. } => &mut self.azimuth_step,
            PacketError::RotorStopped { .. } => &mut self.rotor_stopped,
            PacketError::Stamp { .. } => &mut self.bad_stamp,
            PacketError::ReturnMode { .. } => &mut self.bad_difop,
        };
        *counter += 1;
    }
}
