//! Arguments of the commands about people.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// What can be done about people.
#[derive(Debug, Subcommand)]
#[command(after_help = "Example:\n  hachi people track det/det.txt --out tracks.txt")]
pub enum People {
    /// Follow everyone from frame to frame.
    Track(PeopleTrackArguments),
}

/// Arguments of `hachi people track`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a file of MOTChallenge detections (frame, id, left, top, width, height, score), or a folder of \
frames with such a file in --detections. The result has one line for each person in each frame; people \
are followed from the frame in which they were first seen, and gaps of up to a second are filled.

Example:
  hachi people track TUD-Campus/det/det.txt --out campus.txt")]
pub struct PeopleTrackArguments {
    /// Detections, or the folder they belong to.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// File for the tracks, in MOTChallenge's format.
    #[arg(long, value_name = "FILE.txt")]
    pub out: PathBuf,
    /// Detections of the frames in INPUT.
    #[arg(long, value_name = "FILE")]
    pub detections: Option<PathBuf>,
    /// Frames a second [default: what seqinfo.ini beside them says, else 10].
    #[arg(long, value_name = "N", value_parser = frames_per_second)]
    pub fps: Option<f64>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi eval tracks`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Both files are MOTChallenge text. Reference lines with a confidence below 1 are not counted, boxes \
match at IoU 0.5; the numbers are py-motmetrics'.

Example:
  hachi eval tracks --reference gt/gt.txt --estimate tracks.txt --json")]
pub struct EvalTracksArguments {
    /// Who truly was where.
    #[arg(long, value_name = "GT")]
    pub reference: PathBuf,
    /// The tracks to measure.
    #[arg(long, value_name = "FILE")]
    pub estimate: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Frames a second, within what cameras do.
fn frames_per_second(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1000.0).contains(&value) => Ok(value),
        _ => Err("expected a number of frames a second from 0.01 to 1000".to_owned()),
    }
}
