//! Laying one place on another, a little at a time.
//!
//! In: surfaces of two places in their own frames, and guesses. Out: the transform from the guess
//! that leads farthest, with how well it fits. The work is cut into steps of about equal size, so
//! that a robot's pose is never late because of a loop; how it is cut does not depend on any clock.

use hachi_hal::Pose;
use hachi_registration::{
    Aligner, AlignerConfig, Kernel, Registration, Solver, SurfacePoint, SurfaceTarget,
};
use rayon::prelude::*;

use crate::surfaces::Surfaces;

/// Surfaces that a guess is tried with.
const COARSE_POINTS: usize = 800;
/// Surfaces that the best guess is refined with.
const FINE_POINTS: usize = 3_000;
/// Iterations with few surfaces, and with many, before giving up.
const COARSE_ITERATIONS: usize = 16;
const FINE_ITERATIONS: usize = 12;
/// Iterations made in one step.
const COARSE_AT_ONCE: usize = 8;
const FINE_AT_ONCE: usize = 2;
/// Of guesses that stand for different places, one that fits less than this share of what the best
/// fits is none.
const WORTH: f64 = 0.6;
/// A direction of which the surfaces say less than this share of what they say of the best one is
/// left to the guess: see `hachi_registration::Degeneracy`.
pub(crate) const OPEN_SHARE: f64 = 0.003;
/// Points handed to one task: fixed, for the same sums with any number of threads.
const CHUNK: usize = 256;
/// Cosine between normals that lie on one surface.
const SAME_SURFACE: f32 = 0.8;

/// How well one place lies on another.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fitness {
    /// Share of the surfaces that have another near them.
    pub overlap: f64,
    /// Share of all surfaces that lie on one.
    pub fit_share: f64,
    /// Root mean square distance of those from it, metres.
    pub residual_m: f64,
}

impl Fitness {
    /// Of the surfaces that have another near them, how many lie on it.
    pub fn inlier_share(&self) -> f64 {
        if self.overlap > 0.0 {
            self.fit_share / self.overlap
        } else {
            0.0
        }
    }
}

/// What came of an alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aligned {
    /// The transform and what it rests on.
    pub found: Registration,
    /// How well it fits.
    pub fitness: Fitness,
    /// Which guess it came from.
    pub guess: usize,
}

/// An alignment in the making; keeps its buffers.
#[derive(Debug, Default)]
pub struct Alignment {
    aligner: Aligner,
    coarse: Vec<SurfacePoint>,
    fine: Vec<SurfacePoint>,
    guesses: Vec<Trial>,
    phase: Phase,
    /// Not the best guess alone is refined, but each that is worth it.
    each: bool,
}

/// A guess, and how far it was followed.
#[derive(Debug, Clone, Copy)]
struct Trial {
    pose: Pose,
    iterations: usize,
    done: bool,
    /// It has been answered.
    told: bool,
    fitness: Fitness,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Phase {
    #[default]
    Idle,
    Coarse,
    Fine,
}

impl Alignment {
    /// Begins: `source` is laid on whatever target [`Alignment::step`] is called with, from each of
    /// `guesses` (`target_from_source`).
    pub fn begin(&mut self, source: &Surfaces, guesses: &[Pose]) {
        source.pick(COARSE_POINTS, &mut self.coarse);
        source.pick(FINE_POINTS, &mut self.fine);
        self.guesses.clear();
        self.guesses.extend(guesses.iter().map(|&pose| Trial {
            pose,
            iterations: 0,
            done: false,
            told: false,
            fitness: Fitness::default(),
        }));
        self.each = false;
        self.phase = if guesses.is_empty() {
            Phase::Idle
        } else {
            Phase::Coarse
        };
    }

    /// Begins with a guess that is close: only the last part is done.
    pub fn begin_close(&mut self, source: &Surfaces, guess: &Pose) {
        self.begin(source, &[*guess]);
        self.phase = Phase::Fine;
    }

    /// Begins with guesses that stand for different places: [`Alignment::step`] answers for each that
    /// leads about as far as the best, until [`Alignment::is_over`].
    pub fn begin_each(&mut self, source: &Surfaces, guesses: &[Pose]) {
        self.begin(source, guesses);
        self.each = true;
    }

    /// Whether there is nothing left to do.
    pub fn is_over(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// How well each guess fits, as far as it was followed with few surfaces.
    pub fn guess_fitness(&self, guess: usize) -> Option<f64> {
        self.guesses.get(guess).map(|t| t.fitness.fit_share)
    }

    /// One step; the answer when there is one.
    pub fn step(&mut self, target: &Surfaces) -> Option<Aligned> {
        match self.phase {
            Phase::Idle => None,
            Phase::Coarse => {
                self.coarse_step(target);
                None
            }
            Phase::Fine => self.fine_step(target),
        }
    }

    /// Follows the next guess that is not done; after the last, the best is refined.
    fn coarse_step(&mut self, target: &Surfaces) {
        let cell = target.voxel_m();
        let Some(index) = self.guesses.iter().position(|t| !t.done) else {
            self.phase = Phase::Fine;
            return;
        };
        let trial = self.guesses[index];
        let config = AlignerConfig {
            reach_m: if trial.iterations == 0 { 2.0f32 } else { 1.2 }.max(5.0 * cell),
            max_iterations: COARSE_AT_ONCE,
            translation_epsilon_m: 5e-3,
            rotation_epsilon_rad: 2e-3,
            kernel: Kernel::GemanMcClure {
                scale_m: if trial.iterations == 0 { 1.0 } else { 0.4 },
            },
            solver: Solver::GaussNewton,
            degeneracy_threshold: OPEN_SHARE,
        };
        let found = self
            .aligner
            .align(&self.coarse, target, &trial.pose, None, &config);
        let iterations = trial.iterations + found.iterations;
        let done = found.pairs == 0
            || iterations >= COARSE_ITERATIONS
            || (found.converged && trial.iterations > 0);
        self.guesses[index] = Trial {
            told: false,
            pose: found.target_from_source,
            // The wide reach counts as one round, however soon it came to rest.
            iterations: iterations.max(COARSE_AT_ONCE),
            done,
            fitness: if done {
                judge(&self.coarse, target, &found.target_from_source)
            } else {
                Fitness::default()
            },
        };
        if self.guesses.iter().all(|t| t.done) {
            self.phase = Phase::Fine;
        }
    }

    /// Of the guesses that were not answered the one that led farthest; of equals the earlier.
    fn best(&self) -> Option<usize> {
        let fit = |i: usize| self.guesses[i].fitness.fit_share;
        (0..self.guesses.len())
            .filter(|&i| !self.guesses[i].told)
            .reduce(|best, i| if fit(i) > fit(best) { i } else { best })
    }

    /// Whether another guess is worth an answer of its own.
    fn goes_on(&self) -> bool {
        let fit = |t: &Trial| t.fitness.fit_share;
        let most = self.guesses.iter().map(fit).fold(0.0, f64::max);
        self.each
            && self
                .best()
                .is_some_and(|i| fit(&self.guesses[i]) >= WORTH * most)
    }

    fn fine_step(&mut self, target: &Surfaces) -> Option<Aligned> {
        let Some(guess) = self.best() else {
            self.phase = Phase::Idle;
            return None;
        };
        let trial = self.guesses[guess];
        let iterations = if trial.done { 0 } else { trial.iterations };
        let cell = target.voxel_m();
        let config = AlignerConfig {
            reach_m: 0.5f32.max(2.0 * cell),
            max_iterations: FINE_AT_ONCE,
            translation_epsilon_m: 5e-4,
            rotation_epsilon_rad: 2e-4,
            kernel: Kernel::GemanMcClure { scale_m: 0.15 },
            solver: Solver::GaussNewton,
            degeneracy_threshold: OPEN_SHARE,
        };
        let mut found = self
            .aligner
            .align(&self.fine, target, &trial.pose, None, &config);
        found.iterations += iterations;
        let over = found.converged || found.pairs == 0 || found.iterations >= FINE_ITERATIONS;
        self.guesses[guess] = Trial {
            pose: found.target_from_source,
            iterations: found.iterations,
            done: false,
            ..trial
        };
        if !over {
            return None;
        }
        self.guesses[guess].told = true;
        if !self.goes_on() {
            self.phase = Phase::Idle;
        }
        Some(Aligned {
            found,
            fitness: judge(&self.fine, target, &found.target_from_source),
            guess,
        })
    }
}

/// Looks at every source surface where `target_from_source` puts it.
pub fn judge(source: &[SurfacePoint], target: &Surfaces, target_from_source: &Pose) -> Fitness {
    let pose = target_from_source.cast::<f32>();
    let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
    let cell = target.voxel_m();
    let reach = 0.5f32.max(2.0 * cell);
    let fits_within = 0.1f32.max(0.4 * cell);
    let sums: Vec<[f64; 3]> = source
        .par_chunks(CHUNK)
        .map(|points| {
            let mut sum = [0.0; 3];
            for point in points {
                let moved: [f32; 3] =
                    (rotation * nalgebra::Vector3::from(point.position) + shift).into();
                let Some(near) = target.closest(moved, reach * reach) else {
                    continue;
                };
                sum[0] += 1.0;
                let normal = rotation * nalgebra::Vector3::from(point.normal);
                let surface = nalgebra::Vector3::from(near.normal);
                let across: f32 = (0..3)
                    .map(|a| near.normal[a] * (moved[a] - near.position[a]))
                    .sum();
                let alike = normal == nalgebra::Vector3::zeros()
                    || surface == nalgebra::Vector3::zeros()
                    || normal.dot(&surface) > SAME_SURFACE;
                if alike && across.abs() < fits_within {
                    sum[1] += 1.0;
                    sum[2] += f64::from(across * across);
                }
            }
            sum
        })
        .collect();
    let [near, fitting, across_sq] = sums
        .iter()
        .fold([0.0; 3], |t, s| std::array::from_fn(|i| t[i] + s[i]));
    let count = source.len().max(1) as f64;
    Fitness {
        overlap: near / count,
        fit_share: fitting / count,
        residual_m: (across_sq / fitting.max(1.0)).sqrt(),
    }
}
