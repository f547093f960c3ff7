//! Settings of the mapping pipeline: `hachi.toml` over the platform's file over the defaults.
//!
//! Every stage owns its own section; keys that nobody knows are refused with their place in the
//! file. Angles are degrees here and radians inside.

use std::collections::BTreeMap;
use std::path::Path;

use hachi_behaviour::{PatrolConfig, SafetyConfig};
use hachi_cloud::FilterConfig;
use hachi_hal::{Pose, Rotation, Vector3};
use hachi_odometry::OdometryConfig;
use hachi_slam::SlamConfig;
use serde::{Deserialize, Serialize};

use crate::exit::Failure;
use crate::service::settings::imu::ImuSettings;
use crate::service::settings::{
    CameraConfig, EmergencyStopConfig, LidarConfig, PeopleConfig, RobotConfig, RowConfig,
    ServiceConfig,
};

/// What is known of the motion besides the scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionInput {
    /// Nothing.
    #[default]
    None,
    /// The recording's inertial samples (needs `lidar_from_imu`), or the robot's.
    Imu,
    /// The recording's odometry, of the base (needs the mount), or that of the robot's legs.
    Odometry,
}

/// Where something sits on something else.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mount {
    /// Metres: forward, left, up.
    pub xyz_m: [f64; 3],
    /// Roll, pitch, yaw (applied yaw first), degrees.
    pub rpy_deg: [f64; 3],
}

impl Mount {
    /// The transform.
    pub fn pose(&self) -> Pose {
        let [r, p, y] = self.rpy_deg.map(f64::to_radians);
        Pose::from_parts(
            Vector3::from(self.xyz_m).into(),
            Rotation::from_euler_angles(r, p, y),
        )
    }

    /// Refuses what can be nobody's mount; `name` is its section.
    pub(crate) fn check(&self, name: &str) -> Result<(), Unworkable> {
        for (key, values) in [("xyz_m", self.xyz_m), ("rpy_deg", self.rpy_deg)] {
            // Farther than any robot is long: a slip of the unit, and then of every pose.
            if !values.iter().all(|v| v.abs() < 1e3) {
                return Err(Unworkable {
                    key: format!("{name}.{key}"),
                    what: format!("{values:?} can't work"),
                    next_step: "give three finite numbers below 1000".to_owned(),
                });
            }
        }
        Ok(())
    }
}

/// Settings of the map that is written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MapConfig {
    /// Edge of the cubes of which each gives one point.
    pub voxel_m: f64,
}

impl Default for MapConfig {
    fn default() -> Self {
        Self { voxel_m: 0.05 }
    }
}

/// Settings of the mapping pipeline.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MappingConfig {
    /// Where the LiDAR sits on the robot's base.
    pub base_from_lidar: Mount,
    /// Where the IMU sits on the LiDAR; only its rotation matters.
    pub lidar_from_imu: Mount,
    /// What is known of the motion besides the scans.
    pub motion: MotionInput,
    /// Filters.
    pub filter: FilterConfig,
    /// Odometry.
    pub odometry: OdometryConfig,
    /// SLAM.
    pub slam: SlamConfig,
    /// The map.
    pub map: MapConfig,
}

/// What lies below every platform's settings.
const BASE: &str = include_str!("../../../config/base.toml");

/// Platforms with their settings, each over the base's.
const PLATFORMS: [(&str, &str); 3] = [
    ("b1", include_str!("../../../config/b1.toml")),
    ("go1", include_str!("../../../config/go1.toml")),
    ("kairos", include_str!("../../../config/kairos.toml")),
];

/// Everything that a file of settings may say: how a robot is mapped, and how it is run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Where the LiDAR sits on the robot's base.
    pub base_from_lidar: Mount,
    /// Where the IMU sits on the LiDAR; only its rotation matters.
    pub lidar_from_imu: Mount,
    /// What is known of the motion besides the scans.
    pub motion: MotionInput,
    /// Filters.
    pub filter: FilterConfig,
    /// Odometry.
    pub odometry: OdometryConfig,
    /// SLAM.
    pub slam: SlamConfig,
    /// The map.
    pub map: MapConfig,
    /// The robot.
    pub robot: RobotConfig,
    /// The LiDAR's packets.
    pub lidar: LidarConfig,
    /// An inertial sensor of its own.
    pub imu: ImuSettings,
    /// The camera.
    pub camera: CameraConfig,
    /// People in its sight.
    pub people: PeopleConfig,
    /// An emergency stop besides the remote control's.
    pub emergency_stop: EmergencyStopConfig,
    /// Limits of the gate.
    pub safety: SafetyConfig,
    /// Where it goes.
    pub patrol: PatrolConfig,
    /// The program itself.
    pub service: ServiceConfig,
    /// Rows of the task table that differ from the usual.
    pub task: BTreeMap<String, RowConfig>,
}

impl Settings {
    /// The settings of a platform (or none) with those of a file (or none) over them.
    ///
    /// # Errors
    /// No such platform; the file can't be read, or says something that is not understood.
    pub fn load(platform: Option<&str>, file: Option<&Path>) -> Result<Self, Failure> {
        let text = match file {
            Some(path) => Some(read(path)?),
            None => None,
        };
        let name = file.map_or_else(String::new, |path| path.display().to_string());
        let mut own = toml::Table::new();
        let mut named = None;
        if let Some(text) = &text {
            // Checked on its own first: only then does the error know the line.
            let alone = toml::from_str::<Self>(text).map_err(|error| wrong(&name, &error))?;
            named = alone.robot.platform;
            own = parse(text, &name)?;
        }
        let mut table = parse(BASE, "config/base.toml")?;
        if let Some(platform) = platform.map(ToOwned::to_owned).or(named) {
            merge(&mut table, parse(platform_file(&platform)?, &platform)?);
        }
        merge(&mut table, own);
        let mut settings: Self = table
            .try_into()
            .map_err(|error| wrong("the settings", &error))?;
        if let Some(platform) = platform {
            settings.robot.platform = Some(platform.to_owned());
        }
        settings.odometry.base_from_lidar = settings.base_from_lidar.pose();
        settings.odometry.lidar_from_imu = settings.lidar_from_imu.pose().rotation;
        settings
            .check()
            .map_err(|unworkable| unworkable.failure(&name, text.as_deref()))?;
        Ok(settings)
    }

    /// Refuses what nothing can work with.
    fn check(&self) -> Result<(), Unworkable> {
        self.mapping().check()?;
        self.safety.check().map_err(|error| Unworkable {
            key: format!("safety.{}", error.key),
            what: format!("{} can't work", error.value),
            next_step: format!("give {}", error.wanted),
        })?;
        crate::service::settings::check(self)
    }

    /// The part that is about mapping.
    pub fn mapping(&self) -> MappingConfig {
        MappingConfig {
            base_from_lidar: self.base_from_lidar,
            lidar_from_imu: self.lidar_from_imu,
            motion: self.motion,
            filter: self.filter.clone(),
            odometry: self.odometry.clone(),
            slam: self.slam.clone(),
            map: self.map,
        }
    }
}

/// The settings of a platform as they stand in its file.
fn platform_file(name: &str) -> Result<&'static str, Failure> {
    let file = PLATFORMS.iter().find(|(n, _)| *n == name);
    file.map(|(_, text)| *text).ok_or_else(|| {
        let known = PLATFORMS.map(|(n, _)| n).join(", ");
        Failure::new(
            format_args!("there is no platform {name:?}"),
            format_args!("choose one of {known}, or leave it out"),
        )
    })
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| {
        Failure::new(
            format_args!("{} can't be read: {error}", path.display()),
            "give the path of a TOML file",
        )
    })
}

/// A value that is understood and that nothing can work with.
#[derive(Debug, Clone, PartialEq)]
pub struct Unworkable {
    /// The key, with its section; empty where what is wrong names it.
    pub key: String,
    /// What is wrong with it.
    pub what: String,
    /// What to do.
    pub next_step: String,
}

impl Unworkable {
    /// As it is told: with the file and the line, where the file says it.
    fn failure(&self, file: &str, text: Option<&str>) -> Failure {
        let Self {
            key,
            what,
            next_step,
        } = self;
        if key.is_empty() {
            return Failure::new(what, next_step);
        }
        match text.and_then(|text| line_of(text, key)) {
            Some(line) => Failure::new(
                format_args!("{file}, line {line}: {key} = {what}"),
                next_step,
            ),
            None => Failure::new(format_args!("{key} = {what}"), next_step),
        }
    }
}

/// The line on which a file sets a key: under its section, or with the section before it.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let mut section = String::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with('[') {
            section = line
                .trim_matches(|c| c == '[' || c == ']')
                .trim()
                .to_owned();
            continue;
        }
        let Some((name, _)) = line.split_once('=') else {
            continue;
        };
        let name = name.trim();
        let whole = match section.is_empty() {
            true => name.to_owned(),
            false => format!("{section}.{name}"),
        };
        // A key may also be set inside braces: then the table's line is the nearest.
        if whole == key || key.starts_with(&format!("{whole}.")) {
            return Some(index + 1);
        }
    }
    None
}

impl MappingConfig {
    /// The settings of a platform (or none) with those of a file (or none) over them.
    ///
    /// # Errors
    /// No such platform; the file can't be read, or says something that is not understood.
    pub fn load(platform: Option<&str>, file: Option<&Path>) -> Result<Self, Failure> {
        Ok(Settings::load(platform, file)?.mapping())
    }

    /// Refuses what no stage can work with.
    fn check(&self) -> Result<(), Unworkable> {
        self.filter.check().map_err(|error| Unworkable {
            key: String::new(),
            what: error.to_string(),
            next_step: "correct the [filter] section".to_owned(),
        })?;
        let odometry = &self.odometry;
        let positive = [
            ("odometry.target_points", odometry.target_points as f64),
            (
                "odometry.cell_m",
                f64::from(odometry.cell_m.unwrap_or(f32::MIN_POSITIVE)),
            ),
            ("odometry.map_range_m", f64::from(odometry.map_range_m)),
            ("odometry.map_memory_m", odometry.map_memory_m),
            ("odometry.knot_interval_s", odometry.knot_interval_s),
            (
                "odometry.agility.acceleration",
                odometry.agility.acceleration,
            ),
            (
                "odometry.agility.angular_acceleration",
                odometry.agility.angular_acceleration,
            ),
            (
                "odometry.degeneracy_threshold",
                odometry.degeneracy_threshold,
            ),
            ("odometry.lost_after", odometry.lost_after as f64),
            (
                "odometry.gyro_noise_rad_per_s",
                odometry.gyro_noise_rad_per_s,
            ),
            (
                "odometry.odometry_error_share",
                odometry.odometry_error_share,
            ),
            ("map.voxel_m", self.map.voxel_m),
            (
                "slam.node_every_m",
                self.slam.node_every_m.unwrap_or(f64::MIN_POSITIVE),
            ),
            ("slam.node_every_rad", self.slam.node_every_rad),
            ("slam.loop_submaps", self.slam.loop_submaps as f64),
            ("slam.loop_least_way_m", self.slam.loop_least_way_m),
            ("slam.loop_least_overlap", self.slam.loop_least_overlap),
            ("slam.loop_least_inliers", self.slam.loop_least_inliers),
            ("slam.submap_memory_mb", self.slam.submap_memory_mb as f64),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Unworkable {
                    key: key.to_owned(),
                    what: format!("{value} can't work"),
                    next_step: "give a finite number above 0".to_owned(),
                });
            }
        }
        self.base_from_lidar.check("base_from_lidar")?;
        self.lidar_from_imu.check("lidar_from_imu")
    }
}

fn parse(text: &str, name: &str) -> Result<toml::Table, Failure> {
    text.parse::<toml::Table>()
        .map_err(|error| wrong(name, &error))
}

fn wrong(name: &str, error: &toml::de::Error) -> Failure {
    let message = error
        .to_string()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    Failure::new(
        format_args!("{name} is not understood: {message}"),
        "correct that line; docs/configuration.md lists every key",
    )
}

/// Puts `over` on top of `table`, section by section.
fn merge(table: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => merge(below, above),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_platform_s_file_is_understood() {
        for (name, _) in PLATFORMS {
            let config = MappingConfig::load(Some(name), None).unwrap();
            assert!(!config.filter.body.is_empty(), "{name} has no body to crop");
        }
    }

    #[test]
    fn a_key_nobody_knows_is_refused_with_its_line() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "[odometry]\ntarget_point = 5\n").unwrap();
        let error = MappingConfig::load(None, Some(file.path()))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 2") && error.contains("target_point"),
            "{error}"
        );
    }

    #[test]
    fn a_file_goes_over_the_platform_key_by_key() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "[filter]\nfar_m = 33.0\n").unwrap();
        let platform = MappingConfig::load(Some("go1"), None).unwrap();
        let config = MappingConfig::load(Some("go1"), Some(file.path())).unwrap();
        assert_eq!(config.filter.far_m, 33.0);
        assert_eq!(config.filter.body, platform.filter.body);
        assert!(MappingConfig::load(Some("go9"), None).is_err());
    }
}
