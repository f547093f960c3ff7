//! `supervisor`: what is stale and what is wrong, told to health. Its rounds are the event loop that
//! the gate watches.

use std::sync::atomic::Ordering;

use hachi_hal::Stamp;
use hachi_runtime::{Health, Progress, Trouble, Work};
use tracing::{info, warn};

use super::signs::SharedSigns;

/// A sensor that says nothing for this long is lost, ns. The gate stops the robot long before.
const LOST_NS: i64 = 1_000_000_000;

/// Sensors that have not come after this long do not come, ns.
const PATIENCE_NS: i64 = 5_000_000_000;

/// The task.
pub struct Supervisor {
    /// What tasks leave.
    pub signs: SharedSigns,
    /// What is told.
    pub health: Health,
    /// Whether there is to be a camera.
    pub has_camera: bool,
    /// Whether an emergency stop on a bus is expected.
    pub has_stop_node: bool,
    /// Whether there is to be an inertial sensor on a bus.
    pub has_imu: bool,
    /// When it began.
    pub begun: Option<Stamp>,
    /// Whether all was there once, or was waited for.
    pub started: bool,
}

impl Work for Supervisor {
    fn run(&mut self, now: Stamp) -> Progress {
        let begun = *self.begun.get_or_insert(now);
        let signs = &self.signs;
        signs.event_loop.set(now);
        let waited = now.nanos_since(begun) > PATIENCE_NS;
        let stop_there = !self.has_stop_node || signs.stop_node.get().is_some();
        let all_there = signs.scan.get().is_some() && signs.robot.get().is_some() && stop_there;
        if !self.started && (all_there || waited) {
            self.started = true;
            self.health.started();
        }
        let lost = |mark: &super::signs::Mark| match mark.get() {
            Some(_) => !mark.is_fresh(now, LOST_NS),
            None => waited,
        };
        self.tell(Trouble::LidarLost, lost(&signs.scan));
        self.tell(Trouble::RobotLost, lost(&signs.robot));
        self.tell(Trouble::CameraLost, self.has_camera && lost(&signs.camera));
        self.tell(Trouble::ImuLost, self.has_imu && lost(&signs.imu.last));
        let no_model = signs.model_missing.load(Ordering::Relaxed)
            || signs.network_fails.load(Ordering::Relaxed);
        self.tell(Trouble::ModelMissing, no_model);
        let stop_lost = self.has_stop_node && lost(&signs.stop_node);
        self.tell(Trouble::EmergencyStopLost, stop_lost);
        let poor = !matches!(signs.condition.get(), "OK" | "UNKNOWN");
        self.tell(Trouble::LocalisationPoor, poor);
        let blocked = signs.way_blocked.load(Ordering::Relaxed);
        self.tell(Trouble::WayBlocked, blocked);
        let full = signs.store_fails.load(Ordering::Relaxed)
            || signs.recording_fails.load(Ordering::Relaxed);
        self.tell(Trouble::DiskFull, full);
        Progress::Done
    }
}

impl Supervisor {
    fn tell(&self, trouble: Trouble, wrong: bool) {
        if self.health.set(trouble, wrong) {
            match wrong {
                true => warn!("{}", trouble.name()),
                false => info!("no longer: {}", trouble.name()),
            }
        }
    }
}
