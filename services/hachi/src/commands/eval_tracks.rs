//! `hachi eval tracks`: how well people were followed.

use hachi_people::metrics::{MetricsError, TrackMetrics, evaluate};

use crate::cli::people::EvalTracksArguments;
use crate::exit::Failure;
use crate::{mot_files, output};

/// Runs the command.
///
/// # Errors
/// A file can't be read, or the two can't be compared.
pub fn run(arguments: &EvalTracksArguments) -> Result<(), Failure> {
    let reference = mot_files::read(&arguments.reference)?;
    let estimate = mot_files::read(&arguments.estimate)?;
    let metrics = evaluate(&reference, &estimate).map_err(|error| {
        let next_step = match error {
            MetricsError::NoTruth => "give ground truth with confidence 1 in the seventh column",
            MetricsError::Twice { .. } => "give tracks: each id once in a frame",
            _ => "split the files",
        };
        let files = (arguments.estimate.display(), arguments.reference.display());
        Failure::new(
            format_args!("{} can't be compared with {}: {error}", files.0, files.1),
            next_step,
        )
    })?;
    match arguments.json {
        true => output::json(&metrics),
        false => output::text(&text(&metrics)),
    }
}

fn text(m: &TrackMetrics) -> String {
    format!(
        "MOTA {:.1} %  IDF1 {:.1} %  (recall {:.1}, precision {:.1})\n\
         IDs {}  FP {}  FN {}  MT {}  ML {}\n\
         {} people, {} boxes in the reference, {} in the estimate, {} frames",
        100.0 * m.mota,
        100.0 * m.idf1,
        100.0 * m.recall,
        100.0 * m.precision,
        m.ids,
        m.fp,
        m.r#fn,
        m.mt,
        m.ml,
        m.people,
        m.truth_boxes,
        m.estimate_boxes,
        m.frames
    )
}
