//! All poses at once: Gauss-Newton and Levenberg-Marquardt.
//!
//! In: a [`Graph`] with initial poses. Out: the same graph with the poses of least error, and how
//! that went. Elsewhere: where good initial poses come from (`initialise`), the linear system
//! (`sparse`).

mod normal;

use crate::error::Error;
use crate::graph::Graph;
use crate::group::Group;
use normal::NormalEquations;

/// How steps are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The full step to the minimum of the linearised error. Fast near the minimum; may run away
    /// from a bad start, which is reported.
    GaussNewton,
    /// A step that is held back as far as the error needs: it never rises.
    #[default]
    LevenbergMarquardt,
}

/// When to stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How steps are taken.
    pub method: Method,
    /// At most so many linearisations.
    pub max_iterations: usize,
    /// Stop once a step is expected to lower the error by less than this share of it,
    pub relative_tolerance: f64,
    /// or by less than this.
    pub absolute_tolerance: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::LevenbergMarquardt,
            max_iterations: 100,
            relative_tolerance: 1e-8,
            absolute_tolerance: 1e-12,
        }
    }
}

/// How an optimisation went. Errors are half the sum of `kernel(r' * information * r)`.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// With the poses as they came.
    pub initial_error: f64,
    /// With the poses as they are now.
    pub final_error: f64,
    /// Linearisations.
    pub iterations: usize,
    /// Whether a tolerance was met.
    pub converged: bool,
}

/// Moves the poses of a graph to a minimum of its error.
///
/// # Errors
/// [`Error::Unconstrained`] if a pose hangs on no prior and no fixed pose, [`Error::Overflow`] if
/// numbers are too large. The graph is then as it was.
pub fn optimize<G: Group>(graph: &mut Graph<G>, options: &Options) -> Result<Report, Error> {
    graph.check_held()?;
    let initial_error = graph.finite_error()?;
    let mut report = Report {
        initial_error,
        final_error: initial_error,
        iterations: 0,
        converged: true,
    };
    let mut system = NormalEquations::new(graph)?;
    if system.is_empty() {
        return Ok(report);
    }
    report.converged = false;
    match options.method {
        Method::GaussNewton => gauss_newton(graph, &mut system, options, &mut report)?,
        Method::LevenbergMarquardt => {
            levenberg_marquardt(graph, &mut system, options, &mut report)?;
        }
    }
    Ok(report)
}

fn is_small(decrease: f64, error: f64, options: &Options) -> bool {
    decrease <= options.relative_tolerance * error || decrease <= options.absolute_tolerance
}

fn gauss_newton<G: Group>(
    graph: &mut Graph<G>,
    system: &mut NormalEquations<G>,
    options: &Options,
    report: &mut Report,
) -> Result<(), Error> {
    let mut poses = graph.poses.clone();
    let mut best = (report.initial_error, graph.poses.clone());
    while report.iterations < options.max_iterations {
        system.linearize(graph, &poses);
        report.iterations += 1;
        let decrease = system.solve(graph, 0.0)?;
        system.apply(&mut poses);
        let error = graph.error_at(&poses);
        if !error.is_finite() {
            break;
        }
        if error <= best.0 {
            best = (error, poses.clone());
        }
        if is_small(decrease, error, options) {
            report.converged = true;
            break;
        }
    }
    // A run that went astray leaves the best it has seen.
    report.final_error = best.0;
    graph.poses = best.1;
    Ok(())
}

/// Damping at the start, as a share of the diagonal: little, so that a good start converges as fast
/// as Gauss-Newton.
const FIRST_DAMPING: f64 = 1e-7;
const LEAST_DAMPING: f64 = 1e-12;
/// By which damping grows where the error would rise; squared each time, so that a useful damping is
/// found in a few tries.
const FIRST_GROWTH: f64 = 4.0;
/// Beyond this a step is too short to matter.
const MOST_DAMPING: f64 = 1e12;

/// Damping after Nielsen, *Damping parameter in Marquardt's method* (1999), on the diagonal as
/// Marquardt has it, so that metres and radians need no common scale.
fn levenberg_marquardt<G: Group>(
    graph: &mut Graph<G>,
    system: &mut NormalEquations<G>,
    options: &Options,
    report: &mut Report,
) -> Result<(), Error> {
    let mut damping = FIRST_DAMPING;
    let mut growth = FIRST_GROWTH;
    let mut error = report.initial_error;
    let mut trial = graph.poses.clone();
    while report.iterations < options.max_iterations && !report.converged {
        system.linearize(graph, &graph.poses);
        report.iterations += 1;
        loop {
            let decrease = system.solve(graph, damping)?;
            trial.copy_from_slice(&graph.poses);
            system.apply(&mut trial);
            let new_error = graph.error_at(&trial);
            let gain = (error - new_error) / decrease;
            if is_small(decrease, error, options) {
                report.converged = true;
            }
            if new_error <= error {
                graph.poses.copy_from_slice(&trial);
                error = new_error;
                let shrink = 1.0 - (2.0 * gain - 1.0).powi(3);
                damping = (damping * shrink.max(0.1)).max(LEAST_DAMPING);
                growth = FIRST_GROWTH;
                break;
            }
            if report.converged {
                break;
            }
            damping *= growth;
            growth *= growth;
            if damping > MOST_DAMPING {
                report.final_error = error;
                return Ok(());
            }
        }
    }
    report.final_error = error;
    Ok(())
}
