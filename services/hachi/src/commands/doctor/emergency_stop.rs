//! The emergency stop on a CAN bus, where a configuration file names one: its bus is opened, and its
//! node listened to.

use std::path::Path;

use hachi_canbus::CanStop;
use hachi_canbus::stop_node::StopReason;
use hachi_datagram::SystemClock;
use hachi_hal::{Clock, EmergencyStop};

use super::files::configuration_files;
use super::finding::Finding;
use crate::can;
use crate::config::Settings;

/// The node is listened to for so many of its silences: it sends a heartbeat in less than one.
const SILENCES: i64 = 2;

pub(super) fn check() -> Vec<Finding> {
    configuration_files()
        .iter()
        .filter_map(|file| stop_of(file))
        .collect()
}

fn stop_of(file: &Path) -> Option<Finding> {
    const NAME: &str = "emergency stop";
    // What is wrong with the file itself is another finding's.
    let settings = Settings::load(None, Some(file)).ok()?;
    let (interface, config) = settings.emergency_stop.node()?;
    let place = format!("node {} on {interface}", config.node);
    let wrong = |error: &dyn std::fmt::Display| {
        Finding::warn(
            NAME,
            format!("{place}: {error}"),
            format!(
                "mend that, or correct [emergency_stop] in {}",
                file.display()
            ),
        )
    };
    let bus = match can::open(interface, &config.ids()) {
        Ok(bus) => bus,
        Err(error) => return Some(wrong(&error)),
    };
    let clock = SystemClock::new();
    let mut stop = CanStop::new(bus, clock, config)?;
    let end = clock.now() + SILENCES * config.heartbeat_limit_ns;
    while clock.now() < end {
        if let Err(error) = stop.read_stop(end) {
            return Some(wrong(&error));
        }
    }
    Some(match stop.reason() {
        None => Finding::ok(NAME, format!("{place}: released")),
        Some(StopReason::Pressed) => Finding::ok(NAME, format!("{place}: pressed")),
        Some(reason) => wrong(&reason.name()),
    })
}
