//! Arguments of the commands that are about the service on a robot.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use hachi_world::Preset;

/// Arguments of `hachi run`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Runs until it is told to stop (Ctrl-C, SIGTERM). Settings that can't be worked with are said with \
their file, line and key; the robot then stands still.

Example:
  hachi run --config /etc/hachi/hachi.toml")]
pub struct RunArguments {
    /// Settings; robot.platform names the robot.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
}

/// Arguments of `hachi record`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
The service without a patrol and without a map file: the robot stands, or is driven by its remote \
control. Topics: /velodyne_packets or /rslidar_packets, /imu, /joint_states, /leg_odometry.

Example:
  hachi record --config /etc/hachi/hachi.toml --out drive.mcap --seconds 60
  hachi replay drive.mcap --platform b1 --out out/drive --stage slam")]
pub struct RecordArguments {
    /// Settings; robot.platform names the robot.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// The recording; one that is there already is not touched.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Ends after so long [default: when it is told to stop].
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    pub seconds: Option<f64>,
}

/// Arguments of `hachi simulate`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
A robot that walks as it is told through a simulated world, and the LiDAR on its back, in real time: \
`hachi run` can't tell it from a real one. It prints the addresses it uses.

Example:
  hachi simulate --platform go1 --seconds 60")]
pub struct SimulateArguments {
    /// The robot: b1 or go1.
    #[arg(long, value_name = "NAME", default_value = "b1")]
    pub platform: String,
    /// Where it walks: office, glass-corridor, corridor, building or campus.
    #[arg(long, value_name = "NAME", default_value = "office", value_parser = super::mapping::world)]
    pub world: Preset,
    /// The building and the noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Ends after so long [default: never].
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    pub seconds: Option<f64>,
    /// Where the robot is spoken to; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8082")]
    pub robot: SocketAddr,
    /// Where the LiDAR's packets go.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:2368")]
    pub lidar: SocketAddr,
    /// Settings: which LiDAR, and where it is mounted.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print a line of JSON ten times a second: time, true place, speed, way, commands heard.
    #[arg(long)]
    pub trace: bool,
}

/// Arguments of `hachi top`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  hachi top")]
pub struct TopArguments {
    /// The service, as its settings say under service.listen.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:9470")]
    pub address: SocketAddr,
    /// Print the table once.
    #[arg(long)]
    pub once: bool,
    /// Print one JSON object and end.
    #[arg(long)]
    pub json: bool,
}
