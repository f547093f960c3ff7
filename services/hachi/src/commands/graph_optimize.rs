//! `hachi graph optimize`: the poses that agree best with all edges of a g2o file.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use hachi_bridge::{AtomicFile, WriteError};
use hachi_posegraph::batch::{Method, Options};
use hachi_posegraph::g2o::{self, Contents, Document, ReadError, Repairs, Writable};
use hachi_posegraph::initialise::{self, Rigid, Start};
use hachi_posegraph::replay::Replay;
use hachi_posegraph::{Error, FactorKind, Graph, Isam2, Isam2Config};
use hachi_runtime::Histogram;
use serde::Serialize;

use crate::cli::graph::{GraphOptimizeArguments, SolverArgument};
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::{output, progress};

/// Updates after the last pose, which take up what it left: as many as the peers are given.
const CLOSING_UPDATES: usize = 5;

#[derive(Debug, Serialize)]
struct Outcome {
    solver: &'static str,
    poses: usize,
    edges: usize,
    /// Edges between poses whose numbers are no neighbours.
    loops: usize,
    initial_error: f64,
    final_error: f64,
    iterations: usize,
    converged: bool,
    /// Without reading and writing files.
    time_ms: f64,
    initialised_from: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    update_ms: Option<UpdateTimes>,
    repairs: Repaired,
}

#[derive(Debug, Serialize)]
struct UpdateTimes {
    median: f64,
    p99: f64,
    max: f64,
}

/// [`Repairs`] under the names of the report.
#[derive(Debug, Serialize)]
struct Repaired {
    duplicate_vertices: usize,
    duplicate_edges: usize,
    missing_vertices: usize,
    scaled_quaternions: usize,
    clipped_information: usize,
    unknown_fixed: usize,
    loose_parts: usize,
    unknown_tags: std::collections::BTreeMap<String, usize>,
}

/// Runs the command.
///
/// # Errors
/// The graph can't be read or solved, the result can't be written, or the user stopped it.
pub fn run(arguments: &GraphOptimizeArguments) -> Result<(), Failure> {
    let document = read(&arguments.input)?;
    // A place that can't be written is better known before an hour of work than after it.
    let out = AtomicFile::create(&arguments.out).map_err(|e| Failure::unwritten(&e))?;
    let outcome = match document {
        Document::Plane(contents) => solve(contents, arguments, out)?,
        Document::Space(contents) => solve(contents, arguments, out)?,
    };
    if arguments.json {
        output::json(&outcome)
    } else {
        output::text(&text(&outcome, &arguments.out))
    }
}

fn read(path: &Path) -> Result<Document, Failure> {
    let unread =
        |error: &dyn std::fmt::Display| format!("{} can't be read: {error}", path.display());
    let file = File::open(path)
        .map_err(|error| Failure::new(unread(&error), "give a g2o file that you may read"))?;
    g2o::read(BufReader::new(file)).map_err(|error| match error {
        ReadError::Line { .. } => Failure::new(
            format_args!("{}, {error}", path.display()),
            "mend or remove that line",
        ),
        ReadError::Empty { .. } => Failure::new(
            format_args!("{} holds {error}", path.display()),
            "give a file with VERTEX_SE2, VERTEX_SE3:QUAT, EDGE_SE2 or EDGE_SE3:QUAT lines",
        ),
        _ => Failure::new(unread(&error), "check the disk or give another file"),
    })
}

fn solve<G: Rigid + Writable>(
    mut contents: Contents<G>,
    arguments: &GraphOptimizeArguments,
    out: AtomicFile,
) -> Result<Outcome, Failure> {
    let has_poses = !contents.vertices.is_empty();
    let unsolved = |error: Error| unsolved(&arguments.input, error);
    let mut graph = contents.graph().map_err(unsolved)?;
    let loops = graph
        .factors()
        .filter(|(_, f)| f.kind() == FactorKind::Loop);
    let mut outcome = Outcome {
        solver: "",
        poses: graph.len(),
        edges: contents.edges.len(),
        loops: loops.count(),
        initial_error: graph.squared_error(),
        final_error: 0.0,
        iterations: 0,
        converged: true,
        time_ms: 0.0,
        initialised_from: if has_poses { "file" } else { "spanning tree" },
        update_ms: None,
        repairs: repaired(contents.repairs),
    };
    contents.vertices = Vec::new();
    contents.edges = Vec::new();
    let begun = Instant::now();
    match arguments.solver {
        SolverArgument::Lm => {
            outcome.solver = "lm";
            at_once(
                &mut graph,
                has_poses,
                Method::LevenbergMarquardt,
                &mut outcome,
            )
            .map_err(unsolved)?;
            outcome.time_ms = begun.elapsed().as_secs_f64() * 1e3;
        }
        SolverArgument::Gn => {
            outcome.solver = "gn";
            at_once(&mut graph, has_poses, Method::GaussNewton, &mut outcome).map_err(unsolved)?;
            outcome.time_ms = begun.elapsed().as_secs_f64() * 1e3;
        }
        SolverArgument::Isam2 => {
            outcome.solver = "isam2";
            pose_by_pose(&mut graph, &mut outcome, &arguments.input)?;
        }
    }
    outcome.final_error = graph.squared_error();
    write(&graph, out)?;
    Ok(outcome)
}

/// Gauss-Newton or Levenberg-Marquardt from the best start.
fn at_once<G: Rigid>(
    graph: &mut Graph<G>,
    has_poses: bool,
    method: Method,
    outcome: &mut Outcome,
) -> Result<(), Error> {
    let options = Options {
        method,
        ..Options::default()
    };
    let (start, report) = initialise::optimize_from_best(graph, has_poses, &options)?;
    outcome.iterations = report.iterations;
    outcome.converged = report.converged;
    outcome.initialised_from = match start {
        Start::Given => "file",
        Start::SpanningTree => "spanning tree",
        Start::Rotations => "rotations",
    };
    Ok(())
}

/// iSAM2, as a robot would have met the graph.
fn pose_by_pose<G: Rigid>(
    graph: &mut Graph<G>,
    outcome: &mut Outcome,
    input: &Path,
) -> Result<(), Failure> {
    let cancelled = Cancelled::on_interrupt()?;
    let bar = progress::bar(Some(graph.len() as u64), "poses");
    let mut isam = Isam2::new(Isam2Config::default());
    let mut replay = Replay::new(graph);
    let times = Histogram::new();
    let mut total = Duration::ZERO;
    while let Some(step) = replay.next_step(&isam) {
        if cancelled.is_cancelled() {
            let done = format!("{} of {} poses were added", isam.len(), graph.len());
            return Err(Failure::Interrupted(done));
        }
        let begun = Instant::now();
        isam.update(&step.factors, &[(step.key, step.pose)], &[])
            .map_err(|error| unsolved(input, error))?;
        let took = begun.elapsed();
        times.record(took);
        total += took;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let begun = Instant::now();
    for _ in 0..CLOSING_UPDATES {
        isam.update(&[], &[], &[])
            .map_err(|error| unsolved(input, error))?;
    }
    total += begun.elapsed();
    for (key, pose) in isam.estimates() {
        graph
            .set_pose(key, pose)
            .map_err(|error| unsolved(input, error))?;
    }
    let summary = times.summary();
    outcome.iterations = summary.runs as usize + CLOSING_UPDATES;
    outcome.initialised_from = "odometry";
    outcome.time_ms = total.as_secs_f64() * 1e3;
    outcome.update_ms = Some(UpdateTimes {
        median: summary.p50_ms,
        p99: summary.p99_ms,
        max: summary.max_ms,
    });
    Ok(())
}

fn unsolved(path: &Path, error: Error) -> Failure {
    let next_step = match &error {
        Error::Unconstrained { .. } => "give it an edge whose information leaves no direction open",
        Error::Overflow { .. } => "check its measurement and information",
        _ => "check the file",
    };
    Failure::new(
        format_args!("{} can't be solved: {error}", path.display()),
        next_step,
    )
}

/// Lets the g2o writer write into a file that appears only when it is whole.
struct Into<'a> {
    file: &'a mut AtomicFile,
    failure: Option<WriteError>,
}

impl Write for Into<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes).map_err(|error| {
            let said = io::Error::other(error.to_string());
            self.failure = Some(error);
            said
        })?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn write<G: Writable>(graph: &Graph<G>, mut out: AtomicFile) -> Result<(), Failure> {
    let path = out.path().to_owned();
    let mut into = Into {
        file: &mut out,
        failure: None,
    };
    let written = g2o::write(graph, BufWriter::new(&mut into));
    match (written, into.failure) {
        (_, Some(error)) => Err(Failure::unwritten(&error)),
        (Err(error), None) => Err(Failure::writing(&path, &error)),
        (Ok(()), None) => out.commit().map_err(|error| Failure::unwritten(&error)),
    }
}

fn repaired(repairs: Repairs) -> Repaired {
    Repaired {
        duplicate_vertices: repairs.duplicate_vertices,
        duplicate_edges: repairs.duplicate_edges,
        missing_vertices: repairs.missing_vertices,
        scaled_quaternions: repairs.scaled_quaternions,
        clipped_information: repairs.clipped_information,
        unknown_fixed: repairs.unknown_fixed,
        loose_parts: repairs.loose_parts,
        unknown_tags: repairs.unknown_tags,
    }
}

fn text(outcome: &Outcome, out: &Path) -> String {
    let mut text = format!(
        "{} poses, {} edges, {} of them loops\n{}: error {:.6} to {:.6} in {:.1} ms, {} iterations \
         from {}{}\n",
        outcome.poses,
        outcome.edges,
        outcome.loops,
        outcome.solver,
        outcome.initial_error,
        outcome.final_error,
        outcome.time_ms,
        outcome.iterations,
        outcome.initialised_from,
        if outcome.converged {
            ""
        } else {
            ", NOT converged"
        },
    );
    if let Some(times) = &outcome.update_ms {
        text += &format!(
            "updates: median {:.3} ms, 99 % {:.3} ms, longest {:.3} ms\n",
            times.median, times.p99, times.max
        );
    }
    for line in complaints(&outcome.repairs) {
        text += &line;
        text.push('\n');
    }
    text + &format!("written to {}", out.display())
}

/// One line for each kind of repair that was needed.
fn complaints(repairs: &Repaired) -> Vec<String> {
    let counts = [
        (repairs.duplicate_vertices, "poses given again, left out"),
        (
            repairs.duplicate_edges,
            "edges given again, counted as they stand",
        ),
        (
            repairs.missing_vertices,
            "poses only in edges, placed along them",
        ),
        (
            repairs.scaled_quaternions,
            "quaternions not of length one, scaled",
        ),
        (
            repairs.clipped_information,
            "information matrices with an eigenvalue rounded below zero, set to zero",
        ),
        (
            repairs.unknown_fixed,
            "FIX of poses that are not there, left out",
        ),
        (
            repairs.loose_parts,
            "parts that no edge ties to the first, each held at its first pose",
        ),
    ];
    let seen = counts.iter().filter(|(count, _)| *count > 0);
    let mut lines: Vec<String> = seen
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    for (tag, count) in &repairs.unknown_tags {
        lines.push(format!("{count} lines {tag:?}, left out"));
    }
    lines
}
