//! Hachi's program as a library, so that tests drive whole pipelines in their own process.
//!
//! | module | holds |
//! |---|---|
//! | [`cli`] | the command line, word for word |
//! | [`commands`] | one module for each command |
//! | [`exit`] | how a command fails, and the exit status |
//! | [`output`] | standard output: figures for people, one JSON object for programs |
//! | [`interrupt`] | Ctrl-C: a flag that long work looks at between scans |
//! | [`progress`] | progress on a terminal |
//! | [`report`], [`latency`] | `report.json`, and the times that go into it |
//! | [`log`] | logging |
//! | [`mapping`] | the flow from scans to trajectory and map: read it first |
//! | [`recording`], [`motion_samples`], [`leg_samples`] | recordings of any kind as scans and samples |
//! | [`recorder`] | what sensors sent, as a file |
//! | [`record`] | what a run has done so far |
//! | [`service`] | the service on a robot, task by task |
//! | [`service_link`] | a running service, as the commands ask it |
//! | [`config`] | settings |
//! | [`can`], [`imu`] | CAN interfaces of this machine, and the bus of its inertial sensor |
//! | [`map_builder`], [`map_picture`] | the map that people look at |
//! | [`images`] | folders of images |
//! | [`networks`] | which networks find people and tell them apart |
//! | [`people_pictures`] | frames with everybody marked, contact sheets |
//! | [`people_truth`] | whom a simulated picture truly shows |
//! | [`mot_files`] | files of boxes and tracks |
//! | [`precision_recall_picture`] | precision over recall |
//! | [`slam_stage`] | SLAM as a stage of the flow |
//! | [`task_table`] | the task table as people read it |
//! | [`results`] | the files of a run |
//! | [`saved_maps`], [`saved_people`] | saved maps, and the people the robot knows, as the commands open them |

pub mod can;
pub mod cli;
pub mod commands;
pub mod config;
pub mod exit;
pub mod images;
pub mod imu;
pub mod interrupt;
pub mod latency;
pub mod leg_samples;
pub mod log;
pub mod map_builder;
pub mod map_picture;
pub mod mapping;
pub mod mot_files;
pub mod motion_samples;
pub mod networks;
pub mod output;
pub mod people_pictures;
pub mod people_truth;
pub mod precision_recall_picture;
pub mod progress;
pub mod record;
pub mod recorder;
pub mod recording;
pub mod report;
pub mod results;
pub mod saved_maps;
pub mod saved_people;
pub mod service;
pub mod service_link;
pub mod slam_stage;
pub mod task_table;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

/// Runs the program with these arguments (the first is its name); says errors on standard error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match cli::Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return exit::usage(&error),
    };
    // A service that runs for weeks says what happens without being asked.
    use cli::Command::{Record, Run};
    let usual = matches!(cli.command, Run(_) | Record(_)).then_some("info");
    let outcome =
        log::start(cli.log.as_deref(), usual).and_then(|()| commands::dispatch(cli.command));
    exit::status(outcome)
}
