//! One module for each command: arguments in, files and a summary out.

pub mod decode;
pub mod demo;
pub mod doctor;
pub mod eval_loops;
pub mod eval_registration;
pub mod eval_scenes;
pub mod eval_tracks;
pub mod eval_trajectory;
pub mod graph_optimize;
pub mod map;
pub mod model;
pub mod people;
pub mod replay;
pub mod run;
pub mod simulate;
pub mod top;

use crate::cli::graph::Graph;
use crate::cli::{Command, Eval};
use crate::exit::Failure;

/// Runs a command.
///
/// # Errors
/// What the command could not do, and what the user can.
pub fn dispatch(command: Command) -> Result<(), Failure> {
    match command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Run(arguments) => run::run(&arguments),
        Command::Record(arguments) => run::record(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Top(arguments) => top::run(&arguments),
        Command::Decode(arguments) => decode::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Eval(Eval::Loops(arguments)) => eval_loops::run(&arguments),
        Command::Eval(Eval::Registration(arguments)) => eval_registration::run(&arguments),
        Command::Eval(Eval::Scenes(arguments)) => eval_scenes::run(&arguments),
        Command::Eval(Eval::Tracks(arguments)) => eval_tracks::run(&arguments),
        Command::Eval(Eval::Trajectory(arguments)) => eval_trajectory::run(&arguments),
        Command::Map(command) => map::run(&command),
        Command::Graph(Graph::Optimize(arguments)) => graph_optimize::run(&arguments),
        Command::Model(command) => model::run(&command),
        Command::People(command) => people::run(&command),
        Command::Doctor(arguments) => doctor::run(&arguments),
    }
}
