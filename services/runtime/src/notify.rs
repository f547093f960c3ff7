//! What systemd is told: ready, alive, what is going on, stopping.
//!
//! Without systemd (`NOTIFY_SOCKET` unset) nothing is told and nothing fails.

use std::time::Duration;

use sd_notify::NotifyState;

/// The line to systemd.
#[derive(Debug, Default)]
pub struct Notifier {
    status: String,
}

impl Notifier {
    /// How often systemd wants to hear that the service is alive: half of `WatchdogSec`. `None`
    /// where it does not wait for that.
    pub fn watchdog_period() -> Option<Duration> {
        sd_notify::watchdog_enabled().map(|timeout| timeout / 2)
    }

    /// The service is up.
    pub fn ready(&self) {
        Self::tell(&[NotifyState::Ready]);
    }

    /// The service is alive.
    pub fn alive(&self) {
        Self::tell(&[NotifyState::Watchdog]);
    }

    /// What is going on, where it changed.
    pub fn status(&mut self, status: &str) {
        if self.status != status {
            status.clone_into(&mut self.status);
            Self::tell(&[NotifyState::Status(status)]);
        }
    }

    /// The service ends.
    pub fn stopping(&self) {
        Self::tell(&[NotifyState::Stopping]);
    }

    fn tell(states: &[NotifyState<'_>]) {
        if let Err(error) = sd_notify::notify(states) {
            tracing::debug!(%error, "systemd does not listen");
        }
    }
}
