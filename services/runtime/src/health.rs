//! The state of the whole, by name: what systemd, people and the safety gate are told.
//!
//! In: troubles that come and go, raised by whichever task notices. Out: one state, the worst, and
//! the list.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// The state of the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HealthState {
    /// Not all is there yet.
    Starting,
    /// As it should be.
    Running,
    /// It works, and leaves something out or knows less than usual.
    Degraded,
    /// A sensor or the robot does not answer.
    SensorLost,
    /// Nothing can be kept.
    DiskFull,
    /// A network's weights are not there.
    ModelMissing,
    /// It ends.
    Stopping,
}

impl HealthState {
    /// All states.
    pub const ALL: [Self; 7] = [
        Self::Starting,
        Self::Running,
        Self::Degraded,
        Self::SensorLost,
        Self::DiskFull,
        Self::ModelMissing,
        Self::Stopping,
    ];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Degraded => "degraded",
            Self::SensorLost => "sensor lost",
            Self::DiskFull => "disk full",
            Self::ModelMissing => "model missing",
            Self::Stopping => "stopping",
        }
    }
}

/// Something that is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Trouble {
    /// The robot sends nothing new.
    RobotLost,
    /// The LiDAR sends nothing.
    LidarLost,
    /// The emergency stop's node says nothing, or that it does not work.
    EmergencyStopLost,
    /// The camera sends nothing.
    CameraLost,
    /// The inertial sensor measures nothing.
    ImuLost,
    /// The map can't be kept.
    DiskFull,
    /// A model is not there.
    ModelMissing,
    /// A task is not at the top of its ladder.
    TaskDegraded,
    /// Where the robot is, is guessed in part, or unknown.
    LocalisationPoor,
    /// The patrol could not get to a place: things stand in the way.
    WayBlocked,
    /// A task ended that should not have.
    TaskDied,
    /// The settings can't be worked with: the robot is not moved.
    Settings,
}

impl Trouble {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::RobotLost,
        Self::LidarLost,
        Self::EmergencyStopLost,
        Self::CameraLost,
        Self::ImuLost,
        Self::DiskFull,
        Self::ModelMissing,
        Self::TaskDegraded,
        Self::LocalisationPoor,
        Self::WayBlocked,
        Self::TaskDied,
        Self::Settings,
    ];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RobotLost => "robot lost",
            Self::LidarLost => "lidar lost",
            Self::EmergencyStopLost => "emergency stop lost",
            Self::CameraLost => "camera lost",
            Self::ImuLost => "inertial sensor lost",
            Self::DiskFull => "disk full",
            Self::ModelMissing => "model missing",
            Self::TaskDegraded => "task degraded",
            Self::LocalisationPoor => "localisation poor",
            Self::WayBlocked => "way blocked",
            Self::TaskDied => "task died",
            Self::Settings => "settings",
        }
    }

    /// The state that it puts the service in.
    const fn state(self) -> HealthState {
        match self {
            Self::RobotLost
            | Self::LidarLost
            | Self::EmergencyStopLost
            | Self::CameraLost
            | Self::ImuLost => HealthState::SensorLost,
            Self::DiskFull => HealthState::DiskFull,
            Self::ModelMissing => HealthState::ModelMissing,
            Self::TaskDegraded
            | Self::LocalisationPoor
            | Self::WayBlocked
            | Self::TaskDied
            | Self::Settings => HealthState::Degraded,
        }
    }

    const fn bit(self) -> u32 {
        1 << self as u8
    }
}

const STARTED: u32 = 1 << 30;
const STOPPING: u32 = 1 << 31;

/// The health of a service. Clones are the same.
#[derive(Debug, Clone, Default)]
pub struct Health(Arc<AtomicU32>);

impl Health {
    /// Says whether something is wrong; whether that is news.
    pub fn set(&self, trouble: Trouble, wrong: bool) -> bool {
        let bit = trouble.bit();
        let before = match wrong {
            true => self.0.fetch_or(bit, Ordering::AcqRel),
            false => self.0.fetch_and(!bit, Ordering::AcqRel),
        };
        (before & bit != 0) != wrong
    }

    /// Everything is there now.
    pub fn started(&self) {
        self.0.fetch_or(STARTED, Ordering::AcqRel);
    }

    /// It ends. There is no way back.
    pub fn stopping(&self) {
        self.0.fetch_or(STOPPING, Ordering::AcqRel);
    }

    /// Whether this is wrong now.
    pub fn has(&self, trouble: Trouble) -> bool {
        self.0.load(Ordering::Acquire) & trouble.bit() != 0
    }

    /// What is wrong now.
    pub fn troubles(&self) -> impl Iterator<Item = Trouble> + use<> {
        let bits = self.0.load(Ordering::Acquire);
        Trouble::ALL
            .into_iter()
            .filter(move |t| bits & t.bit() != 0)
    }

    /// The worst that is true: stopping, then a lost sensor, a full disk, a missing model, starting,
    /// degraded, running.
    pub fn state(&self) -> HealthState {
        let bits = self.0.load(Ordering::Acquire);
        let has = |state| self.troubles().any(|t| t.state() == state);
        if bits & STOPPING != 0 {
            return HealthState::Stopping;
        }
        let worst = [
            HealthState::SensorLost,
            HealthState::DiskFull,
            HealthState::ModelMissing,
        ];
        match worst.into_iter().find(|state| has(*state)) {
            Some(state) => state,
            None if bits & STARTED == 0 => HealthState::Starting,
            None if has(HealthState::Degraded) => HealthState::Degraded,
            None => HealthState::Running,
        }
    }

    /// State and troubles in one line.
    pub fn line(&self) -> String {
        let troubles: Vec<_> = self.troubles().map(Trouble::name).collect();
        match troubles.is_empty() {
            true => self.state().name().to_owned(),
            false => format!("{}: {}", self.state().name(), troubles.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_is_the_state_and_news_is_said_once() {
        let health = Health::default();
        assert_eq!(health.state(), HealthState::Starting);
        health.started();
        assert_eq!(health.state(), HealthState::Running);
        assert!(health.set(Trouble::TaskDegraded, true));
        assert!(!health.set(Trouble::TaskDegraded, true), "no news");
        assert_eq!(health.state(), HealthState::Degraded);
        assert!(health.set(Trouble::DiskFull, true));
        assert!(health.set(Trouble::LidarLost, true));
        assert_eq!(health.state(), HealthState::SensorLost);
        assert_eq!(
            health.line(),
            "sensor lost: lidar lost, disk full, task degraded"
        );
        assert!(health.set(Trouble::LidarLost, false));
        assert_eq!(health.state(), HealthState::DiskFull);
        health.stopping();
        assert_eq!(health.state(), HealthState::Stopping);
    }
}
