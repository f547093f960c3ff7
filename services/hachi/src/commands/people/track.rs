//! `hachi people track`: everyone, from frame to frame.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

use hachi_bridge::AtomicFile;
use hachi_people::mot::{self, MotLine};
use hachi_people::recording::track_detections;
use hachi_people::track::TrackerConfig;
use serde::Serialize;

use crate::cli::people::PeopleTrackArguments;
use crate::exit::Failure;
use crate::{mot_files, output};

/// Where nothing says how fast frames follow one another: slower than most, so that people may
/// move far from one to the next.
const UNKNOWN_FRAMES_PER_SECOND: f64 = 10.0;

#[derive(Debug, Serialize)]
struct Summary {
    frames: usize,
    detections: usize,
    people: usize,
    boxes: usize,
    frames_per_second: f64,
    /// Without reading and writing files.
    time_ms: f64,
}

/// Runs the command.
///
/// # Errors
/// The detections can't be read, or the tracks can't be written.
pub fn run(arguments: &PeopleTrackArguments) -> Result<(), Failure> {
    let path = detections_of(arguments)?;
    let detections = mot_files::read(path)?;
    let out = AtomicFile::create(&arguments.out).map_err(|e| Failure::unwritten(&e))?;
    let stated = || mot_files::stated_frames_per_second(path.parent()?);
    let frames_per_second = arguments.fps.or_else(stated);
    let frames_per_second = frames_per_second.unwrap_or(UNKNOWN_FRAMES_PER_SECOND);
    let begun = Instant::now();
    let tracks = track_detections(&detections, TrackerConfig::default(), frames_per_second);
    let summary = Summary {
        frames: distinct(&detections, |line| line.frame),
        detections: detections.len(),
        people: distinct(&tracks, |line| line.id),
        boxes: tracks.len(),
        frames_per_second,
        time_ms: begun.elapsed().as_secs_f64() * 1e3,
    };
    write(out, &tracks, &arguments.out)?;
    match arguments.json {
        true => output::json(&summary),
        false => output::text(&format!(
            "{} people in {} of {} frames' boxes ({} detections, {} frames/s), {:.1} ms\ntracks: {}",
            summary.people,
            summary.boxes,
            summary.frames,
            summary.detections,
            summary.frames_per_second,
            summary.time_ms,
            arguments.out.display()
        )),
    }
}

fn detections_of(arguments: &PeopleTrackArguments) -> Result<&Path, Failure> {
    match &arguments.detections {
        Some(file) => Ok(file),
        None if arguments.input.is_dir() => Err(Failure::new(
            format_args!("{} is a folder of frames", arguments.input.display()),
            "give their detections with --detections FILE",
        )),
        None => Ok(&arguments.input),
    }
}

fn distinct<T: Ord>(lines: &[MotLine], key: impl Fn(&MotLine) -> T) -> usize {
    lines.iter().map(key).collect::<BTreeSet<_>>().len()
}

fn write(mut out: AtomicFile, tracks: &[MotLine], path: &Path) -> Result<(), Failure> {
    let mut text = Vec::new();
    mot::write(tracks, &mut text).map_err(|error| Failure::writing(path, &error))?;
    out.write(&text)
        .map_err(|error| Failure::unwritten(&error))?;
    out.commit().map_err(|error| Failure::unwritten(&error))
}
