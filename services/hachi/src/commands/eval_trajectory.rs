//! `hachi eval trajectory`: absolute and relative pose error of one trajectory against another.

use std::fmt::Write as _;
use std::path::Path;

use hachi_trajectory::plot::Plot;
use hachi_trajectory::read::{self, Loaded, ReadError};
use hachi_trajectory::{
    Alignment, AlignmentError, AssociationError, Evaluation, EvaluationError, EvaluationOptions,
    Observed, RelativeDelta, Statistics, Trajectory, evaluate,
};
use serde::Serialize;

use crate::cli::{AlignArgument, EvalTrajectoryArguments};
use crate::exit::Failure;
use crate::output;

/// Measures, draws, prints.
///
/// # Errors
/// A file that can't be read, trajectories that can't be compared, a picture that can't be written.
pub fn run(arguments: &EvalTrajectoryArguments) -> Result<(), Failure> {
    let options = options(arguments);
    let reference = load(&arguments.reference)?;
    let estimate = load(&arguments.estimate)?;
    let evaluation = evaluate(&reference.trajectory, &estimate.trajectory, &options)
        .map_err(|error| incomparable(arguments, &error))?;
    let asked = arguments.rpe_delta_m.is_some() || arguments.rpe_delta_frames.is_some();
    if asked && evaluation.rpe.is_none() {
        return Err(no_stretch(&evaluation));
    }
    let summary = Summary::of(arguments, &options, &reference, &estimate, &evaluation);
    if let Some(path) = &arguments.plot {
        draw(path, arguments, &reference.trajectory, &evaluation)?;
    }
    if arguments.json {
        output::json(&summary)
    } else {
        output::text(&summary.for_people(arguments))
    }
}

fn options(arguments: &EvalTrajectoryArguments) -> EvaluationOptions {
    EvaluationOptions {
        alignment: match arguments.align {
            AlignArgument::None => Alignment::None,
            AlignArgument::Se3 => Alignment::Se3,
            AlignArgument::Sim3 => Alignment::Sim3,
        },
        max_difference_s: arguments.max_diff_s,
        relative_delta: match (arguments.rpe_delta_m, arguments.rpe_delta_frames) {
            (Some(metres), _) => RelativeDelta::Metres(metres),
            (None, Some(frames)) => RelativeDelta::Frames(frames),
            (None, None) => RelativeDelta::default(),
        },
    }
}

fn load(path: &Path) -> Result<Loaded, Failure> {
    read::from_file(path).map_err(|error| {
        let next_step = match &error {
            ReadError::Io(_) => "check the name and that you may read it",
            ReadError::Empty => "give a trajectory with poses (TUM, KITTI or EuRoC)",
            _ => "mend that line, or give a trajectory in TUM, KITTI or EuRoC format",
        };
        Failure::new(format_args!("{}: {error}", path.display()), next_step)
    })
}

fn incomparable(arguments: &EvalTrajectoryArguments, error: &EvaluationError) -> Failure {
    let next_step = match error {
        EvaluationError::Association(AssociationError::NoOverlap { .. }) => {
            "check that both use one clock, or raise --max-diff-s"
        }
        EvaluationError::Association(AssociationError::Counts { .. }) => {
            "give files with one line for each frame, or with times"
        }
        EvaluationError::Alignment(AlignmentError::NoScale) => "use --align se3",
        _ => "check the files",
    };
    let files = (arguments.estimate.display(), arguments.reference.display());
    Failure::new(
        format_args!("{} can't be compared with {}: {error}", files.0, files.1),
        next_step,
    )
}

fn no_stretch(evaluation: &Evaluation) -> Failure {
    Failure::new(
        format_args!(
            "the estimate is too short for relative errors over that delta ({} paired poses, {:.3} m)",
            evaluation.estimate.len(),
            evaluation.estimate.path_length_m()
        ),
        "give a smaller --rpe-delta-m or --rpe-delta-frames",
    )
}

fn draw(
    path: &Path,
    arguments: &EvalTrajectoryArguments,
    reference: &Trajectory,
    evaluation: &Evaluation,
) -> Result<(), Failure> {
    let ape = &evaluation.ape;
    let svg = Plot {
        title: &format!(
            "{} against {}",
            file_name(&arguments.estimate),
            file_name(&arguments.reference)
        ),
        subtitle: &format!(
            "absolute pose error: rmse {:.3} m, mean {:.3} m, max {:.3} m over {} poses, alignment {}",
            ape.rmse,
            ape.mean,
            ape.max,
            ape.n,
            name(arguments.align)
        ),
        estimate: &evaluation.estimate,
        reference: Some(reference),
        errors_m: Some(&evaluation.errors_m),
        links: &[],
    }
    .to_svg()
    .map_err(|error| Failure::new(error, "check the positions in both files"))?;
    hachi_bridge::write_file(path, svg.as_bytes()).map_err(|error| Failure::unwritten(&error))
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

fn name(align: AlignArgument) -> &'static str {
    match align {
        AlignArgument::None => "none",
        AlignArgument::Se3 => "se3",
        AlignArgument::Sim3 => "sim3",
    }
}

/// What is printed.
#[derive(Serialize)]
struct Summary {
    ape: Statistics,
    rpe: Option<Statistics>,
    /// With the stretch from the first pose (evo 1.38); given where it differs from `rpe`.
    #[serde(skip_serializing_if = "Option::is_none")]
    rpe_from_first_pose: Option<Statistics>,
    align: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    rpe_delta_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rpe_delta_frames: Option<usize>,
    scale: f64,
    /// Takes the estimate to the reference: rotation (without scale) and translation, row-major 4x4.
    reference_from_estimate: [f64; 16],
    reference: FileSummary,
    estimate: FileSummary,
    notes: Vec<String>,
}

/// One of the two files.
#[derive(Serialize)]
struct FileSummary {
    format: read::Format,
    poses: usize,
    duration_s: f64,
    path_length_m: f64,
    reordered: usize,
    repeated: usize,
    normalised: usize,
}

impl FileSummary {
    fn of(loaded: &Loaded) -> Self {
        let trajectory = &loaded.trajectory;
        Self {
            format: loaded.format,
            poses: trajectory.len(),
            duration_s: trajectory.duration_s(),
            path_length_m: trajectory.path_length_m(),
            reordered: loaded.repairs.reordered,
            repeated: loaded.repairs.repeated,
            normalised: loaded.repairs.normalised,
        }
    }

    fn notes(&self, which: &str) -> Vec<String> {
        let counts = [
            (
                self.reordered,
                "poses were out of order in time and were sorted in",
            ),
            (
                self.repeated,
                "poses repeated a time; the last of each stayed",
            ),
            (
                self.normalised,
                "quaternions were not of unit length and were normalised",
            ),
        ];
        let said = counts.iter().filter(|(count, _)| *count > 0);
        said.map(|(count, what)| format!("{which}: {count} {what}"))
            .collect()
    }
}

impl Summary {
    fn of(
        arguments: &EvalTrajectoryArguments,
        options: &EvaluationOptions,
        reference: &Loaded,
        estimate: &Loaded,
        evaluation: &Evaluation,
    ) -> Self {
        let similarity = &evaluation.reference_from_estimate;
        let rotation = similarity.rotation.to_rotation_matrix();
        let (r, t) = (rotation.matrix(), similarity.translation);
        let files = (FileSummary::of(reference), FileSummary::of(estimate));
        let mut notes = files.0.notes("reference");
        notes.extend(files.1.notes("estimate"));
        notes.extend(unobserved(evaluation.observed).map(str::to_owned));
        let (rpe_delta_m, rpe_delta_frames) = match options.relative_delta {
            RelativeDelta::Metres(metres) => (Some(metres), None),
            RelativeDelta::Frames(frames) => (None, Some(frames.get())),
        };
        Self {
            ape: evaluation.ape,
            rpe: evaluation.rpe,
            rpe_from_first_pose: evaluation
                .rpe_from_first_pose
                .filter(|_| rpe_delta_m.is_some()),
            align: name(arguments.align),
            rpe_delta_m,
            rpe_delta_frames,
            scale: similarity.scale,
            #[rustfmt::skip]
            reference_from_estimate: [
                r[(0, 0)], r[(0, 1)], r[(0, 2)], t.x,
                r[(1, 0)], r[(1, 1)], r[(1, 2)], t.y,
                r[(2, 0)], r[(2, 1)], r[(2, 2)], t.z,
                0.0, 0.0, 0.0, 1.0,
            ],
            reference: files.0,
            estimate: files.1,
            notes,
        }
    }

    fn for_people(&self, arguments: &EvalTrajectoryArguments) -> String {
        let mut text = String::new();
        // Writing to a String can't fail.
        let mut line = |content: String| {
            let _ = writeln!(text, "{content}");
        };
        for (which, path, file) in [
            ("reference", &arguments.reference, &self.reference),
            ("estimate ", &arguments.estimate, &self.estimate),
        ] {
            let duration = match file.format.has_times() {
                true => format!("{:.1} s", file.duration_s),
                false => "no times".to_owned(),
            };
            line(format!(
                "{which}  {} ({}): {} poses, {duration}, {:.2} m",
                path.display(),
                file.format,
                file.poses,
                file.path_length_m
            ));
        }
        match self.align {
            "sim3" => line(format!("alignment  sim3, scale {:.6}", self.scale)),
            other => line(format!("alignment  {other}")),
        }
        line(String::new());
        line(format!(
            "{:<22} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10} {:>7}",
            "metres", "rmse", "mean", "median", "std", "min", "max", "n"
        ));
        let delta = match (self.rpe_delta_m, self.rpe_delta_frames) {
            (Some(metres), _) => format!("rpe over {metres} m"),
            (None, Some(1)) => "rpe over 1 frame".to_owned(),
            (None, frames) => format!("rpe over {} frames", frames.unwrap_or(1)),
        };
        let rows = [
            ("ape", Some(&self.ape)),
            (delta.as_str(), self.rpe.as_ref()),
            ("  from first pose", self.rpe_from_first_pose.as_ref()),
        ];
        for (name, s) in rows.iter().filter_map(|(name, s)| Some((name, (*s)?))) {
            line(format!(
                "{name:<22} {:>10.6} {:>10.6} {:>10.6} {:>10.6} {:>10.6} {:>10.6} {:>7}",
                s.rmse, s.mean, s.median, s.std, s.min, s.max, s.n
            ));
        }
        for note in &self.notes {
            line(format!("note: {note}"));
        }
        if let Some(plot) = &arguments.plot {
            line(format!("drawn to {}", plot.display()));
        }
        text
    }
}

fn unobserved(observed: Observed) -> Option<&'static str> {
    match observed {
        Observed::Full => None,
        Observed::Line => Some(
            "the paths are straight: the rotation about them is arbitrary (position errors do not depend on it)",
        ),
        Observed::Point => Some("the robot did not move: only the shift was aligned"),
    }
}
