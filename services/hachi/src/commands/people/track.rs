//! `hachi people track`: everyone, from frame to frame.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use hachi_bridge::AtomicFile;
use hachi_people::mot::{self, MotLine};
use hachi_people::recording::{TrackHistory, longest_gap, track_detections};
use hachi_people::track::{Frame, Tracker, TrackerConfig};
use serde::Serialize;

use crate::cli::people::PeopleTrackArguments;
use crate::exit::Failure;
use crate::images::Rgb;
use crate::interrupt::Cancelled;
use crate::people_pictures::{ContactSheet, Labels, annotate, write_png};
use crate::{images, mot_files, networks, output, progress};

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
    /// Images that could not be read or looked at.
    unreadable: usize,
    /// Without reading detections and writing tracks.
    time_ms: f64,
}

/// Runs the command.
///
/// # Errors
/// The input can't be read, there is no network, or the tracks can't be written.
pub fn run(arguments: &PeopleTrackArguments) -> Result<(), Failure> {
    // A place that can't be written is better known before the work than after it.
    let out = AtomicFile::create(&arguments.out).map_err(|e| Failure::unwritten(&e))?;
    let near = arguments.detections.as_ref().unwrap_or(&arguments.input);
    let frames_per_second = arguments
        .fps
        .or_else(|| mot_files::stated_frames_per_second(near))
        .unwrap_or(UNKNOWN_FRAMES_PER_SECOND);
    let (tracks, mut summary) = match &arguments.detections {
        None if arguments.input.is_dir() => through_images(arguments, frames_per_second)?,
        None => through_detections(&arguments.input, frames_per_second)?,
        Some(file) => through_detections(file, frames_per_second)?,
    };
    summary.people = tracks
        .iter()
        .map(|line| line.id)
        .collect::<BTreeSet<_>>()
        .len();
    summary.boxes = tracks.len();
    write(out, &tracks)?;
    match arguments.json {
        true => output::json(&summary),
        false => output::text(&text(&summary, &arguments.out)),
    }
}

fn through_detections(
    path: &Path,
    frames_per_second: f64,
) -> Result<(Vec<MotLine>, Summary), Failure> {
    let detections = mot_files::read(path)?;
    let begun = Instant::now();
    let tracks = track_detections(&detections, TrackerConfig::default(), frames_per_second);
    let frames = detections
        .iter()
        .map(|line| line.frame)
        .collect::<BTreeSet<_>>();
    let summary = Summary {
        frames: frames.len(),
        detections: detections.len(),
        people: 0,
        boxes: 0,
        frames_per_second,
        unreadable: 0,
        time_ms: begun.elapsed().as_secs_f64() * 1e3,
    };
    Ok((tracks, summary))
}

fn through_images(
    arguments: &PeopleTrackArguments,
    frames_per_second: f64,
) -> Result<(Vec<MotLine>, Summary), Failure> {
    let frames = images::frames(&arguments.input)?;
    let mut observer = networks::observer(&arguments.networks)?;
    let cancelled = Cancelled::on_interrupt()?;
    let mut tracker = Tracker::new(TrackerConfig {
        even_score: observer.even_score(),
        ..TrackerConfig::default()
    });
    let mut history = TrackHistory::default();
    let mut pictures = match &arguments.pictures {
        Some(folder) => Some(Pictures::into_folder(folder, frames.len())?),
        None => None,
    };
    let (mut detections, mut unreadable) = (0, 0);
    let begun = Instant::now();
    let bar = progress::bar(Some(frames.len() as u64), "frames");
    let mut last = None;
    for frame in &frames {
        if cancelled.is_cancelled() {
            return Err(Failure::Interrupted("no tracks were written".to_owned()));
        }
        bar.inc(1);
        let mut unwritten = None;
        let image = images::read(&frame.path);
        let observation = image.and_then(|image| {
            let view = image.view().map_err(|e| e.to_string())?;
            let observed = observer.observe(&view).map_err(|e| e.to_string())?;
            let since = last.map_or(1, |last: u64| frame.number - last);
            last = Some(frame.number);
            detections += observed.detections.len();
            tracker.step(&Frame {
                dt_s: since as f64 / frames_per_second,
                detections: observed.detections,
                features: observed.features,
            });
            history.note(frame.number, tracker.tracks());
            if let Some(pictures) = &mut pictures {
                let labels = Labels {
                    tracks: tracker.tracks(),
                    statuses: &[],
                    found: observer.found(),
                    caption: &frame.number.to_string(),
                };
                unwritten = pictures.draw(frame.number, &annotate(&view, &labels)).err();
            }
            Ok(())
        });
        if let Err(reason) = observation {
            tracing::warn!(file = %frame.path.display(), %reason, "frame left out");
            unreadable += 1;
        }
        if let Some(failure) = unwritten {
            return Err(failure);
        }
    }
    bar.finish_and_clear();
    if let Some(pictures) = &pictures {
        pictures.finish()?;
    }
    if unreadable == frames.len() {
        return Err(Failure::new(
            format_args!("no frame of {} can be looked at", arguments.input.display()),
            "see why with --log warn",
        ));
    }
    let tracks = history.finish(longest_gap(frames_per_second));
    let known: BTreeSet<u64> = frames.iter().map(|frame| frame.number).collect();
    // Between the frames of a thinned-out recording there is nothing to draw a box on.
    let drawn = tracks
        .into_iter()
        .filter(|line| known.contains(&line.frame));
    let tracks = drawn.map(counted_from_1).collect();
    let summary = Summary {
        frames: frames.len(),
        detections,
        people: 0,
        boxes: 0,
        frames_per_second,
        unreadable,
        time_ms: begun.elapsed().as_secs_f64() * 1e3,
    };
    Ok((tracks, summary))
}

/// Frames with everybody marked, as files, and some of them on one sheet.
struct Pictures {
    folder: PathBuf,
    sheet: ContactSheet,
    /// Every so many frames one goes on the sheet.
    every: usize,
    count: usize,
}

/// Pictures on the sheet, and in a row.
const ON_SHEET: usize = 12;
const COLUMNS: usize = 3;

impl Pictures {
    fn into_folder(folder: &Path, frames: usize) -> Result<Self, Failure> {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::new(
                format_args!("{} can't be made: {error}", folder.display()),
                "choose another folder with --pictures",
            )
        })?;
        Ok(Self {
            folder: folder.to_owned(),
            sheet: ContactSheet::new(COLUMNS),
            every: frames.div_ceil(ON_SHEET).max(1),
            count: 0,
        })
    }

    fn draw(&mut self, number: u64, picture: &Rgb) -> Result<(), Failure> {
        if self.count % self.every == self.every / 2 {
            self.sheet.push(picture);
        }
        self.count += 1;
        write_png(&self.folder.join(format!("{number:06}.png")), picture)
    }

    fn finish(&self) -> Result<(), Failure> {
        self.sheet.write(&self.folder.join("sheet.png"))
    }
}

/// MOTChallenge counts pixels from 1, networks from 0.
fn counted_from_1(mut line: MotLine) -> MotLine {
    line.bounding_box.left += 1.0;
    line.bounding_box.top += 1.0;
    line
}

fn text(summary: &Summary, out: &Path) -> String {
    let mut text = format!(
        "{} people, {} boxes in {} frames ({} detections, {} frames/s), {:.1} ms a frame\n",
        summary.people,
        summary.boxes,
        summary.frames,
        summary.detections,
        summary.frames_per_second,
        summary.time_ms / summary.frames.max(1) as f64,
    );
    if summary.unreadable > 0 {
        text += &format!("{} frames could not be looked at\n", summary.unreadable);
    }
    text + &format!("tracks: {}", out.display())
}

fn write(mut out: AtomicFile, tracks: &[MotLine]) -> Result<(), Failure> {
    let mut text = Vec::new();
    // Writing to a Vec can't fail.
    let _ = mot::write(tracks, &mut text);
    out.write(&text)
        .map_err(|error| Failure::unwritten(&error))?;
    out.commit().map_err(|error| Failure::unwritten(&error))
}
