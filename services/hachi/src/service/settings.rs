//! Settings of the service: who the robot is, where its packets come from, what is kept and told.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use hachi_b1::B1;
use hachi_canbus::stop_node::{NODES, StopNodeConfig};
use hachi_go1::GO1;
use hachi_people::identify::IdentifierConfig;
use hachi_runtime::{Overrun, TaskSpec, Trigger};
use hachi_unitree::Quadruped;
use hachi_unitree::command::CommanderConfig;
use hachi_unitree::device::ClientConfig;
use serde::{Deserialize, Serialize};

pub mod imu;

use super::rows;
use crate::config::{Settings, Unworkable};

/// Who the robot is and how it is reached.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotConfig {
    /// Its name: `b1` or `go1`.
    pub platform: Option<String>,
    /// Its high-level service; the maker's usual address if unset.
    pub address: Option<SocketAddr>,
    /// Port that is sent from and answered at; the maker's if unset.
    pub local_port: Option<u16>,
}

/// The LiDAR's maker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarKind {
    /// Velodyne VLP-16.
    #[default]
    Vlp16,
    /// RoboSense RS-Helios-16P.
    Helios16p,
}

/// Where the LiDAR's packets come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LidarConfig {
    /// Which sensor.
    pub kind: LidarKind,
    /// Local address that packets come to; all if unspecified.
    pub bind_address: IpAddr,
    /// Ports they come to; the sensor's usual ones if empty.
    pub ports: Vec<u16>,
    /// The sensor's address; packets from others are left out. Any if unset.
    pub source_address: Option<IpAddr>,
}

impl Default for LidarConfig {
    fn default() -> Self {
        Self {
            kind: LidarKind::default(),
            bind_address: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            ports: Vec::new(),
            source_address: None,
        }
    }
}

impl LidarConfig {
    /// The ports that are listened to.
    pub fn ports(&self) -> Vec<u16> {
        let usual: [u16; 2] = match self.kind {
            LidarKind::Vlp16 => [2368, 8308],
            LidarKind::Helios16p => [6699, 7788],
        };
        match self.ports.is_empty() {
            true => usual.to_vec(),
            false => self.ports.clone(),
        }
    }
}

/// The depth camera, a RealSense.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraConfig {
    /// Its serial number on the USB; any camera if unset.
    pub serial: Option<String>,
    /// Columns of both pictures.
    pub width: u32,
    /// Their rows.
    pub height: u32,
    /// How often it takes them.
    pub frames_per_second: u32,
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self {
            serial: None,
            width: 640,
            height: 360,
            frames_per_second: 15,
        }
    }
}

/// People in the camera's sight.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PeopleConfig {
    /// Whether they are looked for. The camera is opened then.
    pub enabled: bool,
    /// The network that finds them.
    pub detector: Option<PathBuf>,
    /// The network that tells them apart.
    pub reid: Option<PathBuf>,
    /// Who is known (`hachi people enrol`).
    pub store: Option<PathBuf>,
    /// Its key file; beside it if unset.
    pub key: Option<PathBuf>,
    /// How they are known again.
    pub identify: IdentifierConfig,
}

/// An emergency stop of its own on a CAN bus, besides the remote control's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmergencyStopConfig {
    /// The interface that its node is on; there is none if unset.
    pub can: Option<String>,
    /// The node's number.
    pub node: u8,
    /// The inputs that its contacts are wired to, counted from 1.
    pub inputs: Vec<u8>,
    /// Silence of the node after which it is taken for pressed, s.
    pub heartbeat_stale_s: f64,
}

impl Default for EmergencyStopConfig {
    fn default() -> Self {
        let usual = StopNodeConfig::default();
        let wired = |input: &u8| usual.closed_inputs & (1 << (input - 1)) != 0;
        Self {
            can: None,
            node: usual.node,
            inputs: INPUTS.filter(wired).collect(),
            heartbeat_stale_s: usual.heartbeat_limit_ns as f64 * 1e-9,
        }
    }
}

/// The inputs of a node that a stop can be wired to.
const INPUTS: std::ops::RangeInclusive<u8> = 1..=8;

impl EmergencyStopConfig {
    /// The interface and the node, where there is one.
    pub fn node(&self) -> Option<(&str, StopNodeConfig)> {
        let inputs = self.inputs.iter().filter(|input| INPUTS.contains(input));
        let config = StopNodeConfig {
            node: self.node,
            closed_inputs: inputs.fold(0, |bits, input| bits | 1 << (input - 1)),
            heartbeat_limit_ns: (self.heartbeat_stale_s * 1e9) as i64,
        };
        self.can.as_deref().map(|can| (can, config))
    }

    fn check(&self) -> Result<(), Unworkable> {
        let unworkable = |key: &str, what: String, next_step: &str| Unworkable {
            key: format!("emergency_stop.{key}"),
            what: format!("{what} can't work"),
            next_step: next_step.to_owned(),
        };
        // Linux names no interface in more bytes, or with a slash.
        let named = |can: &String| (1..=15).contains(&can.len()) && !can.contains('/');
        if let Some(can) = self.can.as_ref().filter(|can| !named(can)) {
            let next_step = "name an interface that `ip link show type can` lists, as \"can0\"";
            return Err(unworkable("can", format!("{can:?}"), next_step));
        }
        if !NODES.contains(&self.node) {
            return Err(unworkable("node", self.node.to_string(), "give 1 to 127"));
        }
        if self.inputs.is_empty() || !self.inputs.iter().all(|input| INPUTS.contains(input)) {
            let next_step = "name those of the inputs 1 to 8 that the contacts are wired to";
            return Err(unworkable(
                "inputs",
                format!("{:?}", self.inputs),
                next_step,
            ));
        }
        if !(0.05..=2.0).contains(&self.heartbeat_stale_s) {
            let next_step = "give 0.05 to 2 s: twice the node's heartbeat and a little";
            let what = self.heartbeat_stale_s.to_string();
            return Err(unworkable("heartbeat_stale_s", what, next_step));
        }
        Ok(())
    }
}

/// The program itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ServiceConfig {
    /// Where tasks, health and metrics are told over HTTP.
    pub listen: SocketAddr,
    /// The map that is kept; in memory alone if unset.
    pub map: Option<PathBuf>,
    /// Whether real-time scheduling and locked memory are asked for.
    pub real_time: bool,
    /// Cores that filters, odometry and SLAM may each use; all if 0.
    pub threads: usize,
}

impl Default for ServiceConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 9470)),
            map: None,
            real_time: true,
            threads: 0,
        }
    }
}

/// What of a task's row is other than usual.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RowConfig {
    /// From one release to the next, ms; of tasks with a period.
    pub period_ms: Option<f64>,
    /// How long a run may take, ms.
    pub budget_ms: Option<f64>,
    /// 1 to 99: of two tasks that could run, the one with more does.
    pub priority: Option<u8>,
    /// The core it keeps to.
    pub core: Option<usize>,
    /// What happens when a run takes longer.
    pub overrun: Option<Overrun>,
}

impl RowConfig {
    /// The row with these changes.
    pub fn apply(&self, mut spec: TaskSpec) -> TaskSpec {
        let nanos = |ms: f64| (ms * 1e6) as i64;
        if let (Some(ms), Trigger::Period { period_ns }) = (self.period_ms, &mut spec.trigger) {
            *period_ns = nanos(ms);
        }
        spec.budget_ns = self.budget_ms.map_or(spec.budget_ns, nanos);
        spec.priority = self.priority.unwrap_or(spec.priority);
        spec.core = self.core.or(spec.core);
        spec.overrun = self.overrun.unwrap_or(spec.overrun);
        spec
    }
}

/// The key of a task in a file: its name with underscores.
pub fn key_of(spec: &TaskSpec) -> String {
    spec.name.replace(' ', "_")
}

/// A row with what the settings change of it.
pub fn row(settings: &Settings, spec: TaskSpec) -> TaskSpec {
    match settings.task.get(&key_of(&spec)) {
        Some(changes) => changes.apply(spec),
        None => spec,
    }
}

/// Refuses what no service can work with.
///
/// # Errors
/// The first such value.
pub fn check(settings: &Settings) -> Result<(), Unworkable> {
    settings.emergency_stop.check()?;
    settings.imu.check()?;
    let unworkable = |key: String, what: String, next_step: &str| Unworkable {
        key,
        what,
        next_step: next_step.to_owned(),
    };
    for (name, row) in &settings.task {
        let key = |field: &str| format!("task.{name}.{field}");
        if !rows::ALL.iter().any(|spec| key_of(spec) == *name) {
            let known: Vec<_> = rows::ALL.iter().map(key_of).collect();
            let next_step = format!("choose one of {}", known.join(", "));
            return Err(unworkable(
                format!("task.{name}"),
                "no such task".to_owned(),
                &next_step,
            ));
        }
        for (field, value) in [("period_ms", row.period_ms), ("budget_ms", row.budget_ms)] {
            if value.is_some_and(|ms| !(0.05..=10_000.0).contains(&ms)) {
                let what = format!("{} can't work", value.unwrap_or_default());
                return Err(unworkable(key(field), what, "give 0.05 to 10000 ms"));
            }
        }
        if row.priority.is_some_and(|p| !(1..=99).contains(&p)) {
            let what = format!("{} can't work", row.priority.unwrap_or_default());
            return Err(unworkable(key("priority"), what, "give 1 to 99"));
        }
    }
    let camera = &settings.camera;
    for (key, value, range) in [
        ("camera.width", camera.width, 2..=1920),
        ("camera.height", camera.height, 2..=1080),
        ("camera.frames_per_second", camera.frames_per_second, 1..=90),
    ] {
        if !range.contains(&value) {
            let next_step = format!("give {} to {}", range.start(), range.end());
            return Err(unworkable(
                key.to_owned(),
                format!("{value} can't work"),
                &next_step,
            ));
        }
    }
    let lost_s = settings.people.identify.lost_s;
    if !(0.0..=3600.0).contains(&lost_s) {
        let what = format!("{lost_s} can't work");
        let key = "people.identify.lost_s".to_owned();
        return Err(unworkable(key, what, "give 0 to 3600 s"));
    }
    let patrol = &settings.patrol;
    let speeds = [
        (
            "patrol.speed_m_per_s",
            patrol.speed_m_per_s,
            0.01..=3.0,
            "0.01 to 3 m/s",
        ),
        ("patrol.reach_m", patrol.reach_m, 0.05..=5.0, "0.05 to 5 m"),
        (
            "patrol.blocked_s",
            patrol.blocked_s,
            1.0..=3600.0,
            "1 to 3600 s",
        ),
    ];
    for (key, value, range, wanted) in speeds {
        if !range.contains(&value) {
            let what = format!("{value} can't work");
            return Err(unworkable(key.to_owned(), what, &format!("give {wanted}")));
        }
    }
    if !patrol.places.iter().flatten().all(|v| v.abs() < 1e5) {
        let what = "a place that is not on any map".to_owned();
        return Err(unworkable("patrol.places".to_owned(), what, "give metres"));
    }
    Ok(())
}

/// A robot that the service can drive.
#[derive(Debug, Clone, Copy)]
pub struct Platform {
    /// The robot.
    pub robot: &'static Quadruped,
    /// Height of the base over the ground when it stands, m.
    pub standing_m: f64,
}

impl Platform {
    /// The robot of a name; `None` where the service has no driver for one.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "b1" => Some(Self {
                robot: &B1,
                standing_m: hachi_b1::STANDING_HEIGHT,
            }),
            "go1" => Some(Self {
                robot: &GO1,
                standing_m: hachi_go1::STANDING_HEIGHT,
            }),
            _ => None,
        }
    }

    /// How it is reached, as the settings say.
    pub fn client(&self, settings: &RobotConfig) -> ClientConfig {
        let usual = ClientConfig::for_robot(self.robot);
        let robot = settings.address.unwrap_or(usual.robot);
        let local_address = match robot.ip().is_loopback() {
            true => robot.ip(),
            false => usual.local_address,
        };
        ClientConfig {
            robot,
            local_address,
            local_port: settings.local_port.unwrap_or(usual.local_port),
            commander: CommanderConfig::default(),
            // The command task sends at every run; this is for one that hangs while it listens.
            command_period_ns: 20_000_000,
            ..usual
        }
    }
}
