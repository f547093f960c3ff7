//! The command line, word for word. Scripts rely on it: a change needs a line in the changelog.
//!
//! Only the shape of arguments is here; what they do is in [`commands`](crate::commands).

pub mod graph;
pub mod loops;
pub mod map;
pub mod mapping;
pub mod model;
pub mod people;
pub mod service;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Contextual awareness for robots: where it is, and what the space around it looks like.
#[derive(Debug, Parser)]
#[command(name = "hachi", version, arg_required_else_help = true)]
#[command(
    after_help = "Example:\n  hachi doctor\n\nEvery command has its own --help with an example."
)]
pub struct Cli {
    /// Log to standard error: off, error, warn, info, debug, trace, or levels by module
    /// (hachi=debug). HACHI_LOG does the same.
    #[arg(long, global = true, value_name = "FILTER")]
    pub log: Option<String>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Walk a simulated robot through a building and map it. Needs nothing plugged in.
    Demo(mapping::DemoArguments),
    /// Run the service on a robot: map, know where it is, go where it shall, stop in time.
    Run(service::RunArguments),
    /// Keep what a robot's LiDAR and legs send in an MCAP file.
    Record(service::RecordArguments),
    /// Be a robot and its LiDAR, in real time, for `hachi run` to be tried on.
    Simulate(service::SimulateArguments),
    /// Show the tasks of a running service, live.
    Top(service::TopArguments),
    /// Turn captured packets into one cloud file per turn.
    Decode(mapping::DecodeArguments),
    /// Map a recording: trajectory, map, picture and report.
    Replay(mapping::ReplayArguments),
    /// Measure results against a reference.
    #[command(subcommand)]
    Eval(Eval),
    /// Look into saved maps, export them, find a place in them, put them together.
    #[command(subcommand)]
    Map(map::Map),
    /// Work on pose graphs.
    #[command(subcommand)]
    Graph(graph::Graph),
    /// Follow people in images.
    #[command(subcommand)]
    People(people::People),
    /// Check neural networks.
    #[command(subcommand)]
    Model(model::Model),
    /// Check what is installed, what can be opened, and what rights hachi has here.
    Doctor(DoctorArguments),
}

/// What can be measured.
#[derive(Debug, Subcommand)]
#[command(
    after_help = "Example:\n  hachi eval trajectory --reference truth.tum --estimate trajectory.tum"
)]
pub enum Eval {
    /// Precision and recall of place recognition on keyframe scans.
    Loops(loops::EvalLoopsArguments),
    /// Align two clouds with GICP.
    Registration(mapping::EvalRegistrationArguments),
    /// How well one person is known again through ten scripted scenes.
    Scenes(people::EvalScenesArguments),
    /// How well people were followed: MOTA, IDF1 and their parts.
    Tracks(people::EvalTracksArguments),
    /// Absolute and relative pose error of a trajectory, as evo computes them.
    Trajectory(EvalTrajectoryArguments),
}

/// Arguments of `hachi eval trajectory`.
#[derive(Debug, Args)]
#[command(after_help = "\
Files are TUM, KITTI or EuRoC csv, recognised by content. KITTI poses have no times and are compared \
by index.

Example:
  hachi eval trajectory --reference truth.tum --estimate out/trajectory.tum --align se3 --plot error.svg")]
pub struct EvalTrajectoryArguments {
    /// What the trajectory should have been.
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// The trajectory to measure.
    #[arg(long, value_name = "FILE")]
    pub estimate: PathBuf,
    /// Lay the estimate over the reference first: rotate and shift (se3), scale as well (sim3).
    #[arg(long, value_enum, default_value_t = AlignArgument::None)]
    pub align: AlignArgument,
    /// How far apart in time two poses of a pair may be, seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01, value_parser = seconds)]
    pub max_diff_s: f64,
    /// Take relative errors over so many metres of the estimate.
    #[arg(long, value_name = "METRES", conflicts_with = "rpe_delta_frames", value_parser = metres)]
    pub rpe_delta_m: Option<f64>,
    /// Take relative errors over so many poses [default: 1].
    #[arg(long, value_name = "FRAMES")]
    pub rpe_delta_frames: Option<NonZeroUsize>,
    /// Draw both trajectories and the error to this SVG file.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// How a trajectory is laid over its reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AlignArgument {
    /// As it is.
    None,
    /// Rotated and shifted.
    Se3,
    /// Rotated, shifted and scaled.
    Sim3,
}

/// Arguments of `hachi doctor`.
#[derive(Debug, Args)]
#[command(after_help = "\
Ends with status 1 if something that live LiDAR mapping needs is missing.

Example:
  hachi doctor --json")]
pub struct DoctorArguments {
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Seconds, zero or more.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("expected a number of seconds, 0 or more".to_owned()),
    }
}

/// Metres, more than zero.
pub(crate) fn metres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number of metres, more than 0".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_has_an_example() {
        fn check(command: &clap::Command) {
            let name = command.get_name();
            let help = command.get_after_help().map(ToString::to_string);
            assert!(
                help.is_some_and(|h| h.contains("Example:\n  hachi")),
                "{name}"
            );
            command.get_subcommands().for_each(check);
        }
        check(&Cli::command());
    }
}
