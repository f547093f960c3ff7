//! The iteration: pair, linearise, solve, move, until the step is small.

use hachi_hal::{Pose, Rotation, Vector3};
use nalgebra::{Matrix6, Vector6};

use crate::cloud::SurfacePoint;
use crate::degeneracy::Degeneracy;
use crate::linearize::{Linearizer, NormalEquations, SurfaceTarget};
use crate::pair::{FULL_WEIGHT, Kernel};

/// How the normal equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Solver {
    /// Full steps: fewest evaluations, for guesses that are close.
    #[default]
    GaussNewton,
    /// Damped steps that never raise the error, for guesses that are not.
    LevenbergMarquardt,
}

/// Settings of an alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AlignerConfig {
    /// Surfaces farther from a point than this are not paired with it.
    pub reach_m: f32,
    /// Iterations before giving up.
    pub max_iterations: usize,
    /// A step below this and the next is converged.
    pub translation_epsilon_m: f64,
    /// Likewise for the turn.
    pub rotation_epsilon_rad: f64,
    /// How much bad pairs count.
    pub kernel: Kernel,
    /// How the equations are solved.
    pub solver: Solver,
    /// See [`Degeneracy::of`]; an open direction keeps the guess.
    pub degeneracy_threshold: f64,
}

impl Default for AlignerConfig {
    fn default() -> Self {
        Self {
            reach_m: 1.0,
            max_iterations: 20,
            translation_epsilon_m: 1e-3,
            // A tenth of a degree, as small_gicp has it.
            rotation_epsilon_rad: 0.1_f64.to_radians(),
            // Three times the ranging noise of a LiDAR with its surface a few voxels wide: what
            // moved or appeared between two clouds fades, what fits counts in full.
            kernel: Kernel::GemanMcClure { scale_m: 0.3 },
            solver: Solver::GaussNewton,
            degeneracy_threshold: 0.0,
        }
    }
}

/// What is believed of the answer beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// The expected pose.
    pub target_from_source: Pose,
    /// Its information, rotation first, source frame; zero where nothing is known.
    pub information: Matrix6<f64>,
}

/// The answer, and how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Takes points of the source to the target.
    pub target_from_source: Pose,
    /// The last step was below the limits.
    pub converged: bool,
    /// Linearisations made.
    pub iterations: usize,
    /// Source points with a surface within reach.
    pub pairs: usize,
    /// `pairs` over the number of source points.
    pub inlier_share: f64,
    /// Root mean square distance of paired points from the surface they are paired with, metres.
    pub residual_m: f64,
    /// Half the weighted sum of squared distances.
    pub error: f64,
    /// Gauss-Newton Hessian at the last linearisation, rotation first, source frame. Unscaled: a
    /// pair whose surfaces agree weighs about 500 across them.
    pub information: Matrix6<f64>,
    /// What the clouds left open; held to the guess.
    pub degeneracy: Degeneracy,
}

/// Aligns clouds; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Aligner {
    linearizer: Linearizer,
}

impl Aligner {
    /// Lays `source` on `target`, starting from `guess`.
    pub fn align<T: SurfaceTarget>(
        &mut self,
        source: &[SurfacePoint],
        target: &T,
        guess: &Pose,
        prior: Option<&Prior>,
        config: &AlignerConfig,
    ) -> Registration {
        let mut pose = *guess;
        let mut damping = 1e-6;
        let mut degeneracy = Degeneracy::default();
        let mut out = Registration {
            target_from_source: pose,
            converged: false,
            iterations: 0,
            pairs: 0,
            inlier_share: 0.0,
            residual_m: 0.0,
            error: 0.0,
            information: Matrix6::zeros(),
            degeneracy,
        };
        while out.iterations < config.max_iterations {
            let mut equations =
                self.linearizer
                    .linearize(source, target, &pose, config.reach_m, config.kernel);
            out.iterations += 1;
            out.pairs = equations.pairs;
            out.inlier_share = equations.pairs as f64 / source.len().max(1) as f64;
            out.residual_m = (equations.across_sq / equations.pairs.max(1) as f64).sqrt();
            out.error = equations.error;
            out.information = equations.information;
            if equations.pairs == 0 {
                break;
            }
            if config.degeneracy_threshold > 0.0 {
                degeneracy = Degeneracy::of(
                    &equations.information,
                    equations.tangential,
                    config.degeneracy_threshold,
                );
                let hold = degeneracy.hold(equations.pairs as f64 * FULL_WEIGHT * 100.0);
                add_prior(&mut equations, &pose, guess, &hold);
                out.degeneracy = degeneracy;
            }
            if let Some(prior) = prior {
                add_prior(
                    &mut equations,
                    &pose,
                    &prior.target_from_source,
                    &prior.information,
                );
            }
            let step = match config.solver {
                Solver::GaussNewton => solve(&equations, 0.0),
                Solver::LevenbergMarquardt => {
                    self.damped_step(source, &pose, &equations, config.kernel, &mut damping)
                }
            };
            let Some(step) = step else { break };
            pose = moved(&pose, &step);
            let (turn, shift) = (
                step.fixed_rows::<3>(0).norm(),
                step.fixed_rows::<3>(3).norm(),
            );
            if turn < config.rotation_epsilon_rad && shift < config.translation_epsilon_m {
                out.converged = true;
                break;
            }
        }
        out.target_from_source = pose;
        out
    }

    /// A step that lowers the error of the current pairs, damping more until one does.
    fn damped_step(
        &self,
        source: &[SurfacePoint],
        pose: &Pose,
        equations: &NormalEquations,
        kernel: Kernel,
        damping: &mut f64,
    ) -> Option<Vector6<f64>> {
        const TRIES: usize = 10;
        for _ in 0..TRIES {
            let step = solve(equations, *damping)?;
            if self
                .linearizer
                .error_at(source, &moved(pose, &step), kernel)
                <= equations.error
            {
                *damping = (*damping * 0.1).max(1e-9);
                return Some(step);
            }
            *damping *= 10.0;
        }
        None
    }
}

/// The pose after an update on its right.
fn moved(pose: &Pose, step: &Vector6<f64>) -> Pose {
    let turn = Rotation::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
    let shift: Vector3 = step.fixed_rows::<3>(3).into_owned();
    let mut new = pose * Pose::from_parts(shift.into(), turn);
    // Products of unit quaternions lose their length a rounding error at a time.
    new.rotation.renormalize_fast();
    new
}

fn add_prior(
    equations: &mut NormalEquations,
    pose: &Pose,
    expected: &Pose,
    information: &Matrix6<f64>,
) {
    let difference = expected.inv_mul(pose);
    let (turn, shift) = (
        difference.rotation.scaled_axis(),
        pose.rotation.inverse() * (pose.translation.vector - expected.translation.vector),
    );
    let residual = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
    equations.information += information;
    equations.gradient += information * residual;
}

/// `(information + damping diag) step = -gradient`; `None` if that is singular or not finite.
fn solve(equations: &NormalEquations, damping: f64) -> Option<Vector6<f64>> {
    let mut system = equations.information;
    for i in 0..6 {
        system[(i, i)] += damping * system[(i, i)] + 1e-9;
    }
    let step = system.cholesky()?.solve(&-equations.gradient);
    step.iter().all(|v| v.is_finite()).then_some(step)
}
