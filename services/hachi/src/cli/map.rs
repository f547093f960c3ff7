//! Arguments of the commands on saved maps.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// What can be done with a saved map.
#[derive(Debug, Subcommand)]
#[command(after_help = "\
A map is made by `hachi replay --stage slam --map FILE`, and gone on with the same way.

Example:
  hachi map info office.map")]
pub enum Map {
    /// What is in a map.
    Info(MapInfoArguments),
    /// Write a map as cloud, occupancy grid, path and ledger.
    Export(MapExportArguments),
    /// Find a recording's place in a map, with no hint of where it was.
    Localise(MapLocaliseArguments),
    /// Put two maps of one space together.
    Merge(MapMergeArguments),
}

/// Arguments of `hachi map info`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  hachi map info office.map --json")]
pub struct MapInfoArguments {
    /// The map.
    #[arg(value_name = "MAP")]
    pub map: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi map export`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Writes map.ply (all submaps where they belong), grid.pgm and grid.yaml (free and occupied squares, as \
the ROS map server reads them), nodes.tum (the path of the nodes) and loops.csv.

Example:
  hachi map export office.map --out out/office")]
pub struct MapExportArguments {
    /// The map.
    #[arg(value_name = "MAP")]
    pub map: PathBuf,
    /// Folder for the files.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Edge of the cubes of which each gives one point of map.ply, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.05, value_parser = super::metres)]
    pub voxel_m: f64,
    /// Edge of a square of the grid, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.05, value_parser = super::metres)]
    pub resolution_m: f64,
    /// What is lower above the ground than this is floor to the robot, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.12, value_parser = super::metres)]
    pub lowest_m: f64,
    /// What is higher is above the robot, metres.
    #[arg(long, value_name = "METRES", default_value_t = 1.2, value_parser = super::metres)]
    pub highest_m: f64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi map localise`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a recording as `hachi replay` takes it. The map is only read. Ends as soon as the place is \
known for certain, with status 1 if it never is.

Example:
  hachi map localise office.map now.pcap --json")]
pub struct MapLocaliseArguments {
    /// The map.
    #[arg(value_name = "MAP")]
    pub map: PathBuf,
    /// The recording.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// Settings; what the file leaves out keeps its default.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The robot that carried the sensor: where it is mounted.
    #[arg(long, value_name = "NAME")]
    pub platform: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi map merge`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Places of the second map are recognised in the first and proven by alignment; where nothing is \
recognised the maps stay apart, and that is an error. Neither of the two is changed.

Example:
  hachi map merge monday.map tuesday.map --out both.map")]
pub struct MapMergeArguments {
    /// The map that keeps its frame.
    #[arg(value_name = "MAP")]
    pub map: PathBuf,
    /// The map that is laid on it.
    #[arg(value_name = "OTHER")]
    pub other: PathBuf,
    /// The new map.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}
