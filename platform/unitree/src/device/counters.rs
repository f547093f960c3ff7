//! What became of what arrived.

use crate::frame::FrameError;

/// What a [`super::HighClient`] saw and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClientCounters {
    /// HighCmds sent.
    pub sent: u64,
    /// HighStates that were whole and new.
    pub states: u64,
    /// Of these, with the transformed check value.
    pub transformed: u64,
    /// Whole, but the last one once more.
    pub repeated: u64,
    /// Of another length, or another robot's.
    pub wrong_length: u64,
    /// Not beginning as frames do.
    pub wrong_head: u64,
    /// With a wrong check value.
    pub wrong_check: u64,
    /// Of another level.
    pub wrong_level: u64,
    /// New, but with joints that can't be: neither legs nor body were delivered.
    pub ill_legs: u64,
    /// New, but with an inertial reading or attitude that can't be.
    pub ill_imu: u64,
    /// New, but with a battery or remote control that can't be.
    pub ill_other: u64,
    /// Samples that nobody fetched in time.
    pub overwritten: u64,
}

impl ClientCounters {
    pub(super) fn refuse(&mut self, error: &FrameError) {
        *match error {
            FrameError::Length { .. } | FrameError::OtherFrame { .. } => &mut self.wrong_length,
            FrameError::Head { .. } => &mut self.wrong_head,
            FrameError::Check { .. } => &mut self.wrong_check,
            FrameError::Level { .. } => &mut self.wrong_level,
        } += 1;
    }

    /// Reasons for which something was left out, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("repeated", self.repeated),
            ("wrong_length", self.wrong_length),
            ("wrong_head", self.wrong_head),
            ("wrong_check", self.wrong_check),
            ("wrong_level", self.wrong_level),
            ("ill_legs", self.ill_legs),
            ("ill_imu", self.ill_imu),
            ("ill_other", self.ill_other),
            ("overwritten", self.overwritten),
        ]
        .into_iter()
    }
}
