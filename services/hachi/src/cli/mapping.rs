//! Arguments of the commands that turn packets and scans into clouds, trajectories and maps.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use hachi_cloud::{FilterConfig, IntensityMode};
use hachi_world::{Preset, SensorKind};

/// Arguments of `hachi demo`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Writes map.ply, trajectory.svg, trajectory.tum, odometry.tum and report.json to the folder.

Example:
  hachi demo --seconds 30 --out out/demo")]
pub struct DemoArguments {
    /// How long the robot walks, seconds of its own time: the clock is virtual.
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = super::seconds)]
    pub seconds: f64,
    /// Show no task table: only write files and the summary.
    #[arg(long)]
    pub headless: bool,
    /// The building, the walk and the noise: the same number gives the same bytes.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Where the robot walks: office, glass-corridor, corridor, stress (the office, with a sensor
    /// that is carried in a hurry), building (corridors on a grid, five minutes), campus (streets
    /// on rolling ground, 2.5 km in 21 minutes) or campus-long (20 km at 4 m/s).
    #[arg(long, value_name = "NAME", default_value = "office", value_parser = world)]
    pub world: Preset,
    /// The robot that the service drives: b1 or go1.
    #[arg(long, value_name = "NAME", default_value = "b1")]
    pub platform: String,
    /// The robot follows a fixed walk and nobody drives it; always so in the worlds stress and
    /// campus-long, and with --stage odometry.
    #[arg(long)]
    pub scripted: bool,
    /// Keep what LiDAR and legs sent in this MCAP file, for `hachi replay`, Foxglove and ROS 2; of a
    /// robot that the service drives.
    #[arg(long, value_name = "FILE", conflicts_with = "scripted")]
    pub record: Option<PathBuf>,
    /// Nobody walks about in the building, and the robot has no camera.
    #[arg(long)]
    pub nobody: bool,
    /// How far through the pipeline to go.
    #[arg(long, value_enum, default_value_t = StageArgument::Slam)]
    pub stage: StageArgument,
    /// Keep the map in this file, or go on with the one that is there.
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// What it carries: vlp16, vlp16-dual or helios16p.
    #[arg(long, value_name = "NAME", default_value = "vlp16", value_parser = sensor)]
    pub sensor: SensorKind,
    /// Which filter takes reflections away before scans are aligned.
    #[arg(long, value_enum)]
    pub filter: Option<FilterArgument>,
    /// Folder for the results.
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
    /// Print the report as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi decode`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a pcap or pcapng capture, or a ROS 2 bag (db3, mcap) with LiDAR packets. The sensor is \
recognised by its packets.

Example:
  hachi decode drive.pcap --out clouds --format ply")]
pub struct DecodeArguments {
    /// The capture.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// Folder for one cloud file per turn, and report.json.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// How clouds are written.
    #[arg(long, value_enum, default_value_t = CloudFormat::Pcd)]
    pub format: CloudFormat,
    /// Print the report as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// How a cloud is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CloudFormat {
    /// Binary PCD, as the Point Cloud Library reads it.
    Pcd,
    /// Binary PLY, as viewers read it.
    Ply,
    /// Text, one point a line.
    Csv,
}

/// Arguments of `hachi replay`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a pcap or pcapng capture, a ROS 2 bag (db3, mcap), a ROS 1 bag, a KITTI sequence folder, or a \
folder of .bin, .pcd or .ply scans in numeric order with optional times.txt (seconds). In a KITTI \
sequence with its calib.txt the LiDAR's vertical angles are corrected by 0.205 degrees, as is usual.

Example:
  hachi replay drive.pcap --out out/drive --stage slam --map drive.map")]
pub struct ReplayArguments {
    /// The recording.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// Folder for trajectory, map, picture and report.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Settings; what the file leaves out keeps its default.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The robot that carried the sensor: where it is mounted. Without it the base is the LiDAR.
    #[arg(long, value_name = "NAME")]
    pub platform: Option<String>,
    /// How far through the pipeline to go.
    #[arg(long, value_enum, default_value_t = StageArgument::Odometry)]
    pub stage: StageArgument,
    /// Keep the map in this file, or go on with the one that is there (with --stage slam).
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Threads to work with [default: one for each core]. The result does not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Which filter takes reflections away before scans are aligned.
    #[arg(long, value_enum)]
    pub filter: Option<FilterArgument>,
    /// Print the report as one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// How far through the pipeline a replay goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StageArgument {
    /// Scan by scan, without closing loops.
    Odometry,
    /// With submaps, loops and a map that is optimised as a whole.
    Slam,
}

/// Which filter takes reflections away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FilterArgument {
    /// None.
    None,
    /// Everything weak goes, ground too.
    Intensity,
    /// What is weak goes, unless it is as low as the ground.
    Naive,
    /// What is weak goes, unless its surface is level like the ground.
    Normal,
}

impl FilterArgument {
    /// Sets the filters to this. Mirror ghosts are taken away by those that know the ground.
    pub fn apply(self, config: &mut FilterConfig) {
        config.intensity = match self {
            Self::None => IntensityMode::None,
            Self::Intensity => IntensityMode::Intensity,
            Self::Naive => IntensityMode::Naive,
            Self::Normal => IntensityMode::Normal,
        };
        config.ghosts &= matches!(self, Self::Naive | Self::Normal);
    }
}

/// Arguments of `hachi eval registration`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Clouds are .bin, .pcd or .ply. The guess is a text file of 16 numbers: the 4x4 matrix \
target_from_source, row by row.

Example:
  hachi eval registration --source second.ply --target first.ply --json")]
pub struct EvalRegistrationArguments {
    /// The cloud to move.
    #[arg(long, value_name = "S")]
    pub source: PathBuf,
    /// The cloud to move it onto.
    #[arg(long, value_name = "T")]
    pub target: PathBuf,
    /// Where to start from [default: as they are].
    #[arg(long, value_name = "FILE")]
    pub guess: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub(super) fn world(name: &str) -> Result<Preset, String> {
    Preset::from_name(name).ok_or_else(|| {
        let names = Preset::ALL.map(Preset::name).join(", ");
        format!("there is no such world; choose one of {names}")
    })
}

fn sensor(name: &str) -> Result<SensorKind, String> {
    SensorKind::from_name(name).ok_or_else(|| {
        let names = SensorKind::ALL.map(SensorKind::name).join(", ");
        format!("there is no such sensor; choose one of {names}")
    })
}
