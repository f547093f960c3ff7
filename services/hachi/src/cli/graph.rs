//! Arguments of the commands that work on pose graphs.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// What can be done with a pose graph.
#[derive(Debug, Subcommand)]
#[command(after_help = "Example:\n  hachi graph optimize sphere.g2o --out solved.g2o --solver lm")]
pub enum Graph {
    /// Find the poses that agree best with all edges.
    Optimize(GraphOptimizeArguments),
}

/// Arguments of `hachi graph optimize`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
IN is a g2o file with VERTEX_SE2 and EDGE_SE2, or VERTEX_SE3:QUAT and EDGE_SE3:QUAT lines. Poses that \
only edges name are placed along edges. FIX holds a pose; in a part of the graph without one the pose \
with the smallest number is held. lm and gn start from the file's poses and from the graph's own \
initialisation, and keep the better end; isam2 adds poses one at a time in the order of their numbers, \
as a robot would. Errors are half the sum of r' * information * r over the edges.

Example:
  hachi graph optimize sphere.g2o --out solved.g2o --solver lm --json")]
pub struct GraphOptimizeArguments {
    /// The graph.
    #[arg(value_name = "IN.g2o")]
    pub input: PathBuf,
    /// File for the solved graph.
    #[arg(long, value_name = "OUT.g2o")]
    pub out: PathBuf,
    /// How to solve it.
    #[arg(long, value_enum, default_value_t = SolverArgument::Lm)]
    pub solver: SolverArgument,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// How a graph is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SolverArgument {
    /// Levenberg-Marquardt on all poses at once.
    Lm,
    /// Gauss-Newton on all poses at once.
    Gn,
    /// Incrementally, pose by pose.
    Isam2,
}
