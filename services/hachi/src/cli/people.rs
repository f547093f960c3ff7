//! Arguments of the commands about people.

pub mod enrolled;
pub mod live;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use hachi_inference::Own;
use hachi_world::scenes::Script;

/// What can be done about people.
#[derive(Debug, Subcommand)]
#[command(after_help = "\
Example:
  hachi people track det/det.txt --out tracks.txt
  hachi people enrol Anna pictures-of-anna
  hachi people list
  hachi people watch")]
pub enum People {
    /// Follow everyone from frame to frame.
    Track(PeopleTrackArguments),
    /// Find the person of some pictures in other images.
    Find(PeopleFindArguments),
    /// Who the robot knows.
    List(enrolled::PeopleListArguments),
    /// Make the robot know somebody, from pictures of them or from its camera.
    Enrol(enrolled::PeopleEnrolArguments),
    /// Give somebody another name.
    Rename(enrolled::PeopleRenameArguments),
    /// Write all that is kept of somebody to a folder, for them to take.
    Export(enrolled::PeopleExportArguments),
    /// Forget somebody: nothing of them is left in any file.
    Forget(enrolled::PeopleForgetArguments),
    /// Who a running service has in view, and whom it knows.
    Watch(live::PeopleWatchArguments),
    /// Say who the robot's person is.
    Pick(live::PeoplePickArguments),
    /// The robot has no person any more.
    Release(live::PeopleReleaseArguments),
}

/// Which networks to use.
#[derive(Debug, Clone, Default, Args)]
pub struct NetworkArguments {
    /// Folder of ONNX models with their manifests [default: HACHI_MODELS, else models in HACHI_DATA].
    #[arg(long, value_name = "DIR")]
    pub models: Option<PathBuf>,
    /// The network that finds people [default: the first detector in the folder].
    #[arg(long, value_name = "FILE.onnx")]
    pub detector: Option<PathBuf>,
    /// The network that tells people apart [default: the first one in the folder].
    #[arg(long, value_name = "FILE.onnx")]
    pub reid: Option<PathBuf>,
}

impl NetworkArguments {
    /// The two that are part of the program: for the simulated world, which is all they have seen.
    pub fn own() -> Self {
        let named = |own: Own| Some(PathBuf::from(own.name()));
        Self {
            models: None,
            detector: named(Own::Detector),
            reid: named(Own::ReId),
        }
    }

    /// These, or the program's own where none is named.
    #[must_use]
    pub fn or_own(&self) -> Self {
        match (&self.models, &self.detector, &self.reid) {
            (None, None, None) => Self::own(),
            _ => self.clone(),
        }
    }
}

/// Arguments of `hachi people track`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a folder of JPEG or PNG frames, in which people are found by a network, or a file of \
MOTChallenge detections (frame, id, left, top, width, height, score). The result has one line for each \
person in each frame; people are followed from the frame in which they were first seen, and gaps of up \
to a second are filled.

Example:
  hachi people track frames --models models --out tracks.txt
  hachi people track TUD-Campus/det/det.txt --out campus.txt")]
pub struct PeopleTrackArguments {
    /// Frames, or detections.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// File for the tracks, in MOTChallenge's format.
    #[arg(long, value_name = "FILE.txt")]
    pub out: PathBuf,
    /// Detections of the frames in INPUT: no network is run then.
    #[arg(long, value_name = "FILE")]
    pub detections: Option<PathBuf>,
    /// Frames a second [default: what seqinfo.ini beside them says, else 10].
    #[arg(long, value_name = "N", value_parser = frames_per_second)]
    pub fps: Option<f64>,
    /// Draw every frame with everybody marked into this folder, and some of them on one sheet.png.
    #[arg(long, value_name = "DIR", conflicts_with = "detections")]
    pub pictures: Option<PathBuf>,
    /// The networks for frames.
    #[command(flatten)]
    pub networks: NetworkArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi people find`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Pictures of the person are crops, or images in which the largest person is meant. In each frame of \
INPUT, a folder of images or one image, the person who looks most like them is found, unless nobody \
looks alike enough.

Example:
  hachi people find --query anna1.jpg anna2.jpg frames --json")]
pub struct PeopleFindArguments {
    /// Pictures of the person; where INPUT does not stand before, the last one is INPUT.
    #[arg(long, value_name = "IMG", required = true, num_args = 1..)]
    pub query: Vec<PathBuf>,
    /// A folder of images, or one.
    #[arg(value_name = "INPUT")]
    pub input: Option<PathBuf>,
    /// How far features of one person may lie apart (1 - cosine) [default: what the manifest says].
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    pub max_distance: Option<f64>,
    /// The networks.
    #[command(flatten)]
    pub networks: NetworkArguments,
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

/// Arguments of `hachi eval scenes`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Simulated people walk, cross, leave, come back and change their clothes for two to three minutes a \
scene. One of them is picked after three seconds; from then on it is measured for how much of the time \
in view they are followed, how often and how soon they are known again, and for how long somebody else \
is followed: by the track alone, by FollowMe's calibration, by CARPE-ID, on the same tracks. Unless \
others are named, the networks are the program's own, which know the simulated world alone. Scenes: \
return, crossing, jacket, wardrobe, similar, twin, light, crowd, far, turning.

Example:
  hachi eval scenes --seed 1 --json")]
pub struct EvalScenesArguments {
    /// Which scenes [default: all].
    #[arg(long, value_name = "NAME", num_args = 1.., value_parser = scene)]
    pub scenes: Vec<Script>,
    /// Who plays, in which clothes, and where exactly.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Only so much of each scene, seconds [default: all of it].
    #[arg(long, value_name = "S", value_parser = super::seconds)]
    pub seconds: Option<f64>,
    /// Draw twelve frames of each scene with everybody marked, NAME.png, into this folder.
    #[arg(long, value_name = "DIR")]
    pub pictures: Option<PathBuf>,
    /// The networks.
    #[command(flatten)]
    pub networks: NetworkArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

fn scene(name: &str) -> Result<Script, String> {
    Script::from_name(name).ok_or_else(|| {
        let names = Script::ALL.map(Script::name);
        format!("expected one of {}", names.join(", "))
    })
}

/// A distance between features.
fn distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 => Ok(value),
        _ => Err("expected a number from 0 (the same) to 2 (opposite)".to_owned()),
    }
}

/// Frames a second, within what cameras do.
fn frames_per_second(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=1000.0).contains(&value) => Ok(value),
        _ => Err("expected a number of frames a second from 0.01 to 1000".to_owned()),
    }
}
